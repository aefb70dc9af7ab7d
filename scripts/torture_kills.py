"""Runs that are killed at a random moment, for ``torture.py``: each goes on to the end that it would have had.

``kill -9`` reaches the command alone. Its workers have to notice, or they would hold the machine for ever.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Iterator
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fieldgym.scripts.torture_files import SCENARIO, SETTINGS, TRAINED, training
from fieldgym.scripts.torture_parts import Tally, generator

BENCHMARK = ("benchmark", "--suite", "full", "--env", TRAINED, "--backend", "analytic", "--perception", "model")
BENCHMARK += ("--policies", "fixed-order,nearest,random", "--episodes", "8")
SHARE_TRAINED = 3
"""One kill in so many is of a training run."""
SHARE_WORKING = 4
"""One benchmark in so many has workers, which begin with their imports; the others run in one process."""
PRELOADED = (
    "fieldgym.scripts.cli",
    "fieldgym.benchmark.runner",
    "fieldgym.bounds",
    "fieldgym.agents.learning.training",
)
"""What the commands import is there when they begin: their time is work, and so are the moments of the kills."""
MOST_ATTEMPTS = 4
TIMEOUT_S = 600.0
WORKERS_S = 30.0
"""Within which a killed run's workers are gone."""
CLOCKED = ("decision_ms", "decision_p95_ms", "wall_s")


class Run(NamedTuple):
    """A command that was never interrupted: what it left, and when it worked.

    Attributes:
        end: what a resumed one has to leave.
        first_s: seconds until its folder appeared.
        whole_s: seconds that it took.
    """

    end: Any
    first_s: float
    whole_s: float


def kills(numbers: Iterator[int], seed: int, folder: Path) -> Iterator[Tally]:
    """Kill and resume a run a number; the first result comes after the whole runs that they are compared with."""
    settings = folder / "train.yaml"
    # Long enough for a few dozen updates, most of the time of which is no import.
    settings.write_text(SETTINGS.replace("STEPS", "3200").replace("evaluate_every: 1", "evaluate_every: 8"), "utf-8")
    server = get_context("forkserver")
    server.set_forkserver_preload(list(PRELOADED))
    words = {"benchmark": BENCHMARK, "train": training(TRAINED, SCENARIO, settings)}
    whole: dict[tuple[str, ...], Run] = {}
    for number in numbers:
        kind = "train" if number % SHARE_TRAINED == SHARE_TRAINED - 1 else "benchmark"
        more = ("--jobs", "2" if number % SHARE_WORKING == 0 else "1") if kind == "benchmark" else ()
        asked = (*words[kind], *more)
        if asked not in whole:
            whole[asked] = _uninterrupted(asked, kind, folder / f"whole-{kind}-{number}")
        tally = Tally()
        tally.counts["kills"] += 1
        rng = generator(seed, "kills", number)
        _killed(rng, asked, kind, whole[asked], folder / f"{kind}-{number}", tally)
        ends = [run.end for known, run in whole.items() if known[0] == kind]
        tally.hold(all(end == ends[0] for end in ends), f"{kind}: uninterrupted runs differ")
        tally.faults = [f"case {number}: {told}" for told in tally.faults]
        yield tally


def _start(words: tuple[str, ...], out: Path, *more: str) -> Any:
    """A command in a process and a group of its own, as if typed."""
    process: Any = get_context("forkserver").Process(target=_command, args=((*words, "--out", str(out), *more), out))
    process.start()
    return process


def _command(words: tuple[str, ...], out: Path) -> None:
    """In the process: run the command, what it says into files."""
    os.setsid()
    for number, ending in ((1, ".log"), (2, ".err")):
        with out.with_suffix(ending).open("w", encoding="utf-8") as file:
            os.dup2(file.fileno(), number)
    sys.argv = ["fieldgym", *words]
    from fieldgym.scripts import cli

    cli.main()


def _finish(process: Any, out: Path) -> tuple[int, str]:
    """Exit code and errors."""
    process.join(TIMEOUT_S)
    if process.exitcode is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.join()
        return -1, f"did not end within {TIMEOUT_S:.0f} s"
    return process.exitcode, out.with_suffix(".err").read_text("utf-8", "replace")


def _uninterrupted(words: tuple[str, ...], kind: str, out: Path) -> Run:
    """Run a command twice, the first time for what it compiles, and see when it begins to write."""
    warm = out.with_name(f"{out.name}-warm")
    _finish(_start(words, warm), warm)
    began = time.monotonic()
    process, first_s = _start(words, out), 0.0
    while process.exitcode is None and not first_s:
        first_s = time.monotonic() - began if out.exists() else 0.0
        time.sleep(0.01)
    code, errors = _finish(process, out)
    if code:
        raise RuntimeError(f"fieldgym {' '.join(words)}: exit code {code}, {errors}")
    return Run(_end(kind, out), first_s, time.monotonic() - began)


def _killed(rng: np.random.Generator, words: tuple[str, ...], kind: str, whole: Run, out: Path, tally: Tally) -> None:
    """Kill a run once and let it go on to its end."""
    # Some while it begins, most while it works.
    begin_s = 0.0 if rng.random() < 0.1 else 0.9 * whole.first_s
    moment_s = float(rng.uniform(begin_s, whole.whole_s))
    process: Any = None
    for attempt in range(MOST_ATTEMPTS):
        out = out.with_name(f"{out.name}-{attempt}")
        process = _start(words, out)
        process.join(moment_s)
        if process.exitcode is None:
            break
        moment_s *= 0.7  # it had more of the machine than the one that was timed
    what = f"{kind}, killed after {moment_s:.2f} s of {whole.whole_s:.2f}"
    tally.counts[f"{kind} kills"] += process.exitcode is None
    tally.counts[f"{kind} ended before"] += process.exitcode is not None
    process.kill()
    process.join()
    if not _gone(process.pid):
        tally.fault(f"{what}: its workers live on")
        os.killpg(process.pid, signal.SIGKILL)
    kept = _kept(kind, out)
    tally.counts[f"{kind}s that had begun"] += kept > 0
    # A run that was killed before its first checkpoint has nothing to go on with, and says so.
    more = ("--resume",) if kind == "benchmark" or kept else ()
    code, errors = _finish(_start(words, out, *more), out)
    if code:
        tally.fault(f"{what}: then exit code {code}, {errors[-300:]!r}")
        return
    end = _end(kind, out)
    tally.counts["resumed to the same end"] += end == whole.end
    if end != whole.end:
        odd = [name for name in whole.end if end.get(name) != whole.end[name]]
        tally.fault(f"{what}: another end than uninterrupted: {odd}")
    left = sorted(str(path.relative_to(out)) for path in out.rglob(".*") if path.is_file())
    tally.hold(not left, f"{what}: {left} are left")
    tally.most(f"{kind} kept before the kill", kept)


def _gone(group: int) -> bool:
    """Whether nothing of a process group lives."""
    deadline = time.monotonic() + WORKERS_S
    while time.monotonic() < deadline:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


def _kept(kind: str, out: Path) -> int:
    """How much a killed run had kept: episodes, or checkpoints."""
    if kind == "train":
        return int((out / "state.pt").exists())
    paths = [out / "full" / name for name in ("episodes.jsonl", "bounds.jsonl")]
    return sum(path.read_bytes().count(b"\n") for path in paths if path.exists())


def _end(kind: str, out: Path) -> dict[str, Any]:
    """What a run leaves, without what clocks measured."""
    return _learned(out) if kind == "train" else _played(out / "full")


def _played(folder: Path) -> dict[str, Any]:
    from fieldgym.benchmark import store
    from fieldgym.benchmark.record import digest

    records = [record for name in (store.EPISODES, store.BOUNDS) for record in store.read(folder / name)]
    table = json.loads((folder / "summary.json").read_text("utf-8"))
    for row in table:
        row["scores"] = {name: value for name, value in row["scores"].items() if name not in CLOCKED}
    return {"digest": digest(records), "episodes": len(records), "table": table}


def _learned(folder: Path) -> dict[str, Any]:
    """Weights as bytes, the curve, and everything that the next update would depend on."""
    import torch

    found: dict[str, Any] = {}
    for name in ("best.npz", "last.npz"):
        with np.load(folder / name) as arrays:
            found |= {f"{name} {key}": arrays[key].tobytes() for key in arrays}
    points = json.loads((folder / "curve.json").read_text("utf-8"))
    found["curve"] = [{name: value for name, value in point.items() if name != "wall_s"} for point in points]
    state = torch.load(folder / "state.pt", weights_only=True)
    for part in ("policy", "core", "face", "env", "last_obs"):
        for name, values in state[part].items():
            found[f"{part} {name}"] = values.numpy().tobytes()
    text = json.loads(state["text"])
    found |= {name: text[name] for name in ("numpy", "generators", "num_timesteps", "n_updates")}
    return found
