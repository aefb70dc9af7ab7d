"""What the sections of ``torture.py`` share: cases with a generator each, in a process that is watched from outside.

A case that never ends, eats memory or takes its process down is a fault like any other: the process is killed, and the
next case goes on in a new one.
"""

from __future__ import annotations

import os
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import connection, get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

LONGEST_MESSAGE = 1000
"""Characters of an error that still is one line."""
PAGE_BYTES = os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096
TOLD_EVERY_S = 20.0
SLACK = 1e-6
"""Rounding where numbers of an episode are added up."""


@dataclass
class Tally:
    """What came of cases.

    Attributes:
        counts: by what is counted.
        faults: what must not happen, a line each.
        figures: largest values by name, for the table.
    """

    counts: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    figures: dict[str, float] = field(default_factory=dict)

    def add(self, other: Tally) -> None:
        """Take in what came of another."""
        self.counts.update(other.counts)
        self.faults += other.faults
        for name, value in other.figures.items():
            self.most(name, value)

    def most(self, name: str, value: float) -> None:
        """Keep the largest of a figure."""
        self.figures[name] = max(value, self.figures.get(name, value))

    def fault(self, what: str) -> None:
        """Take down what must not happen."""
        self.faults.append(" ".join(what.split())[:600])

    def hold(self, condition: Any, what: str) -> None:
        """Take down ``what`` unless a condition holds."""
        if not condition:
            self.fault(what)

    def refused(self, error: BaseException, allowed: tuple[type[BaseException], ...], what: str) -> bool:
        """Whether an error is a refusal in one line; it is a fault otherwise."""
        wrong = "" if isinstance(error, allowed) else "no refusal but"
        wrong = wrong or not_one_line(str(error))
        if wrong:
            self.fault(f"{what}: {wrong} {type(error).__name__}: {str(error)[:300]!r}{_where(error)}")
        return not wrong


def not_one_line(text: str) -> str:
    """What keeps a message from being one line for people, empty when nothing does."""
    if not text.strip():
        return "an empty message,"
    if not text.isprintable():
        return "more than one line,"
    return f"{len(text)} characters," if len(text) > LONGEST_MESSAGE else ""


def _where(error: BaseException) -> str:
    """File and line in which an error came up."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return "" if trace is None else f" at {Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}"


@contextmanager
def warned(tally: Tally, what: str) -> Iterator[None]:
    """Hold every warning of a block to one line as well."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        yield
    for warning in told:
        wrong = not_one_line(str(warning.message))
        if wrong:
            tally.fault(f"{what}: a warning has {wrong} {str(warning.message)[:200]!r}")


def check_observation(space: Any, observation: dict[str, NDArray[Any]], tally: Tally, what: str) -> None:
    """Take down whatever of an observation, with or without a leading world axis, lies outside its space."""
    tally.hold(set(observation) == set(space.spaces), f"{what}: observation has {sorted(observation)}")
    for name, values in observation.items():
        part = space.spaces.get(name)
        if part is None or values.shape[values.ndim - len(part.shape) :] != part.shape or values.dtype != part.dtype:
            tally.fault(f"{what}: observation[{name!r}] is {values.dtype} {values.shape}")
        elif not ((values >= part.low) & (values <= part.high)).all():  # NaN is neither
            odd = values[~((values >= part.low) & (values <= part.high))]
            tally.fault(f"{what}: observation[{name!r}] holds {odd.flat[0]!r}")


@dataclass(frozen=True)
class Limits:
    """What one case may take.

    Attributes:
        seconds: of the processor.
        clock_s: on the clock, where a case waits; the machine may have other things to do.
        megabytes: of memory beyond what the process had after its imports.
    """

    seconds: float = 60.0
    clock_s: float = 600.0
    megabytes: float = 2000.0


def resident_mb(process: int | None = None) -> float:
    """Memory that a process has in use, NaN where the system does not tell; None is this one."""
    try:
        pages = Path(f"/proc/{process or os.getpid()}/statm").read_text("utf-8").split()[1]
    except (OSError, IndexError):
        return float("nan")
    return int(pages) * PAGE_BYTES / 2**20


def busy_s(process: int) -> float:
    """Seconds of the processor that a process has had, NaN where the system does not tell."""
    try:
        told = Path(f"/proc/{process}/stat").read_text("utf-8").rpartition(")")[2].split()
    except OSError:
        return float("nan")
    return (int(told[11]) + int(told[12])) / os.sysconf("SC_CLK_TCK")


Case = Callable[[np.random.Generator, int, Tally], None]
"""Does case number n, with a generator of its own."""


def generator(seed: int, section: str, number: int) -> np.random.Generator:
    """The chance of a case; the same whatever ran before it."""
    return np.random.default_rng([seed, *section.encode(), number])


def watched(case: Case, section: str, seed: int, numbers: Iterator[int], limits: Limits) -> Iterator[Tally]:
    """What comes of case after case, in a process that is begun anew when one of them takes it down."""
    context = get_context("spawn")
    process: Any = None
    pipe: Any = None
    base_mb = 0.0
    try:
        for number in numbers:
            if process is None:
                pipe, there = context.Pipe()
                process = context.Process(target=_serve, args=(case, section, seed, there), daemon=False)
                process.start()
                there.close()
                base_mb = pipe.recv()  # imports are none of the case's time
            pipe.send(number)
            tally, fault = _outcome(process, pipe, base_mb, limits)
            again = f"case {number}"
            if tally is None:
                tally = Tally()
                tally.fault(f"{again}: {fault}")
                process.kill()
                process.join()
                process = None
            else:
                tally.faults = [f"{again}: {told}" for told in tally.faults]
            yield tally
    finally:
        if process is not None:
            process.kill()
            process.join()


def _outcome(process: Any, pipe: Any, base_mb: float, limits: Limits) -> tuple[Tally | None, str]:
    """What a case gave, or why there is nothing."""
    began, worked_s, most_mb = time.monotonic(), busy_s(process.pid), 0.0
    while not connection.wait([pipe, process.sentinel], 0.05):
        most_mb = max(most_mb, resident_mb(process.pid) - base_mb)
        if most_mb > limits.megabytes:
            return None, f"took more than {limits.megabytes:.0f} MB"
        if busy_s(process.pid) - worked_s > limits.seconds:
            return None, f"took more than {limits.seconds:.0f} s of the processor"
        if time.monotonic() - began > limits.clock_s:
            return None, f"took more than {limits.clock_s:.0f} s"
    try:
        tally: Tally = pipe.recv()
    except EOFError:
        process.join()
        return None, f"took its process down (exit code {process.exitcode})"
    tally.most("s of the processor in a case", busy_s(process.pid) - worked_s)
    tally.most("MB in a case", most_mb)
    return tally, ""


def _serve(case: Case, section: str, seed: int, pipe: Any) -> None:
    """In the process: do the cases whose numbers come."""
    import fieldgym  # noqa: F401  # its environments are registered

    with open(os.devnull, "w", encoding="utf-8") as null:
        os.dup2(null.fileno(), 1)  # what commands print
    pipe.send(resident_mb())
    while True:
        try:
            number = pipe.recv()
        except EOFError:  # who asks is gone
            return
        tally = Tally()
        try:
            case(generator(seed, section, number), number, tally)
        except Exception as error:
            tally.fault(f"unforeseen {type(error).__name__}: {str(error)[:300]!r}{_where(error)}")
        try:
            pipe.send(tally)
        except BrokenPipeError:
            return


class Progress:
    """A line now and then: how much of a section is done."""

    def __init__(self, section: str, wanted: int, what: str):
        """Begin a section."""
        self._section, self._wanted, self._what = section, wanted, what
        self._began = self._last = time.monotonic()
        print(f"{section}: {wanted:,} {what}", flush=True)

    def tell(self, done: int, faults: int) -> None:
        """Say it, if that is due."""
        now = time.monotonic()
        if now - self._last > TOLD_EVERY_S:
            self._last = now
            spent = now - self._began
            left = spent * max(self._wanted - done, 0) / max(done, 1)
            print(
                f"  {done:,} of {self._wanted:,} {self._what}, {faults} faults, {spent:.0f} s, some {left:.0f} s left",
                flush=True,
            )
