"""The package's renderer beside PyBullet's software renderer, on every camera and on what people are shown.

    python -m fieldgym.scripts.compare_renderers [--only GROUP] [--frames N] [--repeat N] [--out FILE.md]
    python -m fieldgym.scripts.compare_renderers --hashes

Both draw the same scenes in one process on one thread. The first table has the time of a picture (of the package's own
with painted ground, sensor noise, shadows and four samples a pixel where it has them; PyBullet's is drawn of what can
show alone), and how equal both are where they draw the same: one sample a pixel, no noise. Shares of identities and the
difference of depths leave out pixels on edges between two things. The second table has what the detectors make of both.

``--hashes`` prints a digest of every picture and nothing else: two runs under different ``NUMBA_CPU_NAME`` or
``NPY_DISABLE_CPU_FEATURES`` print the same.
"""

from __future__ import annotations

import argparse
import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from fieldgym.kernels.files import replace_file
from fieldgym.rendering.renderer import Renderer
from fieldgym.scripts.beside_tiny import both, by_tiny, likeness, times_s
from fieldgym.scripts.detections import DETECTORS
from fieldgym.scripts.takes import GROUPS, Take, takes


class Rows(NamedTuple):
    """A table: its title, its columns' heads and its rows of words."""

    title: str
    heads: tuple[str, ...]
    rows: list[tuple[str, ...]]


WIDTH = 132
PICTURES = "picture", "pixels", "ms", "target", "PyBullet ms", "times", "ids %", "depth um", "colours %", "digest"
FINDS = "detector", "drawn by", "pictures", "truth", "found", "false", "error mm"


def digest(take: Take) -> str:
    """Of a take's picture, its depths, and whom its pixels show."""
    taken = take.draw()
    own = Renderer(take.stage.library).look(take.view.things, *take.view.whence)
    parts = (taken,) if take.people else (taken.rgb, taken.depth_m)
    total = hashlib.sha256()
    for array in (*parts, own.frame.depth_m, own.identity):
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()[:16]


def picture_row(take: Take, repeat: int) -> tuple[str, ...]:
    """A take's row of the first table."""
    camera = take.view.camera
    own_s, tiny_s = times_s(take, repeat, max(1, repeat // 5))
    alike = likeness(*both(take))
    return (
        take.name,
        f"{camera.width} x {camera.height}",
        f"{1e3 * own_s:.2f}",
        f"{take.target_ms:g}",
        f"{1e3 * tiny_s:.1f}",
        f"{tiny_s / own_s:.0f}",
        f"{100.0 * alike.identities:.3f}",
        f"{1e6 * alike.depth_m:.2f}",
        f"{100.0 * alike.colours:.2f}",
        digest(take),
    )


def found_rows(name: str, pictures: int) -> Iterator[tuple[str, ...]]:
    """A detector's two rows of the second table, the package's pictures first."""
    for drawn_by in ("the package", "PyBullet"):
        if drawn_by == "PyBullet":
            with by_tiny():
                found = DETECTORS[name](pictures)
        else:
            found = DETECTORS[name](pictures)
        error = "" if np.isnan(found.error_mm) else f"{found.error_mm:.3f}"
        words = (str(number) for number in found[:4])
        yield name, drawn_by, *words, error


def as_markdown(tables: list[Rows]) -> str:
    """The tables one below the other."""
    parts = []
    for title, heads, rows in tables:
        lines = [heads, ("---",) * len(heads), *rows]
        parts.append(f"{title}\n\n" + "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n")
    return "\n".join(parts)


def as_table(rows: Rows) -> Table:
    """For a terminal."""
    table = Table(*rows.heads, title=rows.title, title_justify="left")
    for column in table.columns[1:]:
        column.justify = "right"
    for row in rows.rows:
        table.add_row(*row)
    return table


def parsed(words: list[str] | None) -> Any:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=GROUPS, help="the pictures of one scene, and no detectors")
    parser.add_argument("--frames", type=int, default=40, help="pictures a detector; 0 leaves them out (default 40)")
    parser.add_argument("--repeat", type=int, default=15, help="times a picture is drawn; the best counts (default 15)")
    parser.add_argument("--out", type=Path, metavar="FILE.md", help="write the tables as Markdown as well")
    parser.add_argument("--hashes", action="store_true", help="print a digest of every picture and nothing else")
    options = parser.parse_args(words)
    if options.frames < 0 or options.frames == 1:
        parser.error(f"--frames {options.frames}: give 0, or 2 or more")
    if options.repeat < 1:
        parser.error(f"--repeat {options.repeat}: give at least 1")
    return options


def main(words: list[str] | None = None) -> None:
    """Draw, compare, print, write."""
    options = parsed(words)
    if options.hashes:
        for take in takes(options.only):
            print(digest(take), take.name, flush=True)
        return
    console, tables = Console(width=WIDTH, highlight=False), []
    with console.status("drawing") as status:
        pictures = Rows("Pictures", PICTURES, [])
        for take in takes(options.only):
            status.update(f"drawing: {take.name}")
            pictures.rows.append(picture_row(take, options.repeat))
        tables.append(pictures)
        if options.frames and options.only is None:
            finds = Rows(f"Detectors, {options.frames} pictures each, at least", FINDS, [])
            for name in DETECTORS:
                status.update(f"detecting: {name}")
                finds.rows.extend(found_rows(name, options.frames))
            tables.append(finds)
    for table in tables:
        console.print(as_table(table))
    if options.out is not None:
        replace_file(options.out, as_markdown(tables))


if __name__ == "__main__":
    main()
