"""The ``fieldgym`` command: what the scripts beside this file do, under one name."""

from __future__ import annotations

import json
from typing import Annotated, NoReturn

import typer

import fieldgym
from fieldgym.scripts import (
    benchmark,
    collect,
    evaluate,
    field,
    prepare,
    report,
    reproduce,
    run,
    sensitivity,
    train,
    view,
)
from fieldgym.scripts.common import execute, usable_tasks

app = typer.Typer(
    help="Task-level control of agricultural parallel robots: which target next, and how.",
    epilog="Start with: fieldgym list; fieldgym run SafflowerPicking; fieldgym benchmark",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("run")(run.main)
app.command("view")(view.main)
app.command("benchmark")(benchmark.main)
app.command("report")(report.main)
app.command("reproduce")(reproduce.main)
app.command("sensitivity")(sensitivity.main)
app.command("train")(train.main)
app.command("evaluate")(evaluate.main)
app.command("collect")(collect.main)
app.command("prepare")(prepare.main)
app.add_typer(field.app, name="field")


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"fieldgym {fieldgym.__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and leave.", callback=_show_version, is_eager=True)
    ] = False,
) -> None:
    """Options before the command."""


@app.command("list")
def list_environments(
    as_json: Annotated[bool, typer.Option("--json", help="As JSON, for programs.")] = False,
) -> None:
    """List the environments: machine, decision, actions, scenarios and policies.

    Try:

      fieldgym list --json
    """
    from fieldgym.agents import policy_names, reference_policy

    entries = []
    for spec in usable_tasks():
        env_id = spec.id
        entries.append(
            {
                "id": env_id,
                "machine": spec.machine,
                "paper": spec.paper,
                "decision": spec.decision,
                "actions": spec.actions,
                "scenarios": list(spec.scenarios),
                "headline_scenario": spec.headline,
                "backends": list(spec.backends),
                "policies": list(policy_names(env_id)),
                "reference_policy": reference_policy(env_id),
                "best": [f"{name}: {spec.recommended(name)}" for name in spec.scenarios],
            }
        )
    if as_json:
        typer.echo(json.dumps(entries, indent=2, ensure_ascii=False))
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(highlight=False)
    for entry in entries:
        table = Table.grid(padding=(0, 2))
        for label, value in entry.items():
            if label == "id":
                continue
            text = ", ".join(value) if isinstance(value, list) else value
            table.add_row(label.replace("_", " "), Text(str(text)))
        console.print(str(entry["id"]), style="bold", markup=False)
        console.print(table)
        console.print()


def main() -> NoReturn:
    """Run the command line that this process was started with."""
    execute(app, "fieldgym")


if __name__ == "__main__":
    main()
