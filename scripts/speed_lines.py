"""What the measuring scripts share: lines of figure and target, and the clock."""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from collections.abc import Callable
from typing import NamedTuple

from rich.table import Table


class Line(NamedTuple):
    """A measured figure.

    Attributes:
        what: was measured.
        figure: the measurement; None where there is only something to say.
        unit: its unit.
        target: what it should be, None where nothing is asked.
        at_most: the target is a ceiling, not a floor.
        note: what else there is to say.
    """

    what: str
    figure: float | None
    unit: str
    target: float | None = None
    at_most: bool = False
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the figure is what it should be; None where nothing is asked."""
        if self.target is None or self.figure is None:
            return None
        return self.figure <= self.target if self.at_most else self.figure >= self.target


def best_of(action: Callable[[], object], repetitions: int = 7) -> float:
    """Shortest CPU time of an action in this thread, seconds: another process on the core only costs repetitions."""
    action()
    times = []
    for _ in range(repetitions):
        start = time.thread_time()
        action()
        times.append(time.thread_time() - start)
    return min(times)


def cpu_s(code: str, **environment: str) -> float:
    """CPU seconds of a Python process of its own that runs ``code`` under ``environment`` added to this one's.

    Raises:
        RuntimeError: it failed; the message is its last line.
    """
    import os

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, **environment}, check=False
    )
    if done.returncode:
        raise RuntimeError((done.stderr.strip() or "no output").splitlines()[-1])
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def number(value: float) -> str:
    """Three significant digits, with separators."""
    if value >= 100.0:
        return f"{value:,.0f}"
    return f"{value:.3g}"


def as_table(title: str, lines: list[Line]) -> Table:
    """The lines beside their targets, in 100 columns."""
    table = Table("what", "figure", "target", "", "note", title=title, title_justify="left")
    table.columns[1].justify = table.columns[2].justify = "right"
    table.columns[0].max_width, table.columns[4].max_width = 42, 24
    for line in lines:
        sign = "<=" if line.at_most else ">="
        target = "" if line.target is None else f"{sign} {number(line.target)}"
        verdict = {True: "met", False: "[bold]missed[/bold]", None: ""}[line.met]
        figure = "" if line.figure is None else f"{number(line.figure)} {line.unit}"
        table.add_row(line.what, figure, target, verdict, line.note)
    return table
