"""One display of how far a benchmark is: a live bar on a terminal, plain lines anywhere else."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from .record import Record, field_of

if TYPE_CHECKING:
    from rich.console import Console

PLAIN_LINES = 20
"""Lines for a whole run where nothing can be redrawn, as in a log file."""


class ProgressDisplay:
    """Shows episodes as they finish; a context manager whose ``start`` and ``record`` fit ``run_suite``."""

    def __init__(self, console: Console, title: str):
        """Show ``title`` on ``console``."""
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
        from rich.progress import TimeRemainingColumn as Remaining

        self._console = console
        self._bar = Progress(
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            Remaining(),
            TextColumn("[dim]{task.fields[latest]}"),
            console=console,
            disable=not console.is_terminal,
            transient=True,
        )
        self._task = self._bar.add_task("", total=None, latest="")
        self._title = title
        self._done = self._total = self._skipped = 0
        self._started = time.monotonic()

    def __enter__(self) -> ProgressDisplay:
        """Begin to draw."""
        self._bar.start()
        return self

    def __exit__(self, *exception: object) -> None:
        """Stop drawing and leave the terminal as it was."""
        self._bar.stop()

    def start(self, skipped: int, total: int) -> None:
        """``total`` episodes are wanted, ``skipped`` of them are there already."""
        self._done = self._skipped = skipped
        self._total = total
        self._bar.update(self._task, total=total, completed=skipped)
        resumed = f", {skipped} of them finished earlier" if skipped else ""
        self._console.print(f"{self._title}: {total} episodes{resumed}", highlight=False)

    def record(self, record: Record) -> None:
        """One more episode is on the disk."""
        from rich.markup import escape

        self._done += 1
        latest = f"{record['policy']} {field_of(record)}"
        name = f"{record['env_id'].rpartition(':')[2].removeprefix('fieldgym/')} {record['scenario']} {latest}"
        self._bar.update(self._task, completed=self._done, latest=escape(latest))
        if "error" in record:
            self._console.print(f"failed: {name}: {record['error']}", style="red", highlight=False, markup=False)
        elif not self._console.is_terminal:
            every = max((self._total - self._skipped) // PLAIN_LINES, 1)
            if (self._done - self._skipped) % every == 0 or self._done == self._total:
                elapsed = time.monotonic() - self._started
                self._console.print(
                    f"  {self._done}/{self._total}  {elapsed:5.0f} s  {name}", highlight=False, markup=False
                )
