"""What the commands share: errors of one line, choices that know what was meant, and what a task is asked under."""

from __future__ import annotations

import io
import json
import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from fieldgym.kernels.seeds import HeldOutError, refuse_held_out

if TYPE_CHECKING:
    from fieldgym.agents.sources import PolicySource
    from fieldgym.benchmark.fields import FieldFile
    from fieldgym.benchmark.suites import Condition
    from fieldgym.envs import TaskSpec

USAGE_ERROR = 2
INTERRUPTED = 130


Scenario = Annotated[
    str | None, typer.Option(metavar="NAME|FILE", help="A name or a .yaml file; by default the headline scenario.")
]
Sets = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Another number, as process.power_w=150; may be repeated."),
]
Fields = Annotated[
    Path | None, typer.Option(metavar="FOLDER", help="Play its field files, one an episode, instead of seeds.")
]
Trust = Annotated[
    bool, typer.Option("--trust", help="Load saved Stable-Baselines3 models (.zip), which may run any code.")
]


class CommandError(Exception):
    """What was asked cannot be done; the message is one line and says what to do instead."""


class OutputError(CommandError):
    """The standard output takes nothing more."""


def chosen(value: str, choices: Sequence[str], what: str, more: str = "") -> str:
    """``value`` when it is one of ``choices``; ``more`` says what else it may be.

    Raises:
        CommandError: it is not; the message lists the choices and names the nearest.
    """
    from fieldgym.envs.assembly import meant

    if value in choices:
        return value
    raise CommandError(f"no {what} is called {value!r}: {meant(value, choices)}{more}")


def at_least_one(value: int, option: str) -> int:
    """``value`` when it is positive.

    Raises:
        CommandError: it is not.
    """
    if value < 1:
        raise CommandError(f"{option} {value}: give at least 1")
    return value


def environment_id(name: str) -> str:
    """The registered id that ``name`` means; namespace and version may be left out.

    With a module in front, ``module:name``, that is imported first and stays in front: workers need it too.

    Raises:
        CommandError: there is no such environment, or its module fails.
    """
    from fieldgym.agents.foreign import ForeignError, guarded
    from fieldgym.envs import env_ids
    from fieldgym.envs.task import register_from

    module, _, bare = name.rpartition(":")
    if module:
        try:
            guarded(lambda: register_from(module))
        except ForeignError as error:
            raise CommandError(f"environment {name!r}: {error}") from None
    ids = env_ids()
    short = {env_id.rpartition("/")[2].rpartition("-v")[0].lower(): env_id for env_id in reversed(ids)}
    versioned = {env_id.rpartition("/")[2]: env_id for env_id in reversed(ids)}
    found = bare if bare in ids else versioned.get(bare) or short.get(bare.rpartition("/")[2].lower())
    if found is None:
        return chosen(bare, ids, "environment")
    return f"{module}:{found}" if module else found


def usable_tasks() -> list[TaskSpec]:
    """Every task that can be loaded; the others are told, a line each."""
    from fieldgym.benchmark.suites import usable_tasks as usable

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = usable()
    for warning in told:
        tell(warning.message)
    return found


def numbers_of(words: Sequence[str], option: str = "--set") -> dict[str, Any]:
    """Numbers by dotted name from an option's ``name=value``; values are JSON, anything else is text.

    Raises:
        CommandError: a word has no ``=`` or a name comes twice.
    """
    numbers: dict[str, Any] = {}
    for word in words:
        name, equals, value = (part.strip() for part in word.partition("="))
        if not equals or not name:
            raise CommandError(f"{option} {word}: give NAME=VALUE, as in process.power_w=150")
        if name in numbers:
            raise CommandError(f"{option} {name}: given twice, give it once")
        try:
            numbers[name] = json.loads(value)
        except ValueError:
            numbers[name] = value
    return numbers


def scenario_of(spec: TaskSpec, scenario: str | None, sets: Sequence[str]) -> tuple[str, dict[str, Any]]:
    """A scenario's name for titles, and the numbers that are changed, those of a scenario's file among them.

    Raises:
        CommandError: the scenario is unknown, its file is none, or a number is not allowed.
    """
    from fieldgym.kernels.config_fields import plain

    name, numbers = scenario or spec.headline, numbers_of(sets)
    if not name.endswith((".yaml", ".yml")):
        chosen(name, spec.scenarios, f"scenario of {spec.id}", ", or give a .yaml file")
    with told_in_one_line():
        spec.assembly.configured(name, overrides=numbers)
        if name not in spec.scenarios:
            numbers["scenario"] = plain(spec.assembly.scenario(name))
    return name, numbers


def condition_of(
    env_id: str,
    scenario: str | None,
    backend: str | None,
    perception: str | None,
    sets: Sequence[str],
    fields: Path | None,
) -> Condition:
    """What a policy is to meet, every word of it checked.

    Raises:
        CommandError: a word is unknown or a number is not allowed.
    """
    from fieldgym.benchmark.suites import Condition, changes_of
    from fieldgym.envs import task

    spec = task(env_id)
    backend = chosen(backend or spec.backends[0], spec.backends, "backend")
    seen = chosen(perception or spec.assembly.default_perception(backend), spec.perceptions, "perception")
    name, numbers = scenario_of(spec, scenario, sets)
    return Condition(env_id, name, backend, seen, changes_of(numbers), str(fields or ""))


def seeds_of(seed: int, episodes: int | None, fields: Path | None, default: int) -> range:
    """The seeds that are asked for.

    Raises:
        CommandError: they are no such, held out for the benchmark, or fields are asked for as well.
    """
    if seed < 0:
        raise CommandError(f"--seed {seed}: give 0 or more")
    if episodes is not None and fields is not None:
        raise CommandError(f"--episodes {episodes} with --fields: every file of the folder is an episode, give one")
    seeds = range(seed, seed + at_least_one(default if episodes is None else episodes, "--episodes"))
    try:
        refuse_held_out(seeds)
    except HeldOutError as error:
        raise CommandError(f"--seed {seed}: {error}") from None
    return seeds


def fields_of(condition: Condition, seed: int) -> tuple[FieldFile, ...]:
    """The files of a condition's folder of fields, each tried; none where there is no folder.

    Raises:
        CommandError: the folder holds none, or one is no field of this task.
    """
    from fieldgym.benchmark.fields import field_files

    if not condition.fields:
        return ()
    settings = condition.settings
    if settings["perception"] == "camera":  # what is checked needs no picture
        settings["perception"] = "perfect"
    with told_in_one_line():
        return field_files(condition.env_id, condition.fields, settings, seed)


def policy_of(env_id: str, name: str, trust: bool) -> PolicySource:
    """Where a policy comes from; its code was run once, so that it is known to work.

    Raises:
        CommandError: there is no such policy, or its code fails.
    """
    from fieldgym.agents.sources import policy_source

    with told_in_one_line():
        source = policy_source(env_id, name, trust)
        source.factory()
        return source


@contextmanager
def told_in_one_line() -> Iterator[None]:
    """Make a command's error of what is wrong with a user's words, files and policies."""
    try:
        yield
    except ValueError as error:
        raise CommandError(" ".join(str(error).split())) from None


def writable_folder(folder: Path, option: str) -> Path:
    """``folder``, made if need be.

    Raises:
        CommandError: it cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandError(
            f"cannot make the folder {folder} ({error.strerror}): choose another with {option}"
        ) from None
    if not os.access(folder, os.W_OK):
        raise CommandError(f"the folder {folder} is read-only: choose another with {option}")
    return folder


def execute(app: typer.Typer, name: str) -> NoReturn:
    """Run ``app`` on this process's arguments and leave with its exit code.

    What a user did wrong is told in one line, without a traceback.

    Args:
        app: the commands.
        name: what the help and the errors call the program.
    """
    # What is said of a policy or a plug-in is for a user, who has no use for the place in the code.
    warnings.showwarning = lambda message, *_, **__: tell(message)
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())  # module:Name means a module that lies here, too
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a table with a question mark in it is better than none
    _guard_output()
    try:
        if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:  # as the package set it for the time of its loading
            signal.signal(signal.SIGINT, signal.default_int_handler)
        code = app(prog_name=name, standalone_mode=False)
        sys.stdout.flush()
    except CommandError as error:
        if isinstance(error, OutputError):
            # What is left in the buffer would fail once more when Python ends.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(_told(str(error), USAGE_ERROR))
    except (KeyboardInterrupt, typer.Abort):
        sys.exit(_told("stopped", INTERRUPTED))
    except ImportError as error:
        if error.name != "pybullet":
            raise
        sys.exit(_told(str(error), USAGE_ERROR))
    except Exception as error:
        # Typer's usage errors share no public base class; they all can format themselves.
        describe = getattr(error, "format_message", None)
        if describe is None:
            raise
        context = getattr(error, "ctx", None)
        path = context.command_path if context is not None else name
        sys.exit(_told(f"{' '.join(describe().split())} See: {path} --help", USAGE_ERROR))
    sys.exit(code if isinstance(code, int) else 0)


def _guard_output() -> None:
    """Let an error of the standard output be told as its own: a command blames errors of writing on its folder."""

    def guarded(action: Callable[..., Any]) -> Callable[..., Any]:
        def act(*arguments: Any) -> Any:
            try:
                return action(*arguments)
            except BrokenPipeError:  # who reads has had enough
                raise
            except OSError as error:
                raise OutputError(f"cannot write to the standard output ({error.strerror})") from None

        return act

    for name in ("write", "flush"):
        setattr(sys.stdout, name, guarded(getattr(sys.stdout, name)))


def tell(message: object) -> None:
    """Say something on the standard error, in one line whatever a file, a policy or an error is called."""
    from fieldgym.kernels.config_kinds import one_line

    print(f"fieldgym: {one_line(str(message))}", file=sys.stderr)


def _told(message: str, code: int) -> int:
    tell(message)
    return code
