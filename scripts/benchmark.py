"""``fieldgym benchmark``: compare policies on paired seeds and print the table."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fieldgym.scripts import common

if TYPE_CHECKING:
    from rich.console import Console

    from fieldgym.benchmark.runner import RunResult
    from fieldgym.benchmark.suites import Suite


MOST_VIOLATIONS = 5
"""Results that beat their bound, told one by one before the rest is only counted."""


def main(
    suite: Annotated[
        str,
        typer.Option(
            help="quick: a few seeds in PyBullet, minutes. full: the headline scenarios on both backends and through "
            "the rendered cameras, under an hour. tiers: every scenario, analytic, hours."
        ),
    ] = "quick",
    env: Annotated[str | None, typer.Option(metavar="ID", help="Only this environment; see fieldgym list.")] = None,
    policies: Annotated[
        str | None,
        typer.Option(
            metavar="A,B",
            help="Only these: names, FILE.py:NAME, MODULE:NAME, FILE.npz, FILE.zip; keep the reference to compare.",
        ),
    ] = None,
    episodes: Annotated[int | None, typer.Option(help="Number of seeds instead of the suite's.")] = None,
    scenario: common.Scenario = None,
    sets: common.Sets = None,
    fields: common.Fields = None,
    backend: Annotated[str | None, typer.Option(help="Only this backend: pybullet or analytic.")] = None,
    perception: Annotated[str | None, typer.Option(help="Only this perception: perfect, model or camera.")] = None,
    jobs: Annotated[int | None, typer.Option(help="Worker processes; by default one a core.")] = None,
    out: Annotated[Path, typer.Option(help="Results go to a folder of the suite's name in here.")] = Path("results"),
    resume: Annotated[bool, typer.Option("--resume", help="Keep what is finished and run what is missing.")] = False,
    charge_thinking: Annotated[
        bool,
        typer.Option(
            "--charge-thinking",
            help="Add each policy's measured thinking to its cycle times; nothing moves meanwhile.",
        ),
    ] = False,
    trust: common.Trust = False,
    engine: Annotated[str, typer.Option(help="local, or ray: spread the episodes over a Ray cluster.")] = "local",
) -> None:
    """Run policies on the same fields with the same luck and compare net rate and cycle time.

    Every finished episode is on the disk at once: stop with Ctrl-C and go on with --resume.

    Try:

      fieldgym benchmark

      fieldgym benchmark --suite full --jobs 2

      fieldgym benchmark --env LaserWeeding --policies fifo,./mine.py:Mine --episodes 20 --backend analytic

      fieldgym benchmark --env SafflowerPicking --policies fixed-order,nearest --backend analytic --episodes 200
    """
    from fieldgym.benchmark import cluster, progress, record, runner, store, suites, tables, thinking

    wanted = _suite(suite, env, policies, episodes, backend, perception, trust)
    if env is not None:
        wanted = _special(wanted, scenario, sets or (), fields, episodes)
    elif scenario or sets or fields:
        raise common.CommandError("--scenario, --set and --fields are of one environment: name it with --env")
    common.chosen(engine, runner.ENGINES, "engine")
    if jobs is not None:
        common.at_least_one(jobs, "--jobs")
    console = _console()
    folder = out / wanted.name
    try:
        workers = f"{jobs or runner.usable_cores()} at a time" if engine == "local" else "on the cluster"
        with progress.ProgressDisplay(console, f"Suite {wanted.name}, {workers}") as display:
            report = runner.run_suite(
                wanted, folder, jobs, resume, engine=engine, on_start=display.start, on_record=display.record
            )
        # An earlier run may have left more than this one asked for.
        cases = [*suites.suite(suite).cases, *wanted.cases]
        rows = tables.summarise(report.records, cases, report.bounds)
        written = tables.write(rows, folder)
        if charge_thinking:
            rows = tables.summarise(map(thinking.charged, report.records), cases, report.bounds)
            written += tables.write(rows, folder, "charged")
        for table in tables.terminal_tables(rows, console.width):
            console.print(table)
        for line in tables.verdicts(rows):
            console.print(line, highlight=False, markup=False)
        if rows:
            console.print(tables.LEGEND, style="dim", highlight=False)
            same = record.digest(report.records + report.bounds)
            console.print(f"Digest {same}: the same on every run of the same episodes, clocks left out.", style="dim")
    except (cluster.EngineError, store.ResultsError) as error:
        raise common.CommandError(str(error)) from None
    except OSError as error:
        raise common.CommandError(
            f"cannot write to {folder} ({error.strerror}): choose another folder with --out"
        ) from None
    except runner.InterruptedRunError as error:
        given = {"--env": env, "--policies": policies, "--episodes": episodes, "--backend": backend, "--jobs": jobs}
        given |= {"--scenario": scenario, "--fields": fields, "--perception": perception}
        words = ["fieldgym", "benchmark", "--suite", suite, "--out", str(out), "--resume"]
        words += [word for option, value in given.items() if value is not None for word in (option, str(value))]
        words += [word for each in sets or () for word in ("--set", each)] + ["--trust"] * trust
        words += ["--charge-thinking"] * charge_thinking + ["--engine", engine] * (engine != "local")
        again = shlex.join(words)
        typer.echo(f"fieldgym: {error} in {folder}. Go on with: {again}", err=True)
        raise typer.Exit(common.INTERRUPTED) from None
    _close(console, report, [folder / store.EPISODES, *written])


def _suite(
    name: str,
    env: str | None,
    policies: str | None,
    episodes: int | None,
    backend: str | None,
    perception: str | None,
    trust: bool,
) -> Suite:
    """The suite that the options describe, every word of them checked before anything runs."""
    from fieldgym.benchmark import suites
    from fieldgym.envs import task
    from fieldgym.envs.assembly import BACKENDS, PERCEPTIONS

    common.chosen(name, suites.SUITES, "suite")
    env_id = None if env is None else common.environment_id(env)
    wanted = suites.suite(name, None if env_id is None else [env_id])
    if episodes is not None:
        common.at_least_one(episodes, "--episodes")
    if backend is not None:
        common.chosen(backend, BACKENDS if env_id is None else task(env_id).backends, "backend")
    if perception is not None:
        common.chosen(perception, PERCEPTIONS if env_id is None else task(env_id).perceptions, "perception")
    names = None
    if policies is not None:
        names = list(dict.fromkeys(word.strip() for word in policies.split(",") if word.strip()))
        if not names:
            raise common.CommandError(
                "--policies names none: give names with commas between them, as in fixed-order,nearest"
            )
    with common.told_in_one_line():
        return wanted.narrowed(env_id, names, episodes, backend, perception).traced(trust)


def _special(
    wanted: Suite, scenario: str | None, sets: Sequence[str], fields: Path | None, episodes: int | None
) -> Suite:
    """A suite of one environment under another scenario, with other numbers, or on field files."""
    from fieldgym.envs import task

    spec = task(wanted.cases[0].condition.env_id)
    for each in (scenario,) if scenario else {case.condition.scenario for case in wanted.cases}:
        _, numbers = common.scenario_of(spec, each, sets)
        if scenario or numbers:
            wanted = wanted.under(scenario, numbers)
    if fields is not None:
        first = wanted.cases[0]
        common.seeds_of(0, episodes, fields, 1)
        wanted = wanted.on_fields(str(fields), ())
        wanted = wanted.on_fields(str(fields), common.fields_of(wanted.cases[0].condition, first.seeds[0]))
    return wanted


def _console() -> Console:
    """As wide as a page where the output is no terminal."""
    from rich.console import Console

    console = Console()
    return console if console.is_terminal else Console(width=100)


def _close(console: Console, report: RunResult, paths: list[Path]) -> None:
    """Say where things are; leave with exit code 1 when an episode failed or beat its bound."""
    console.print("Written: " + ", ".join(str(path) for path in paths), soft_wrap=True, highlight=False)
    if report.outdated:
        console.print(f"{report.outdated} earlier results were left out: a policy, scenario or field has changed.")
    if report.failures:
        reasons = "; ".join(dict.fromkeys(str(record["error"]) for record in report.failures))
        told = f"{len(report.failures)} episodes failed and are not in the table ({reasons})"
        common.tell(f"{told}; run them again with --resume")
    for line in report.violations[:MOST_VIOLATIONS]:
        common.tell(line)
    if report.violations:
        common.tell(f"{len(report.violations)} results beat their bound: the rules or the bound are wrong")
    if report.failures or report.violations:
        raise typer.Exit(1)
