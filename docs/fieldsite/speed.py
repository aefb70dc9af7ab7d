"""The figures that ``scripts/speed.py`` left, as tables."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fieldgym.scripts.speed_lines import Line, number

from .markdown import table


def text(results: Path) -> str:
    """A table for each section of the results, with what they were measured on.

    Args:
        results: JSON that ``python scripts/speed.py --json`` wrote.
    """
    if not results.exists():
        return "No figures are kept yet: the command prints them.\n"
    found = json.loads(results.read_text("utf-8"))
    said = [f"Measured on {found['machine']}, {found['date']}, fieldgym {found['version']}, by `{found['command']}`.\n"]
    heading = ("what", "figure", "target", "", "note")
    for section, lines in found["sections"].items():
        shown = table(heading, _rows(lines), right=(1, 2))
        said += [f"## {section.replace('-', ' ').capitalize()}\n", shown]
    return "\n".join(said)


def _rows(lines: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    rows = []
    for line in (Line(**entry) for entry in lines):
        target = "" if line.target is None else f"{'at most' if line.at_most else 'at least'} {number(line.target)}"
        figure = "" if line.figure is None else f"{number(line.figure)} {line.unit}"
        rows.append((line.what, figure, target, {True: "met", False: "**missed**", None: ""}[line.met], line.note))
    return rows
