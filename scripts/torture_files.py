"""Hostile files, for ``torture.py``: whatever lies there is read, or refused in one line, in bounded time and memory.

Every kind of file that the package reads is spoilt in every way; readers are the commands that a user would give.
"""

from __future__ import annotations

import io
import os
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from fieldgym.scripts.torture_parts import Tally, not_one_line
from fieldgym.scripts.torture_spoilt import FORMS, Spoil

CODES = (0, 1, 2)
TRAINED = "SafflowerPicking"
SCENARIO = "pots"
SETTINGS = """scenarios:
  pots: {steps: STEPS, num_envs: 4, n_steps: 16, batch_size: 32, n_epochs: 1, hidden: 8, critic_hidden: 8, relations: 0,
    evaluate_every: 1, evaluation_episodes: 2, teacher: null}
"""
"""A task's own settings of a scenario come before a file's defaults."""
ITERATED = "ProduceSorting"
ROUNDS = """scenarios:
  load-1.25: {steps: STEPS, teacher: fifo, episodes: 8, depth: 2, width: 4, evaluation_episodes: 2}
"""
COCO = """{"images": [{"id": 1, "file_name": "a.jpg", "width": 1920, "height": 1088}],
"categories": [{"id": 1, "name": "Chenopodium album"}, {"id": 2, "name": "Zea mays"}],
"annotations": [{"id": 1, "image_id": 1, "category_id": 1, "bbox": [100, 200, 50, 60]},
{"id": 2, "image_id": 1, "category_id": 2, "bbox": [700, 300, 90, 80]}]}
"""
PLANTS = "Left,Top,Right,Bottom,LabelID,StemX,StemY\n100,200,150,260,25,120,230\n700,300,790,380,1,740,340\n"
RESULTS = ("--suite", "full", "--env", TRAINED, "--policies", "fixed-order,nearest", "--backend", "analytic")
RESULTS += ("--perception", "model", "--episodes", "2", "--jobs", "1")


def case(rng: np.random.Generator, number: int, tally: Tally, good: Path) -> None:
    """Spoil one file and let everything read it that reads such files.

    Args:
        rng: chooses what is spoilt.
        number: says which kind of file, and in which way.
        tally: takes what came of it.
        good: folder of files that are whole, see ``make``.
    """
    kinds = list(KINDS)
    kind, form = kinds[number % len(kinds)], list(FORMS)[number // len(kinds) % len(FORMS)]
    tally.counts["files"] += 1
    with tempfile.TemporaryDirectory(dir=good.parent) as folder:
        KINDS[kind](Reading(rng, form, FORMS[form], good, Path(folder), tally, f"{kind}, {form}"))


class Reading:
    """A folder with one spoilt file in it, and commands that read it."""

    def __init__(
        self, rng: np.random.Generator, form: str, spoil: Spoil, good: Path, folder: Path, tally: Tally, what: str
    ):
        """Begin with an empty folder."""
        self.rng, self._form, self._spoil, self.good = rng, form, spoil, good
        self.folder, self.tally, self.what = folder, tally, what
        if form == "odd name":
            self.folder = folder / "two\nlines \u2028 \x1b[31m"
            self.folder.mkdir()

    def spoilt(self, whole: str, name: str | None = None) -> Path:
        """The good file of this name, spoilt, under a name of its own."""
        path = self.folder / (name or whole)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._spoil(self.rng, (self.good / whole).read_bytes(), path)
        return path

    def one_of(self, *names: str) -> str:
        """One of them."""
        return names[int(self.rng.integers(len(names)))]

    def command(self, *words: str) -> bool:
        """Whether a command reads it; a fault when it neither does nor says in one line why not."""
        code, told = _said(words)
        what = f"{self.what}: fieldgym {' '.join(words[:2])}"
        if code not in CODES:
            self.tally.fault(f"{what}: exit code {code}, {told[-300:]!r}")
        for line in told.splitlines():
            wrong = not_one_line(line) or ("" if line.startswith("fieldgym: ") else "not a line of ours,")
            if wrong:
                self.tally.fault(f"{what}: {wrong} {line[:300]!r}")
                break
        self.tally.hold(code != 2 or told, f"{what}: exit code {code} without a word")
        self.tally.counts["read" if code == 0 else "refused"] += 1
        return code == 0

    def call(self, action: Callable[[], Any]) -> None:
        """The same of a call."""
        try:
            action()
        except Exception as error:
            self.tally.refused(error, (ValueError,), f"{self.what}: call")
            self.tally.counts["refused"] += 1
        else:
            self.tally.counts["read"] += 1


def _said(words: tuple[str, ...]) -> tuple[Any, str]:
    """Exit code and standard error of a command, which runs in this process."""
    from fieldgym.scripts import cli

    before = sys.argv, sys.stdout, sys.stderr
    said = io.StringIO()
    with open(os.devnull, "w", encoding="utf-8") as null, warnings.catch_warnings():
        warnings.simplefilter("default")
        sys.argv, sys.stdout, sys.stderr = ["fieldgym", *words], null, said
        try:
            cli.main()
        except SystemExit as left:
            return left.code, said.getvalue()
        except Exception as error:
            trace = error.__traceback__
            while trace is not None and trace.tb_next is not None:
                trace = trace.tb_next
            where = "" if trace is None else f"{trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}: "
            return "a traceback", f"fieldgym: {where}{type(error).__name__}: {error}"
        finally:
            sys.argv, sys.stdout, sys.stderr = before
    return "none", said.getvalue()


# Kinds of files


def _field(reading: Reading, ending: str) -> None:
    from fieldgym.scripts.torture_actions import own_ids

    ids = own_ids()
    place = int(reading.rng.integers(len(ids)))
    path = reading.spoilt(f"field{place}{ending}", f"fields/field{ending}")
    reading.command("field", "check", str(path), "--env", ids[place])
    env: Any = gym.make(ids[place], backend="analytic", disable_env_checker=True)
    reading.call(lambda: env.reset(seed=1, options={"field": path}))
    env.close()
    words = ("--policy", "random", "--against", "random", "--fields", str(path.parent))
    reading.command("evaluate", ids[place], *words)


def _plants(reading: Reading) -> None:
    form, name = (("cropandweed", "plants.csv"), ("coco", "coco.json"))[int(reading.rng.integers(2))]
    path, out = reading.spoilt(name), reading.folder / "out.csv"
    reading.command("field", "convert", str(path), "--from", form, "--scale", "0.0004", "--out", str(out))


def _scenario(reading: Reading) -> None:
    from fieldgym.scripts.torture_actions import own_ids

    ids = own_ids()
    place = int(reading.rng.integers(len(ids)))
    path = reading.spoilt(f"scenario{place}.yaml")
    words = ("--policy", "random", "--against", "random", "--episodes", "1", "--scenario", str(path))
    reading.command("evaluate", ids[place], *words)

    def play() -> None:
        env: Any = gym.make(ids[place], backend="analytic", scenario=path, disable_env_checker=True)
        env.reset(seed=1)
        env.close()

    reading.call(play)


def _settings(reading: Reading) -> None:
    path = reading.spoilt("run.yaml")
    from fieldgym.agents.learning.train_settings import tuned

    reading.call(lambda: tuned(f"fieldgym/{TRAINED}-v0", None, path))


def _policy(reading: Reading, ending: str) -> None:
    other = {".npz": ".json", ".json": ".npz"}[ending]
    path = reading.spoilt("policy" + ending)
    shutil.copy(reading.good / f"policy{other}", path.with_suffix(other))
    words = ("--policy", str(path.with_suffix(".npz")), "--against", "random", "--episodes", "1")
    reading.command("evaluate", TRAINED, *words)


def _model(reading: Reading) -> None:
    path = reading.spoilt("model.zip")
    words = ("--trust", "--policy", str(path), "--against", "random", "--episodes", "1")
    reading.command("evaluate", TRAINED, *words)


def training(task: str, scenario: str, settings: Path) -> tuple[str, ...]:
    """Words of a command that trains with settings of a file."""
    return ("train", task, "--scenario", scenario, "--config", str(settings), "--threads", "1")


def _checkpoint(reading: Reading, run: str, state: str, name: str) -> None:
    """Go on with a run whose folder holds a spoilt file."""
    out = reading.folder / run
    out.mkdir()
    shutil.copy(reading.good / run / state, out / state)
    _spoil_in(reading, run, name)
    task, scenario = (TRAINED, SCENARIO) if run == "run" else (ITERATED, "load-1.25")
    words = training(task, scenario, reading.good / f"{run}-more.yaml")
    reading.command(*words, "--out", str(out), "--resume")


def _spoil_in(reading: Reading, folder: str, name: str) -> None:
    """Spoil a file where it stands among others."""
    (reading.folder / folder / name).unlink(missing_ok=True)
    reading.spoilt("lock" if name == ".lock" else f"{folder}/{name}", f"{folder}/{name}")


def _results(reading: Reading, name: str) -> None:
    folder = reading.folder / "full"
    shutil.copytree(reading.good / "full", folder)
    _spoil_in(reading, "full", name)
    page, board = reading.folder / "page.html", reading.folder / "board.md"
    reading.command("report", str(folder), "--out", str(page), "--leaderboard", str(board))
    more = ("--resume",) if reading.rng.random() < 0.7 else ()
    reading.command("benchmark", *RESULTS, "--out", str(reading.folder), *more)


KINDS: dict[str, Callable[[Reading], None]] = {
    "field.csv": lambda reading: _field(reading, ".csv"),
    "field.geojson": lambda reading: _field(reading, ".geojson"),
    "plants": _plants,
    "scenario.yaml": _scenario,
    "train.yaml": _settings,
    "policy.npz": lambda reading: _policy(reading, ".npz"),
    "policy.json": lambda reading: _policy(reading, ".json"),
    "model.zip": _model,
    "state.pt": lambda reading: _checkpoint(reading, "run", "state.pt", "state.pt"),
    "state.json": lambda reading: _checkpoint(reading, "rounds", "state.json", "state.json"),
    "a run's lock": lambda reading: _checkpoint(reading, "run", "state.pt", ".lock"),
    "episodes.jsonl": lambda reading: _results(reading, "episodes.jsonl"),
    "bounds.jsonl": lambda reading: _results(reading, "bounds.jsonl"),
    "manifest.json": lambda reading: _results(reading, "manifest.json"),
    "results' lock": lambda reading: _results(reading, ".lock"),
}


def make(rng: np.random.Generator, number: int, tally: Tally, good: Path) -> None:
    """Files that are whole, a case of its own: it plays and trains."""
    import yaml

    from fieldgym.agents.learning.portable import shipped
    from fieldgym.agents.learning.sb3 import make_vec_env
    from fieldgym.envs import task
    from fieldgym.envs.field_files import write_field
    from fieldgym.kernels.config import to_mapping
    from fieldgym.scripts.torture_actions import own_ids

    for place, env_id in enumerate(own_ids()):
        parts = task(env_id).assembly
        env: Any = gym.make(env_id, backend="analytic", disable_env_checker=True).unwrapped
        env.reset(seed=place)
        for ending in (".csv", ".geojson"):
            write_field(env.field, good / f"field{place}{ending}")
        numbers = to_mapping(parts.configured().scenario)
        (good / f"scenario{place}.yaml").write_text(yaml.safe_dump(numbers, sort_keys=False), "utf-8")
    (good / "plants.csv").write_text(PLANTS, "utf-8")
    (good / "coco.json").write_text(COCO, "utf-8")
    for name, text, steps, more in (("run", SETTINGS, "64", "128"), ("rounds", ROUNDS, "1", "3000")):
        (good / f"{name}.yaml").write_text(text.replace("STEPS", steps), "utf-8")
        (good / f"{name}-more.yaml").write_text(text.replace("STEPS", more), "utf-8")
    policy = shipped(f"fieldgym/{TRAINED}-v0")
    if policy is None:
        raise FileNotFoundError("the package ships no policy")
    for ending in (".npz", ".json"):
        shutil.copy(policy.with_suffix(ending), good / f"policy{ending}")
    from sb3_contrib import MaskablePPO

    env = make_vec_env(f"fieldgym/{TRAINED}-v0", 2, 0)
    MaskablePPO("MultiInputPolicy", env, n_steps=4, batch_size=8, device="cpu").save(good / "model.zip")
    for words in (
        (*training(TRAINED, SCENARIO, good / "run.yaml"), "--out", str(good / "run")),
        (*training(ITERATED, "load-1.25", good / "rounds.yaml"), "--out", str(good / "rounds")),
        ("benchmark", *RESULTS, "--out", str(good)),
    ):
        code, told = _said(words)
        if code:
            raise RuntimeError(f"fieldgym {' '.join(words)}: {code}, {told}")
    (good / "lock").write_text('{"process": 1, "host": "far", "user": "eve", "since": "now"}\n', "utf-8")
