"""``fieldgym sensitivity``: which assumption moves the headline figures, and by how much."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from fieldgym.kernels.files import replace_file
from fieldgym.scripts import common

EPISODES = 200


def main(
    env: Annotated[str | None, typer.Argument(metavar="[ID]", help="Only this task; see fieldgym list.")] = None,
    episodes: Annotated[int, typer.Option(help="Fields of each mean.")] = EPISODES,
    page: Annotated[
        Path, typer.Option(help="The page, Markdown; its charts go into a folder of its name beside it.")
    ] = Path("results/assumptions.md"),
) -> None:
    """Set each assumption of a task to the ends of its range, one at a time, and draw what that does as a tornado.

    What is played is kept beside the page's charts: a run that was stopped goes on where it ended.

    Try:

      fieldgym sensitivity ProduceSorting --episodes 50

      fieldgym sensitivity --page docs/assumptions.md
    """
    from rich.console import Console
    from rich.progress import Progress

    from fieldgym.benchmark import assumption_page
    from fieldgym.benchmark.assumptions.declared import dossier, dossier_ids
    from fieldgym.benchmark.sensitivity import study
    from fieldgym.benchmark.tornado import tornado

    common.at_least_one(episodes, "--episodes")
    ids = dossier_ids()
    if env is not None:
        ids = (common.chosen(common.environment_id(env), ids, "task with a list of assumptions"),)
    charts = common.writable_folder(page.parent / page.stem, "--page")
    words = ["fieldgym", "sensitivity", *([] if env is None else [env]), "--page", str(page)]
    words += [] if episodes == EPISODES else ["--episodes", str(episodes)]
    parts = []
    with Progress(console=Console(stderr=True), transient=True) as bar:
        for dossiers in map(dossier, ids):
            line = bar.add_task(dossiers.env_id, total=1 + sum(len(item.ends) for item in dossiers.assumptions))

            def on_trial(what: str, line=line, name: str = dossiers.env_id) -> None:
                bar.update(line, advance=1, description=f"{name}, {what}"[:70])

            kept = charts / f".{assumption_page.chart_name(dossiers)}.jsonl"
            try:
                parts.append((dossiers, study(dossiers, episodes, kept, on_trial)))
            except OSError as error:
                raise common.CommandError(f"cannot use {kept} ({error.strerror}): delete it") from None
            bar.remove_task(line)
    try:
        for dossiers, found in parts:
            replace_file(charts / assumption_page.chart_name(dossiers), tornado(dossiers, found))
        replace_file(page, assumption_page.page(parts, page.stem, shlex.join(words)))
    except OSError as error:
        raise common.CommandError(f"cannot write {page} ({error.strerror}): choose another place") from None
    for dossiers, _ in parts:
        (charts / f".{assumption_page.chart_name(dossiers)}.jsonl").unlink(missing_ok=True)
    typer.echo(f"Written: {page} and {len(parts)} charts in {charts}")
