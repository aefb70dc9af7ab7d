"""Gymnasium's own tests of environments, rendering and batches, with this package's environments in them.

    git clone --depth 1 --branch v1.4.0 https://github.com/Farama-Foundation/Gymnasium
    python scripts/gymnasium_tests.py Gymnasium/tests [--only SafflowerPicking] [--backend analytic]

The tests of a clone, at the release that is installed, are copied to a folder for the time of the run and changed there
in three ways: ``tests/envs/utils.py``, which finds the environments that are tested, finds every id of this package on
each of its backends; the class behind ``CartPole-v1``, which is the tests' example, is that of an id, in turn each of
them on each backend (``gymnasium_stand_in.py``); and ``RETOLD`` has the few lines in which they take another
environment of Gymnasium's as an example, or ask what holds of CartPole alone. Needs the extra ``test``, and dill.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import typer

from fieldgym.scripts import gymnasium_stand_in as stand_in

ROOT = Path(__file__).resolve().parents[1]
FILES = (
    "tests/envs",
    "tests/vector",
    "tests/wrappers/test_add_render_observation.py",
    "tests/wrappers/test_human_rendering.py",
    "tests/wrappers/test_record_video.py",
    "tests/wrappers/test_white_noise_rendering.py",
    "tests/wrappers/vector/test_human_rendering.py",
    "tests/wrappers/vector/test_record_video.py",
)
UTILS = """
import gymnasium as gym
from fieldgym.scripts.gymnasium_stand_in import specs

all_testing_env_specs = [spec.make(disable_env_checker=True).unwrapped.spec for spec in specs()]
mujoco_testing_env_specs, gym_testing_env_specs = [], all_testing_env_specs


def __getattr__(name):
    if name != "all_testing_initialised_envs":
        raise AttributeError(name)
    return [spec.make(disable_env_checker=True).unwrapped for spec in specs()]
"""
"""Each file that asks gets environments of its own: one closes them, and what is closed cannot be reset here."""
RETOLD = {
    "tests/vector/test_sync_vector_env.py": (
        ('make_env("FrozenLake-v1", i)', 'make_env("CartPole-v1", i)'),
        ("isinstance(env.observation_space, MultiDiscrete)", "isinstance(env.observation_space, Box)"),
    ),
    "tests/vector/test_async_vector_env.py": (
        # Asks it of the names in an info, of which CartPole's has none.
        ("all([isinstance(info, dict) for info in infos])", "isinstance(infos, dict)"),
    ),
    "tests/vector/test_vector_wrapper.py": (('"FrozenLake-v1"', '"CartPole-v1"'),),
    "tests/envs/registration/test_make.py": (('"CarRacing-v3"', '"CartPole-v1"'),),
}
"""Lines that hold of CartPole alone, or take another environment of Gymnasium's as an example, and what they become."""


def main(
    tests: Annotated[Path, typer.Argument(help="The folder tests of a clone of Gymnasium.", exists=True)],
    only: Annotated[str, typer.Option(help="Ids whose name begins so, as examples.")] = "",
    backend: Annotated[str, typer.Option(help="Examples on this backend alone.")] = "",
    keep: Annotated[Path | None, typer.Option(help="File that outcomes are appended to, one a line.")] = None,
    match: Annotated[str, typer.Option("-k", help="Tests whose name has it, as for pytest.")] = "",
    rest: Annotated[bool, typer.Option("--examples", help="Only the tests that take an example.")] = False,
) -> None:
    """Run Gymnasium's own tests over every id and backend, and say what passed, failed and was left out."""
    examples = sorted((tuple(spec.id.split("/")) for spec in stand_in.specs()), key=lambda example: example[0])
    chosen = [(on, name) for on, name in examples if name.startswith(only) and backend in ("", on)]
    if not chosen:
        told = f"no id begins with {only} and runs on {backend or 'any backend'}"
        raise typer.BadParameter(told, param_hint="--only")
    rows = []
    with tempfile.TemporaryDirectory(prefix="fieldgym-gymnasium-") as folder:
        _prepare(tests.resolve(), Path(folder))
        for number, (on, name) in enumerate(chosen):
            which = "" if number == 0 and not rest else stand_in.EXAMPLE
            typer.echo(f"== {which or 'all tests'}; CartPole is {name} on {on}")
            found = _run(Path(folder), f"fieldgym/{name} {on}", which, match)
            rows += found
            typer.echo(f"   {_counted(found)}")
            if keep is not None:
                with keep.open("a", encoding="utf-8") as file:
                    file.writelines(json.dumps(row) + "\n" for row in found)
    for outcome in ("failed", "skipped"):
        named = Counter((row["test"], row["why"]) for row in rows if row["outcome"] == outcome)
        for (test, why), times in sorted(named.items()):
            typer.echo(f"{outcome} {times} x  {test}  {why.removeprefix('Skipped: ')}".rstrip())
    files = [f"{name}: {why}" for name, why in stand_in.FILES_OF_THEIRS.items()]
    typer.echo("\n".join(["not run, as they are of single environments of Gymnasium's:", *files]))
    typer.echo(f"Gymnasium {gym.__version__}, {len(chosen)} examples: {_counted(rows)}")
    if any(row["outcome"] == "failed" for row in rows) or not rows:
        raise SystemExit(1)


def _counted(rows: list[dict[str, Any]]) -> str:
    counts = Counter(row["outcome"] for row in rows)
    return ", ".join(f"{counts[outcome]} {outcome}" for outcome in ("passed", "failed", "skipped"))


def _prepare(tests: Path, folder: Path) -> None:
    """Copy the tests and put this package's environments into them."""
    shutil.copytree(tests, folder / "tests", ignore=shutil.ignore_patterns("__pycache__"))
    for name in stand_in.FILES_OF_THEIRS:
        path = folder / name
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    (folder / "tests/envs/utils.py").write_text(UTILS, "utf-8")
    (folder / "pytest.ini").write_text("[pytest]\n", "utf-8")
    for name, changes in RETOLD.items():
        text = (folder / name).read_text("utf-8")
        for old, new in changes:
            if old not in text:
                raise typer.BadParameter(f"{name} has no {old}: it is of another release than {gym.__version__}")
            text = text.replace(old, new)
        (folder / name).write_text(text, "utf-8")


def _run(folder: Path, example: str, which: str, match: str) -> list[dict[str, Any]]:
    """The outcomes of all tests, or of those that take an example, with this one."""
    told = folder / "told"
    told.unlink(missing_ok=True)
    env = {
        **os.environ,
        stand_in.STAND_IN: example,
        stand_in.TOLD: str(told),
        stand_in.WHICH: which,
        "PYTHONPATH": os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH", "")])),
        "SDL_VIDEODRIVER": "dummy",
        "SDL_AUDIODRIVER": "dummy",
    }
    words = ["-q", "-p", "no:cacheprovider", "-p", "no:randomly", "-p", "no:random_order", "--tb=short"]
    command = [sys.executable, "-m", "pytest", *words, "-p", "fieldgym.scripts.gymnasium_stand_in", *FILES]
    done = subprocess.run([*command, *(["-k", match] if match else [])], cwd=folder, env=env, check=False)
    if done.returncode not in (0, 1, 5):
        raise SystemExit(f"pytest ended with {done.returncode}")
    lines = told.read_text("utf-8").splitlines() if told.exists() else []
    return [{"example": example, **json.loads(line)} for line in lines]


if __name__ == "__main__":
    typer.run(main)
