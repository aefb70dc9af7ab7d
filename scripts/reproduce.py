"""``fieldgym reproduce``: the published results of the papers beside the computed ones."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fieldgym.scripts.common import CommandError, at_least_one, chosen

if TYPE_CHECKING:
    from rich.console import Console

    from fieldgym.papers.report import ChapterResult


def main(
    paper: Annotated[str, typer.Argument(metavar="[laser|prrs|safflower|transplanting|all]")] = "all",
    out: Annotated[Path, typer.Option(help="Folder for the index, the figures and findings.json.")] = Path(
        "results/reproduction"
    ),
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON instead of tables.")] = False,
    jobs: Annotated[int, typer.Option(help="Papers computed at once.")] = 2,
) -> None:
    """Compute the papers' published results again and set each beside the printed one, with verdict and reason.

    Try:

      fieldgym reproduce

      fieldgym reproduce transplanting --out results/transplanting
    """
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TimeElapsedColumn

    from fieldgym.papers import report

    wanted = chosen(paper, (*report.CHAPTERS, "all"), "paper")
    keys = report.CHAPTERS if wanted == "all" else (wanted,)
    at_least_one(jobs, "--jobs")
    columns = (SpinnerColumn(), *Progress.get_default_columns(), TimeElapsedColumn())
    try:
        with Progress(*columns, console=Console(stderr=True)) as progress:
            task = progress.add_task("Papers", total=len(keys))

            def on_done(result: ChapterResult) -> None:
                progress.console.print(f"{result.key}: {len(result.findings)} findings in {result.seconds:.1f} s")
                progress.advance(task)

            results = report.reproduce(keys, out, jobs, on_done)
    except ModuleNotFoundError as error:
        if error.name != "matplotlib":
            raise
        raise CommandError('the figures need matplotlib: pip install "fieldgym[bench]"') from None
    except OSError as error:
        raise CommandError(f"cannot write to {out} ({error.strerror}): choose another folder with --out") from None
    if as_json:
        typer.echo(report.to_json(results), nl=False)
        return
    console = Console()
    for result in results:
        _print_table(console, result)
    console.print(f"\nAll tables and figures: {out / 'index.html'} and {out / 'index.md'}")


def _print_table(console: Console, result: ChapterResult) -> None:
    from rich.table import Table
    from rich.text import Text

    from fieldgym.papers import Verdict, report

    colours = {
        Verdict.REPRODUCED: "green",
        Verdict.REPRODUCED_WITH_CORRECTION: "cyan",
        Verdict.REFUTED: "red",
        Verdict.IDENTIFIED: "yellow",
        Verdict.NOT_DETERMINABLE: "magenta",
    }
    table = Table(title=result.title, caption=result.paper, show_lines=True, expand=True)
    for heading, ratio in (("Result and reason", 5), ("Published", 2), ("Computed", 2), ("Verdict", 2)):
        table.add_column(heading, ratio=ratio, min_width=14 if heading == "Verdict" else None)
    for finding in result.findings:
        item, published, computed, corrected, deviation, verdict, why = report.row(finding)
        values = (
            computed + (f"\ncorrected: {corrected}" if corrected else "") + (f"\n({deviation})" if deviation else "")
        )
        reason = Text.assemble((item, "bold"), (f"\n{why}" if why else "", "dim"))
        table.add_row(reason, Text(published), Text(values), Text(verdict, colours[finding.verdict]))
    console.print(table)
