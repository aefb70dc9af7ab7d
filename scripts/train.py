"""``fieldgym train``: learn a policy, watch it learn, and go on after an interruption."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fieldgym.scripts.common import (
    INTERRUPTED,
    CommandError,
    at_least_one,
    chosen,
    environment_id,
    tell,
    told_in_one_line,
    writable_folder,
)
from fieldgym.scripts.train_beside import TimeLeft, beside, told

if TYPE_CHECKING:
    from rich.console import Console

    from fieldgym.agents.learning.runs import Progress

PLAIN_EVERY = 10
"""Updates between two lines where nothing can be redrawn, as in a log file; a round of a task's own algorithm is worth
a line of its own."""


def main(
    env: Annotated[str, typer.Argument(metavar="ID", help="An environment; see fieldgym list.", show_default=False)],
    algo: Annotated[
        str | None, typer.Option(help="maskable-ppo, ppo, or one of the task's own; by default what is tuned.")
    ] = None,
    scenario: Annotated[str | None, typer.Option(help="By default the environment's headline scenario.")] = None,
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="YAML with settings of your own.")] = None,
    steps: Annotated[int | None, typer.Option(help="Decisions to learn from; by default what is tuned.")] = None,
    minutes: Annotated[
        float | None, typer.Option(help="Wall time after which it ends, if the decisions do not end it before.")
    ] = None,
    observation: Annotated[
        str | None, typer.Option(help="features, or pixels: what a convolutional network sees in pictures.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the run.")] = 0,
    threads: Annotated[int | None, typer.Option(help="PyTorch threads; by default one a core.")] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="By default results/train/NAME-SCENARIO-SEED.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the folder's checkpoint.")] = False,
    view: Annotated[
        bool, typer.Option("--view", help="Play the policy as of its last evaluation in the browser (view extra).")
    ] = False,
) -> None:
    """Train a policy on the analytic backend with a checkpoint after every update.

    Stop with Ctrl-C, or lose the machine: --resume goes on as if nothing had happened. best.npz is the policy; see
    what it scores with fieldgym evaluate.

    Try:

      fieldgym train SafflowerPicking --scenario row

      fieldgym train SafflowerPicking --scenario row --resume

      fieldgym train HoeWeeding --view

      tensorboard --logdir results/train
    """
    from rich.console import Console

    from fieldgym.agents.learning.train_settings import OBSERVED, algorithms, tuned
    from fieldgym.envs import task

    env_id = environment_id(env)
    spec = task(env_id)
    if algo is not None:
        chosen(algo, algorithms(spec), f"algorithm for {env_id}")
    if observation is not None:
        chosen(observation, OBSERVED, "observation")
    if steps is not None:
        at_least_one(steps, "--steps")
    if threads is not None:
        at_least_one(threads, "--threads")
    if not 0 <= seed < 100_000:
        raise CommandError(f"--seed {seed}: give 0 to 99999")
    try:
        import stable_baselines3  # noqa: F401
        import torch  # noqa: F401
        import yaml  # noqa: F401
        from sb3_contrib import MaskablePPO  # noqa: F401
        from torch.utils.tensorboard import SummaryWriter  # noqa: F401
    except ImportError as error:
        raise CommandError(f'training needs {error.name}: pip install "fieldgym[rl]"') from None
    try:
        settings = tuned(env_id, scenario, config, algo=algo, steps=steps, minutes=minutes, observation=observation)
    except ValueError as error:
        raise CommandError(str(error)) from None
    if view:
        _check_view(settings)
    name = env_id.split("/")[-1]
    folder = out or Path("results/train") / f"{name}-{settings.scenario}-{seed}"
    if resume and not folder.is_dir():
        raise CommandError(f"there is no checkpoint in {folder}: start without --resume, or name its folder with --out")
    writable_folder(folder, "--out")
    console = Console(highlight=False)
    with _viewed(console, env_id, settings, folder) if view else nullcontext():
        _train(console, env_id, settings, folder, seed, threads, resume)


def _check_view(settings: Any) -> None:
    from fieldgym.scripts.view import check_viser

    if settings.observation != "features":
        raise CommandError(
            f"--view shows policies that see features, this one sees {settings.observation}: leave it out"
        )
    check_viser()


@contextmanager
def _viewed(console: Console, env_id: str, settings: Any, folder: Path) -> Iterator[None]:
    """A page beside the training, in a process of its own; nothing is played while nobody watches."""
    from fieldgym.agents import reference_policy
    from fieldgym.agents.learning.runs import LAST
    from fieldgym.scripts.view import seat_of
    from fieldgym.viewer.follow import beside
    from fieldgym.viewer.play import Play

    options = {"scenario": settings.scenario, "backend": "analytic"}
    before = Play(env_id, reference_policy(env_id), settings=options)
    try:
        process, address = beside(before, folder / LAST, seat_of)
    except OSError as error:
        raise CommandError(str(error)) from None
    console.print(f"Watch the policy as of its last evaluation at {address}", soft_wrap=True)
    try:
        yield
    finally:
        process.terminate()
        process.join()


def _train(
    console: Console, env_id: str, settings: Any, folder: Path, seed: int, threads: int | None, resume: bool
) -> None:
    from fieldgym.agents.learning import training
    from fieldgym.agents.learning.runs import CheckpointError
    from fieldgym.envs.references import resolved
    from fieldgym.envs.task import task
    from fieldgym.kernels.locks import FolderBusyError
    from fieldgym.kernels.seeds import CHOOSING

    if not resume and any(folder.glob("state.*")):
        raise CommandError(f"{folder} holds a run already: go on with --resume, or choose another folder with --out")
    at_most = "" if settings.minutes is None else f", at most {settings.minutes:g} min"
    told_of = f"{settings.algo}, {settings.steps:,} decisions{at_most}, into {folder}"
    console.print(f"{env_id}, {settings.scenario}: {told_of}", soft_wrap=True)
    own = task(env_id).learners.get(settings.algo)
    train = partial(training.train, threads=threads) if own is None else resolved(own)
    fields = f"{settings.evaluation_episodes} seeds from {CHOOSING.first}"
    with console.status(f"measuring what others return on {fields}"), told_in_one_line():
        others = beside(env_id, settings.scenario, settings.evaluation_episodes)
    console.print(f"Returns on {fields}, which the weights are chosen on: {told(others)}", soft_wrap=True)
    try:
        with _shown(console, PLAIN_EVERY if own is None else 1, told(others), settings.minutes) as show:
            result = train(env_id, settings, folder, seed=seed, resume=resume, on_update=show)
    except (CheckpointError, FolderBusyError, ValueError) as error:
        raise CommandError(str(error)) from None
    except OSError as error:
        raise CommandError(f"cannot write to {folder} ({error.strerror}): choose another folder with --out") from None
    except KeyboardInterrupt:
        tell(f"stopped; the last update's checkpoint is in {folder}. Go on with --resume")
        raise typer.Exit(INTERRUPTED) from None
    console.print(result.progress.split(), soft_wrap=True)
    for point in result.curve[-1:]:
        console.print(_chosen_on(point), soft_wrap=True)
        console.print(f"Others there: {told(others)}", soft_wrap=True)
    console.print(f"Policy: {result.best}; see fieldgym evaluate {env_id} --policy {result.best}", soft_wrap=True)


@contextmanager
def _shown(console: Console, every: int, others: str, minutes: float | None) -> Iterator[Any]:
    """A bar on a terminal, a line every so many updates anywhere else; ``others`` stand beside the learner's return."""
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    bar = Bar(*columns, TextColumn("{task.description}"), console=console, disable=not console.is_terminal)
    task, left = bar.add_task("collecting", total=None), TimeLeft()

    def show(progress: Progress) -> None:
        left_s = left.after(progress)
        if left_s is not None and minutes is not None:
            left_s = min(left_s, max(60.0 * minutes - progress.wall_s, 0.0))
        text = _latest(progress, others) + ("" if left_s is None else f"; {left_s:.0f} s left")
        bar.update(task, total=progress.total, completed=progress.steps, description=text)
        if not console.is_terminal and progress.updates % every == 0:
            console.print(f"  {progress.steps:>10,}  {text}", soft_wrap=True)

    with bar:
        yield show


def _latest(progress: Progress, others: str) -> str:
    own = f"{progress.held_out['return']:.3f}" if progress.held_out else "not yet known"
    text = f"return {own} ({others})"
    if math.isnan(progress.returns):
        return text
    rates = f"net rate {progress.net_rate:.3f}, cycle {progress.cycle_time_s:.2f} s"
    return f"{text}; in training {progress.returns:.3f}, {rates}"


def _chosen_on(point: dict[str, float]) -> str:
    return (
        f"Seeds that weights are chosen on, after {point['steps']:,.0f} decisions: return {point['return']:.3f}, "
        f"net rate {point['net_rate']:.4f}, cycle time {point['cycle_time_s']:.2f} s"
    )
