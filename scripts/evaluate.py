"""``fieldgym evaluate``: what a policy scores, beside others on the same seeds and beside the bound."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fieldgym.scripts import common

if TYPE_CHECKING:
    from rich.console import Console

    from fieldgym.agents import Policy
    from fieldgym.agents.evaluation import Scores
    from fieldgym.agents.sources import PolicySource
    from fieldgym.benchmark.suites import Condition

COLUMNS = {"net_rate": "net rate", "cycle_time_s": "cycle s", "throughput_per_min": "per min", "damaged": "damaged"}


def main(
    env: Annotated[str, typer.Argument(metavar="ID", help="An environment; see fieldgym list.", show_default=False)],
    policy: Annotated[str, typer.Option(metavar="NAME|FILE", help="A name, or a policy's file.")],
    against: Annotated[
        str | None, typer.Option(metavar="A,B|all", help="Policies to compare with; by default the paper's order.")
    ] = None,
    episodes: Annotated[int | None, typer.Option(help="Seeds SEED to SEED + N - 1; by default 32.")] = None,
    seed: Annotated[int, typer.Option(help="First seed of the environment.")] = 0,
    scenario: common.Scenario = None,
    sets: common.Sets = None,
    fields: common.Fields = None,
    backend: Annotated[str, typer.Option(help="analytic computes the machine, pybullet moves it.")] = "analytic",
    perception: Annotated[str | None, typer.Option(help="By default what suits the backend.")] = None,
    trust: common.Trust = False,
    bound: Annotated[bool, typer.Option("--bound", help="How far is it from what no policy can beat?")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="As JSON, for programs.")] = False,
) -> None:
    """Evaluate a policy on paired seeds: mean, and difference to other policies with its 95 % bootstrap interval.

    A policy is a name, FILE.py:NAME, MODULE:NAME, a trained FILE.npz, or a saved FILE.zip (with --trust).

    Try:

      fieldgym evaluate SafflowerPicking --policy learned --scenario row --against all --episodes 200 --bound

      fieldgym evaluate LaserWeeding --policy ./mine.py:Mine --set process.power_w=150

      fieldgym evaluate SafflowerPicking --policy results/train/SafflowerPicking-v0-row-0/best.npz --backend pybullet
    """
    from rich.console import Console
    from rich.markup import escape

    from fieldgym.agents import policy_names, reference_policy
    from fieldgym.agents.evaluation import evaluate
    from fieldgym.bounds import bounded_ids
    from fieldgym.envs import task
    from fieldgym.kernels.seeds import POLICY_SEEDS

    env_id = common.environment_id(env)
    seeds: Sequence[int] = common.seeds_of(seed, episodes, fields, 32)
    condition = common.condition_of(env_id, scenario, backend, perception, sets or (), fields)
    if bound and task(env_id).bound is None:
        raise common.CommandError(f"--bound: {env_id} has no bound yet; these have: {', '.join(bounded_ids())}")
    names = [policy, *_others(policy, against or reference_policy(env_id), policy_names(env_id))]
    sources = [common.policy_of(env_id, name, trust) for name in names]
    files = common.fields_of(condition, seed)
    paths = [file.path for file in files] or None
    seeds = [seed] * len(files) if files else seeds
    console = Console(stderr=True, highlight=False)
    results: dict[str, Scores] = {}
    with console.status("") as status, common.told_in_one_line():
        for source in sources:
            status.update(escape(f"{source.name}: {len(seeds)} episodes"))

            def tell(finished: int, name: str = source.name) -> None:
                status.update(escape(f"{name}: {finished} of {len(seeds)} episodes"))

            def make(environment: Any, source: PolicySource = source) -> Policy:
                return source.make(environment, POLICY_SEEDS + seed)

            results[source.name] = evaluate(
                make, env_id, seeds, backend=backend, fields=paths, on_episode=tell, **condition.settings
            )
        gaps = None
        if bound:
            status.update("bounds")
            gaps = _bounds(condition, seeds, paths)
    report = _report(results, gaps)
    if as_json:
        told = {"env_id": env_id, "backend": backend, "first_seed": seed, "scenario": condition.scenario}
        told |= {"perception": condition.perception, "changes": condition.numbers}
        told |= {"fields": [file.name for file in files]} if files else {}
        typer.echo(json.dumps({**told, **report}, indent=2))
        return
    wide = Console(highlight=False)
    if not wide.is_terminal:
        # A log must not break the table's lines.
        wide = Console(highlight=False, width=132)
    which = f"{len(files)} files" if files else f"seeds {seed}+{len(seeds)}"
    _print(wide, f"{condition.title()}, {which}", report)


def _others(policy: str, against: str, known: tuple[str, ...]) -> list[str]:
    if against == "all":
        return [name for name in known if name not in (policy, "random")]
    names = [word.strip() for word in against.split(",") if word.strip()]
    return [name for name in dict.fromkeys(names) if name != policy]


def _bounds(condition: Condition, seeds: Sequence[int], fields: Sequence[str] | None) -> dict[str, Any]:
    import numpy as np

    from fieldgym.bounds import instance

    found = [
        instance(condition.env_id, each, backend=condition.backend, field=field, **condition.settings).bound()
        for each, field in zip(seeds, fields or [None] * len(seeds), strict=True)
    ]
    hopes = [bound.expected or bound for bound in found]
    reached = [bound.found for bound in found]
    return {
        "clairvoyant_return": np.array([bound.episode_return for bound in found]),
        "clairvoyant_net_rate": np.array([bound.net_rate for bound in found]),
        "return": np.array([hope.episode_return for hope in hopes]),
        "net_rate": np.array([hope.net_rate for hope in hopes]),
        "found_return": np.array([np.nan if each is None else each.episode_return for each in reached]),
        "found_net_rate": np.array([np.nan if each is None else each.net_rate for each in reached]),
        "cycle_time_s": np.array([bound.cycle_time_s for bound in found]),
        "method": found[0].method,
        "expected_method": "" if found[0].expected is None else found[0].expected.method,
        "estimated": found[0].expected is not None and found[0].expected.estimated,
    }


def _report(results: dict[str, Scores], gaps: dict[str, Any] | None) -> dict[str, Any]:
    """Means of every policy, paired differences of the first one to the others, gaps to the bound; JSON values."""
    from fieldgym.benchmark.statistics import mean, paired_difference

    first = next(iter(results.values()))
    policies = []
    for name, scores in results.items():
        row: dict[str, Any] = {"policy": name, "decision_ms": 1e3 * scores.decision_s}
        for key, values in {"return": scores.returns, **scores.scorecard}.items():
            estimate = mean(values)
            row[key] = {"mean": estimate.value, "low": estimate.low, "high": estimate.high}
        policies.append(row)
    differences = []
    for name, scores in list(results.items())[1:]:
        row = {"to": name}
        for key in ("return", "net_rate", "cycle_time_s"):
            mine = first.returns if key == "return" else first.scorecard[key]
            theirs = scores.returns if key == "return" else scores.scorecard[key]
            pair = paired_difference(mine, theirs)
            row[key] = {"mean": pair.value, "low": pair.low, "high": pair.high, "significant": pair.significant}
        differences.append(row)
    report: dict[str, Any] = {"policies": policies, "differences": differences}
    if gaps is not None:
        words = "method", "expected_method", "estimated"
        report["bound"] = {key: value if key in words else _known_mean(value) for key, value in gaps.items()}
        for row, scores in zip(policies, results.values(), strict=True):
            row["gap_return"] = float((gaps["return"] - scores.returns).mean())
            row["gap_net_rate"] = float((gaps["net_rate"] - scores.scorecard["net_rate"]).mean())
    return report


def _known_mean(values: Any) -> float | None:
    """Mean over the fields; None where one of them is not known."""
    value = float(values.mean())
    return value if value == value else None


def _print(console: Console, title: str, report: dict[str, Any]) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title), box=box.SIMPLE_HEAD, title_justify="left")
    table.add_column("policy", no_wrap=True)
    for heading in ("return", *COLUMNS.values(), "decision ms"):
        table.add_column(heading, justify="right")
    bound = report.get("bound")
    if bound:
        table.add_column("gap: return", justify="right")
        table.add_column("net rate", justify="right")
    for row in report["policies"]:
        cells = [f"{row[key]['mean']:.4g}" for key in ("return", *COLUMNS)]
        cells.append(f"{row['decision_ms']:.3f}")
        if bound:
            cells += [f"{row['gap_return']:.3f}", f"{row['gap_net_rate']:.4f}"]
        table.add_row(Text(row["policy"]), *cells)
    if bound:
        for name, kind in (("bound", ""), ("clairvoyant bound", "clairvoyant_"), ("clairvoyant, found", "found_")):
            # The cycle time is bounded with all luck known.
            keys = [
                key if key == "cycle_time_s" and kind == "clairvoyant_" else kind + key for key in ("return", *COLUMNS)
            ]
            shown = [bound.get(key) if key != "cycle_time_s" or kind else None for key in keys]
            if any(value is not None for value in shown):
                table.add_row(name, *("" if value is None else f"{value:.4g}" for value in shown), style="dim")
    console.print(table)
    if report["differences"]:
        first = report["policies"][0]["policy"]
        table = Table(
            title=Text(f"{first} minus ..., paired, 95 % interval"), box=box.SIMPLE_HEAD, title_justify="left"
        )
        table.add_column("", no_wrap=True)
        for heading in ("return", "net rate", "cycle s"):
            table.add_column(heading, justify="right")
        for row in report["differences"]:
            table.add_row(Text(row["to"]), *(_interval(row[key]) for key in ("return", "net_rate", "cycle_time_s")))
        console.print(table)
    if bound:
        hope = bound["expected_method"]
        told = f"Bound: what nobody gets more than on average; {hope}{', estimated' if bound['estimated'] else ''}."
        told = told if hope else "Bound: with all luck known, as there is no other here."
        told += f" Clairvoyant: {bound['method']}; its cycle time is the shortest at its net rate."
        console.print(told, style="dim")


def _interval(values: dict[str, Any]) -> str:
    star = "*" if values["significant"] else " "
    return f"{values['mean']:+.4f} [{values['low']:+.4f}, {values['high']:+.4f}]{star}"
