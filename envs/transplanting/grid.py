"""Tray maps as plain text: a sign or a word a cell, a line a row, the supply's block before that of the trays to serve.

    source
    o o x .
    o . o o

    target
    . . o
    . o .

``.`` or ``empty``, ``o`` or ``healthy``, ``x`` or ``poor``; signs may stand without spaces. The first line of a block
is the row that comes first, tray goes on behind tray. Without the words ``source`` and ``target`` an empty line parts
the two blocks; with them empty lines only part trays. Target trays that are not drawn come empty. What follows a ``#``
is not read.
"""

from __future__ import annotations

from typing import NamedTuple

from ..field import FieldError
from .config import REPORTS

SIGNS = (".", "o", "x")
"""Of ``REPORTS``, in their order."""
HEADS = ("source", "target")
_CELLS = {word: state for words in (SIGNS, REPORTS) for state, word in enumerate(words)}
_ADVICE = ", ".join(f"{sign} or {word}" for sign, word in zip(SIGNS, REPORTS, strict=True))

Block = list[list[int]]


class TrayMap(NamedTuple):
    """What cells hold, by row: of the source and of the target trays; ``lines`` say where each row stands, by block."""

    source: Block
    target: Block
    lines: dict[str, list[int]]


def read_grid(text: str, where: str) -> TrayMap:
    """What the cells of the source and of the target trays hold.

    Args:
        text: the map.
        where: its name, for errors.

    Raises:
        FieldError: it is no such map; the message names the line.
    """
    blocks: dict[str, Block] = {}
    lines: dict[str, list[int]] = {name: [] for name in HEADS}
    head, headed, gap = "", False, True
    for number, line in enumerate(text.removeprefix("\ufeff").splitlines(), start=1):
        at, words = f"{where}:{number}", line.split("#")[0].lower().split()
        if not words:
            gap = gap or line.strip() == ""
            continue
        word = " ".join(words).rstrip(":")
        if word in HEADS:
            if word in blocks or (blocks and not headed):
                raise FieldError(f"{at}: the block {word!r} begins here again: give each block once, under its name")
            head, headed, gap = word, True, False
            blocks[head] = []
            continue
        if gap and not headed:
            if len(blocks) == len(HEADS):
                raise FieldError(f"{at}: a third block begins: name the blocks by lines 'source' and 'target'")
            head = HEADS[len(blocks)]
            blocks[head] = []
        gap = False
        blocks[head].append(_row(words, at))
        lines[head].append(number)
        if len(blocks[head][-1]) != len(blocks[head][0]):
            raise FieldError(
                f"{at}: {len(blocks[head][-1])} cells, the first row of the {head} trays has {len(blocks[head][0])}: "
                "give every row the same number"
            )
    if not blocks.get("source"):
        raise FieldError(f"{where}: no source trays: draw their cells, a line a row: {_ADVICE}")
    return TrayMap(blocks["source"], blocks.get("target", []), lines)


def _row(words: list[str], at: str) -> list[int]:
    cells = words if any(word in REPORTS for word in words) else list("".join(words))
    for place, cell in enumerate(cells, start=1):
        if cell not in _CELLS:
            shown = cell if len(cell) <= 20 and cell.isprintable() else "this"
            raise FieldError(f"{at}: cell {place}: {shown!r} is no cell: write {_ADVICE}")
    return [_CELLS[cell] for cell in cells]
