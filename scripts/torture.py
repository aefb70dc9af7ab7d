"""Try to break the package, at random but repeatably: actions, configurations, files, kills, resets.

    python scripts/torture.py [--only actions --only files] [--share 0.01] [--seed 0] [--first N] [--case N]

- ``actions``: a million actions, legal, illegal, out of range, of wrong type, before a reset, after an end, after
  ``close``; every id, single and batched, with and without PyBullet, every perception and autoreset mode.
- ``configs``: ten thousand overrides, configurations, scenarios (values and files), keywords and presets.
- ``files``: every kind of file that is read, spoilt in every way, read by the commands that read it.
- ``kills``: sixty ``kill -9`` of ``fieldgym benchmark`` and ``fieldgym train``, each resumed to its end.
- ``resets``: ten thousand of every id, and what memory they leave in use.

Whatever is no answer within its space and no error of one line is a fault: it is told with the case that repeats it,
and the exit code is 1. A whole run takes an hour or two; ``--share`` does a part of every section.
"""

from __future__ import annotations

import itertools
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

import fieldgym  # noqa: F401  # its environments are registered
from fieldgym.scripts import torture_actions, torture_configs, torture_files, torture_kills, torture_resets
from fieldgym.scripts.torture_parts import Case, Limits, Progress, Tally, watched
from fieldgym.scripts.torture_spoilt import FORMS

ACTIONS, CONFIGS, KILLS, RESETS = 1_000_000, 10_000, 60, 10_000
FILES = len(torture_files.KINDS) * len(FORMS)
"""Every kind in every form, once."""
FEWEST = 3
"""Cases of a section, however small the share."""
MOST_TOLD = 60


class Session:
    """What is asked for, and where files go.

    Attributes:
        share: of every section's full count.
        seed: of all cases.
        case: the only one, or None.
        folder: for files.
    """

    def __init__(self, share: float, seed: int, first: int, case: int | None, folder: Path):
        """Keep it."""
        self.share, self.seed, self.first, self.case, self.folder = share, seed, first, case, folder

    def part(self, whole: int) -> int:
        """How much of a section's count is done."""
        return max(round(self.share * whole), FEWEST)

    def numbers(self, count: int | None = None) -> Iterator[int]:
        """Numbers of the cases; without a count there is no end."""
        if self.case is not None:
            return iter((self.case,))
        return itertools.count(self.first) if count is None else iter(range(self.first, self.first + count))

    def watched(self, case: Case, section: str, count: int | None, limits: Limits | None = None) -> Iterator[Tally]:
        """What comes of a section's cases."""
        return watched(case, section, self.seed, self.numbers(count), limits or Limits())


def actions(session: Session) -> Tally:
    """Cases until there are as many actions as wanted."""
    cases = session.watched(torture_actions.case, "actions", None)
    return _added("actions", session.part(ACTIONS), "actions", cases)


def configs(session: Session) -> Tally:
    """A configuration a case."""
    count = session.part(CONFIGS)
    return _added("configs", count, "configs", session.watched(torture_configs.case, "configs", count))


def files(session: Session) -> Tally:
    """A file a case."""
    count, good = session.part(FILES), session.folder / "good"
    good.mkdir()
    made = list(
        watched(partial(torture_files.make, good=good), "files", session.seed, iter((0,)), Limits(600.0, 3600.0))
    )
    if made[0].faults:
        return made[0]
    case = partial(torture_files.case, good=good)
    return _added("files", count, "files", session.watched(case, "files", count))


def kills(session: Session) -> Tally:
    """A kill a case."""
    count, folder = session.part(KILLS), session.folder / "kills"
    folder.mkdir()
    found = torture_kills.kills(session.numbers(count), session.seed, folder)
    return _added("kills", count, "kills", found)


def resets(session: Session) -> Tally:
    """An id a case."""
    count = session.part(RESETS)
    ids = torture_actions.own_ids()
    case = partial(torture_resets.case, resets=count)
    return _added("resets", len(ids), "ids", session.watched(case, "resets", len(ids), Limits(7200.0, 36_000.0)))


SECTIONS: dict[str, Callable[[Session], Tally]] = {
    "actions": actions,
    "configs": configs,
    "files": files,
    "kills": kills,
    "resets": resets,
}


def _added(section: str, wanted: int, what: str, tallies: Iterable[Tally]) -> Tally:
    """All tallies in one; stops when there is as much as wanted."""
    whole, progress, done = Tally(), Progress(section, wanted, what), 0
    for tally in tallies:
        whole.add(tally)
        for told in tally.faults[:MOST_TOLD]:
            print(f"  FAULT {section} {told}", flush=True)
        done += tally.counts[what] or 1
        progress.tell(done, len(whole.faults))
        if done >= wanted:
            break
    return whole


def _table(found: dict[str, tuple[Tally, float]]) -> Table:
    table = Table("section", "figure", "value")
    for section, (tally, seconds) in found.items():
        counts = {name: f"{count:,}" for name, count in tally.counts.items()}
        figures = {name: f"{value:,.1f}" for name, value in tally.figures.items()}
        ends = {"faults": str(len(tally.faults)), "seconds": f"{seconds:.0f}"}
        for figure, value in (counts | figures | ends).items():
            table.add_row(section, figure, value)
        table.add_section()
    return table


def main(
    only: Annotated[list[str] | None, typer.Option(help=f"Only these sections: {', '.join(SECTIONS)}.")] = None,
    share: Annotated[float, typer.Option(min=0.0, max=100.0, help="Of every section's full count.")] = 1.0,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    first: Annotated[int, typer.Option(min=0, help="Case to begin with, to go on after a stop.")] = 0,
    case: Annotated[int | None, typer.Option(min=0, help="Only this case, to repeat a fault.")] = None,
) -> None:
    """Try to break the package, at random but repeatably."""
    unknown = set(only or ()) - set(SECTIONS)
    if unknown:
        told = f"{', '.join(sorted(unknown))}: choose among {', '.join(SECTIONS)}"
        raise typer.BadParameter(told, param_hint="--only")
    found: dict[str, tuple[Tally, float]] = {}
    with tempfile.TemporaryDirectory(prefix="fieldgym-torture-") as folder:
        for name in only or SECTIONS:
            began = time.monotonic()
            found[name] = SECTIONS[name](Session(share, seed, first, case, Path(folder))), time.monotonic() - began
    console = Console()
    (console if console.is_terminal else Console(width=100)).print(_table(found))
    faults = [f"{name} {told}" for name, (tally, _) in found.items() for told in tally.faults]
    for told in faults[:MOST_TOLD]:
        section, _, rest = told.partition(" case ")
        print(f"{told}   (repeat: --only {section} --seed {seed} --case {rest.partition(':')[0]})")
    if len(faults) > MOST_TOLD:
        print(f"and {len(faults) - MOST_TOLD} more")
    print(f"{len(faults)} faults")
    if faults:
        raise SystemExit(1)


if __name__ == "__main__":
    typer.run(main)
