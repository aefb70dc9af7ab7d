"""Tables and numbers as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

_MOST_NUMBERS = 16
"""A field of more numbers than this is shown by its size."""


def table(heading: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int] = ()) -> str:
    """A table; columns ``right`` are aligned to the right. Without rows there is none."""
    lines = ["| " + " | ".join(cell(text) for text in row) + " |" for row in rows]
    if not lines:
        return ""
    rule = "|" + "|".join("--:" if i in right else "---" for i in range(len(heading))) + "|"
    return "\n".join(["| " + " | ".join(heading) + " |", rule, *lines]) + "\n"


def cell(text: str) -> str:
    """Text that stays within its cell."""
    return " ".join(text.split()).replace("|", "\\|")


def code(text: str) -> str:
    """Text as code."""
    return f"`{text}`"


def number(value: float) -> str:
    """A number as people write it: 0.05, 1e-05, 16; infinite ends as signs."""
    if value in (float("inf"), float("-inf")):
        return "∞" if value > 0 else "-∞"
    text = f"{value:.6g}"
    return text if float(text) == value else f"{value:.9g}"


def value(found: Any) -> str:
    """A configuration's value: a number, a word, or numbers in brackets; very many numbers by their count."""
    if found is ...:
        return "must be given"
    if isinstance(found, list):
        numbers = _flat(found)
        if len(numbers) > _MOST_NUMBERS:
            return f"{' x '.join(map(str, _shape(found)))} numbers"
        return "[" + ", ".join(value(part) for part in found) + "]"
    if found is None:
        return "none"
    if isinstance(found, bool):
        return "yes" if found else "no"
    return number(found) if isinstance(found, int | float) else str(found)


def between(low: float | None, high: float | None) -> str:
    """A range; ends that are open are left out."""
    if low is None and high is None:
        return ""
    return f"{'-∞' if low is None else number(low)} to {'∞' if high is None else number(high)}"


def _flat(found: Any) -> list[Any]:
    return [leaf for part in found for leaf in _flat(part)] if isinstance(found, list) else [found]


def _shape(found: Any) -> tuple[int, ...]:
    """Length at each depth, as far as the first entry goes."""
    return (len(found), *(_shape(found[0]) if found else ())) if isinstance(found, list) else ()
