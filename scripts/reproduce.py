"""``fieldgym reproduce``: the published results of the papers beside the computed ones."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..benchmark.reproduction import report

if TYPE_CHECKING:
    from rich.console import Console


class Paper(str, Enum):
    """What can be reproduced."""

    laser = "laser"
    prrs = "prrs"
    safflower = "safflower"
    transplanting = "transplanting"
    all = "all"


def main(
    paper: Annotated[Paper, typer.Argument(help="Which paper's results to compute.")] = Paper.all,
    out: Annotated[Path, typer.Option(help="Directory for the index, the figures and findings.json.")] = Path(
        "results/reproduction"
    ),
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON instead of tables.")] = False,
    processes: Annotated[int, typer.Option(min=1, help="Papers computed at once.")] = 2,
) -> None:
    """Compute the published results again and set each beside the printed one, with a verdict and the reason."""
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TimeElapsedColumn

    keys = report.CHAPTERS if paper is Paper.all else (paper.value,)
    with Progress(
        SpinnerColumn(), *Progress.get_default_columns(), TimeElapsedColumn(), console=Console(stderr=True)
    ) as progress:
        task = progress.add_task("papers", total=len(keys))

        def on_done(result: report.ChapterResult) -> None:
            progress.console.log(f"{result.key}: {len(result.findings)} findings in {result.seconds:.1f} s")
            progress.advance(task)

        results = report.reproduce(keys, out, processes, on_done)
    if as_json:
        typer.echo(report.to_json(results), nl=False)
        return
    console = Console()
    for result in results:
        _print_table(console, result)
    console.print(f"\nIndex with all tables and figures: {out / 'index.html'} and {out / 'index.md'}")


def _print_table(console: Console, result: report.ChapterResult) -> None:
    from rich.table import Table
    from rich.text import Text

    from ..benchmark.reproduction import Verdict

    colours = {
        Verdict.REPRODUCED: "green",
        Verdict.REPRODUCED_WITH_CORRECTION: "cyan",
        Verdict.REFUTED: "red",
        Verdict.NOT_DETERMINABLE: "magenta",
    }
    table = Table(title=result.title, caption=result.paper, show_lines=True, expand=True)
    for heading, ratio in (("Result and reason", 5), ("Published", 2), ("Computed", 2), ("Verdict", 2)):
        table.add_column(heading, ratio=ratio)
    for finding in result.findings:
        item, published, computed, corrected, deviation, verdict, why = report.row(finding)
        values = (
            computed + (f"\ncorrected: {corrected}" if corrected else "") + (f"\n({deviation})" if deviation else "")
        )
        reason = Text.assemble((item, "bold"), (f"\n{why}" if why else "", "dim"))
        table.add_row(reason, Text(published), Text(values), Text(verdict, colours[finding.verdict]))
    console.print(table)


if __name__ == "__main__":
    typer.run(main)
