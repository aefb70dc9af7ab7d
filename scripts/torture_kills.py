"""Runs that are killed at a random moment, for ``torture.py``: each goes on to the end that it would have had.

``kill -9`` reaches the command alone. Its workers have to notice, or they would hold the machine for ever.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fieldgym.scripts.torture_files import SCENARIO, SETTINGS, TRAINED, training
from fieldgym.scripts.torture_parts import Tally, generator

BENCHMARK = ("benchmark", "--suite", "full", "--env", TRAINED, "--backend", "analytic", "--perception", "model")
BENCHMARK += ("--episodes", "6", "--jobs", "2")
SHARE_TRAINED = 3
"""One kill in so many is of a training run."""
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
    settings.write_text(SETTINGS.replace("STEPS", "6400").replace("evaluate_every: 1", "evaluate_every: 8"), "utf-8")
    words = {"benchmark": BENCHMARK, "train": training(TRAINED, SCENARIO, settings)}
    whole: dict[str, Run] = {}
    for number in numbers:
        kind = "train" if number % SHARE_TRAINED == SHARE_TRAINED - 1 else "benchmark"
        if kind not in whole:
            whole[kind] = _uninterrupted(words[kind], kind, folder / f"whole-{kind}")
        tally = Tally()
        tally.counts["kills"] += 1
        rng = generator(seed, "kills", number)
        _killed(rng, words[kind], kind, whole[kind], folder / f"{kind}-{number}", tally)
        tally.faults = [f"case {number}: {told}" for told in tally.faults]
        yield tally


def _start(words: tuple[str, ...], out: Path, *more: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "fieldgym.scripts.cli", *words, "--out", str(out), *more]
    log = out.with_suffix(".log").open("a", encoding="utf-8")
    with log:
        return subprocess.Popen(command, stdout=log, stderr=subprocess.PIPE, text=True, start_new_session=True)


def _finish(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code and errors."""
    try:
        _, errors = process.communicate(timeout=TIMEOUT_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return -1, f"did not end within {TIMEOUT_S:.0f} s"
    return process.returncode, errors


def _uninterrupted(words: tuple[str, ...], kind: str, out: Path) -> Run:
    began = time.monotonic()
    process, first_s = _start(words, out), 0.0
    while process.poll() is None and not first_s:
        first_s = time.monotonic() - began if out.exists() else 0.0
        time.sleep(0.01)
    code, errors = _finish(process)
    if code:
        raise RuntimeError(f"fieldgym {' '.join(words)}: exit code {code}, {errors}")
    return Run(_end(kind, out), first_s, time.monotonic() - began)


def _killed(rng: np.random.Generator, words: tuple[str, ...], kind: str, whole: Run, out: Path, tally: Tally) -> None:
    """Kill a run once and let it go on to its end."""
    # Some while it loads, most while it works.
    begin_s = 0.0 if rng.random() < 0.1 else 0.9 * whole.first_s
    moment_s = float(rng.uniform(begin_s, whole.whole_s))
    process = _start(words, out)
    group = process.pid
    try:
        process.wait(moment_s)
    except subprocess.TimeoutExpired:
        pass
    what = f"{kind}, killed after {moment_s:.2f} s of {whole.whole_s:.2f}"
    tally.counts[f"{kind} kills"] += process.poll() is None
    tally.counts[f"{kind} ended before"] += process.poll() is not None
    process.kill()
    process.communicate()
    if not _gone(group):
        tally.fault(f"{what}: its workers live on")
        os.killpg(group, signal.SIGKILL)
    kept = _kept(kind, out)
    tally.counts[f"{kind}s that had begun"] += kept > 0
    # A run that was killed before its first checkpoint has nothing to go on with, and says so.
    more = ("--resume",) if kind == "benchmark" or kept else ()
    code, errors = _finish(_start(words, out, *more))
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
