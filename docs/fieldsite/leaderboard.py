"""What ``docs/leaderboard.md`` says, read back: a table an environment, and what it was measured with."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from .markdown import table

KEPT = ("policy", "net rate, %", "cycle time, s", "return", "below bound, points")
"""Columns of the leaderboard that an environment's page repeats."""


class Board(NamedTuple):
    """One environment's table.

    Attributes:
        env_id: whose it is.
        condition: scenario, backend, perception and seeds, in words.
        heading: of the columns.
        rows: cells, the best policy first; the last row is the bound.
    """

    env_id: str
    condition: str
    heading: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def column(self, name: str, row: int) -> str:
        """The mean of a column in a row, without its interval."""
        return self.rows[row][self.heading.index(name)].split("<br>")[0]


class Leaderboard(NamedTuple):
    """The whole page.

    Attributes:
        boards: by environment.
        made: version, source, date and machine of the run, by name.
        caution: what readers of its figures have to know, empty where that is nothing.
    """

    boards: dict[str, Board]
    made: dict[str, str]
    caution: str

    @property
    def stamp(self) -> str:
        """Date and source of the run, in words."""
        said = self.made["Version"]
        version, sources = said.partition(", source ")[0], dict.fromkeys(re.findall(r", source (\w+)", said))
        word, hashes = "source hash" + "es" * (len(sources) > 1), " and ".join(f"`{source}`" for source in sources)
        return f"Run of {self.made['Run'].split()[0]}, {version}, {word} {hashes}"


def read(page: Path) -> Leaderboard:
    """Read the page that ``fieldgym report --leaderboard`` writes.

    Raises:
        ValueError: it has no table, or does not say what it was measured with.
    """
    text = page.read_text("utf-8")
    boards = {}
    for section in re.split(r"^## ", text, flags=re.M)[1:]:
        found = re.search(r"^`([\w/-]+)`, (.+)$", section, re.M)
        scores = re.search(r"(?:^\|.*\n)+", section, re.M)  # a table of rates follows it
        lines = scores[0].splitlines() if scores else []
        if found is None or len(lines) < 3:
            continue
        heading, _, *rows = (tuple(part.strip() for part in line.strip("|").split("|")) for line in lines)
        boards[found[1]] = Board(found[1], found[2].rstrip("."), heading, tuple(rows))
    made = dict(re.findall(r"^- (Version|Run|Machine|Seeds): (.+)$", text, re.M))
    if not boards or made.keys() != {"Version", "Run", "Machine", "Seeds"}:
        raise ValueError(f"{page}: not a leaderboard, let make leaderboard write it")
    caution = re.search(r"^(\*\*.+?)\n\n", text.partition("\n## ")[0] + "\n\n", re.M | re.S)
    return Leaderboard(boards, made, caution[1] if caution else "")


def slice_of(board: Board) -> str:
    """The table of one environment, with the columns that fit a page."""
    places = [board.heading.index(name) for name in KEPT]
    return table(KEPT, ([row[i] for i in places] for row in board.rows), right=(1, 2, 3, 4))


def glance(found: Leaderboard, links: dict[str, str]) -> str:
    """The best policy of every environment beside the bound.

    Args:
        found: the leaderboard.
        links: what each environment's row links to, by its id, in the order of the rows.
    """
    rows = []
    for env_id, link in links.items():
        if env_id not in found.boards:
            continue
        board = found.boards[env_id]
        shown = [board.column(name, 0) for name in KEPT[1:4]]
        bound = board.column("net rate, %", len(board.rows) - 1)
        rows.append((link, board.condition.split(" ")[0], board.column("policy", 0).strip("*"), *shown, bound))
    heading = ("environment", "scenario", "best policy", "net rate, %", "cycle time, s", "return", "bound, net rate, %")
    return table(heading, rows, right=(3, 4, 5, 6))
