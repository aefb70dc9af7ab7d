"""``fieldgym report``: the benchmark as one HTML page and a Markdown leaderboard."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fieldgym.kernels.files import replace_file
from fieldgym.scripts.common import CommandError

if TYPE_CHECKING:
    from fieldgym.benchmark.report.reader import Study


def main(
    results: Annotated[
        list[Path],
        typer.Argument(
            metavar="RESULTS...",
            help="Folders that fieldgym benchmark wrote, as results/full; a task that several hold is the last one's.",
        ),
    ],
    out: Annotated[Path, typer.Option(help="The page.")] = Path("results/report.html"),
    leaderboard: Annotated[Path | None, typer.Option(help="Also write the leaderboard as Markdown.")] = None,
    replays: Annotated[
        bool, typer.Option("--replays", help="Also write a page a policy that plays a minute in 3-D (view extra).")
    ] = False,
) -> None:
    """Write the benchmark's tables and charts as one page that needs nothing else, on any screen, light or dark.

    Try:

      fieldgym report results/full

      fieldgym report results/full --out results/report.html --leaderboard docs/leaderboard.md

      fieldgym report results/quick --replays
    """
    from fieldgym.benchmark import store
    from fieldgym.benchmark.report import leaderboard as markdown
    from fieldgym.benchmark.report import page, reader

    words = ["fieldgym", "report", *map(str, results), "--out", str(out)]
    words += ["--replays"] if replays else []
    words += [] if leaderboard is None else ["--leaderboard", str(leaderboard)]
    # Under a locale that knows no such letters, those of a path come as halves that no file can hold.
    command = shlex.join(words).encode("utf-8", "surrogateescape").decode("utf-8", "replace")
    try:
        study = reader.load(*results)
    except store.ResultsError as error:
        raise CommandError(str(error)) from None
    texts = {out: page.render(study, command, _replays(study, out) if replays else {})}
    if leaderboard is not None:
        texts[leaderboard] = markdown.render(study, command)
    for path, text in texts.items():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(path, text)
        except OSError as error:
            raise CommandError(f"cannot write {path} ({error.strerror}): choose another place") from None
        typer.echo(f"Written: {path} ({len(text.encode()) / 1e6:.1f} MB)")


def _replays(study: Study, out: Path) -> dict[str, dict[str, str]]:
    """Write the replays and say where they are."""
    from fieldgym.scripts import replays
    from fieldgym.scripts.view import check_viser

    check_viser()
    try:
        return replays.write(study, out, typer.echo)
    except OSError as error:
        raise CommandError(f"cannot write replays beside {out} ({error.strerror}): choose another place") from None
