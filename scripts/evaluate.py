"""``fieldgym evaluate``: what a policy scores, beside others on the same seeds and beside the bound."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fieldgym.scripts.common import CommandError, at_least_one, chosen, environment_id, execute

if TYPE_CHECKING:
    from rich.console import Console

    from fieldgym.agents import Policy
    from fieldgym.agents.evaluation import Scores

COLUMNS = {"net_rate": "net rate", "cycle_time_s": "cycle s", "throughput_per_min": "per min", "damaged": "damaged"}


def main(
    env: Annotated[str, typer.Argument(metavar="ID", help="An environment; see fieldgym list.", show_default=False)],
    policy: Annotated[
        str, typer.Option(metavar="FILE|NAME", help="A policy's .npz file, or a name; see fieldgym list.")
    ],
    against: Annotated[
        str | None, typer.Option(metavar="A,B|all", help="Policies to compare with; by default the paper's order.")
    ] = None,
    episodes: Annotated[int, typer.Option(help="Seeds SEED to SEED + N - 1.")] = 32,
    seed: Annotated[int, typer.Option(help="First seed of the environment.")] = 0,
    scenario: Annotated[str | None, typer.Option(help="By default the headline scenario.")] = None,
    backend: Annotated[str, typer.Option(help="analytic computes the machine, pybullet moves it.")] = "analytic",
    perception: Annotated[str | None, typer.Option(help="By default what suits the backend.")] = None,
    bound: Annotated[bool, typer.Option("--bound", help="How far is it from what no policy can beat?")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="As JSON, for programs.")] = False,
) -> None:
    """Evaluate a policy on paired seeds: mean, and difference to other policies with its 95 % bootstrap interval.

    Try:

      fieldgym evaluate SafflowerPicking --policy learned --scenario row --against all --episodes 200 --bound

      fieldgym evaluate SafflowerPicking --policy results/train/SafflowerPicking-v0-row-0/best.npz --backend pybullet
    """
    from rich.console import Console

    from fieldgym.agents import policy_names, reference_policy
    from fieldgym.agents.evaluation import evaluate
    from fieldgym.benchmark.suites import default_perception
    from fieldgym.bounds import bounded_ids
    from fieldgym.envs import task

    env_id = environment_id(env)
    spec = task(env_id)
    at_least_one(episodes, "--episodes")
    if seed < 0:
        raise CommandError(f"--seed {seed}: give 0 or more")
    options = {
        "scenario": chosen(scenario or spec.headline, spec.scenarios, f"scenario of {env_id}"),
        "perception": chosen(perception or default_perception(env_id, backend), spec.perceptions, "perception"),
    }
    chosen(backend, spec.backends, "backend")
    if bound and env_id not in bounded_ids():
        raise CommandError(f"--bound: {env_id} has no bound yet; these have: {', '.join(bounded_ids())}")
    names = [policy, *_others(env_id, policy, against or reference_policy(env_id), policy_names(env_id))]
    console = Console(stderr=True, highlight=False)
    results: dict[str, Scores] = {}
    with console.status("") as status:
        for name in names:
            status.update(f"{name}: {episodes} episodes")

            def tell(finished: int, name: str = name) -> None:
                status.update(f"{name}: {finished} of {episodes} episodes")

            def make(environment: Any, name: str = name) -> Policy:
                return _policy(name, environment, seed)

            seeds = range(seed, seed + episodes)
            results[name] = evaluate(make, env_id, seeds, backend=backend, on_episode=tell, **options)
        gaps = None
        if bound:
            status.update("bounds")
            gaps = _bounds(env_id, range(seed, seed + episodes), backend, options)
    report = _report(results, gaps)
    if as_json:
        typer.echo(
            json.dumps({"env_id": env_id, "backend": backend, "first_seed": seed, **options, **report}, indent=2)
        )
        return
    wide = Console(highlight=False)
    if not wide.is_terminal:
        # A log must not break the table's lines.
        wide = Console(highlight=False, width=132)
    _print(wide, f"{env_id}, {options['scenario']}, {backend}, seeds {seed}+{episodes}", report)


def _others(env_id: str, policy: str, against: str, known: tuple[str, ...]) -> list[str]:
    if against == "all":
        return [name for name in known if name not in (policy, "random")]
    names = [word.strip() for word in against.split(",") if word.strip()]
    for name in names:
        if not name.endswith(".npz"):
            chosen(name, known, f"policy for {env_id}")
    return [name for name in dict.fromkeys(names) if name != policy]


def _policy(name: str, env: Any, seed: int) -> Policy:
    """A policy from a file (``.npz``) or by name."""
    from fieldgym.agents import make_policy, policy_names
    from fieldgym.agents.learning.portable import load_for
    from fieldgym.agents.policies.weights import PolicyFileError
    from fieldgym.benchmark.episode import POLICY_SEEDS

    env_id = env.unwrapped.spec.id
    if name.endswith(".npz"):
        try:
            return load_for(Path(name), env, Path(name).stem)
        except PolicyFileError as error:
            raise CommandError(str(error)) from None
    return make_policy(chosen(name, policy_names(env_id), f"policy for {env_id}"), env, seed=POLICY_SEEDS + seed)


def _bounds(env_id: str, seeds: range, backend: str, options: dict[str, Any]) -> dict[str, Any]:
    import numpy as np

    from fieldgym.bounds import instance

    found = [instance(env_id, each, backend=backend, **options).bound() for each in seeds]
    return {
        "return": np.array([bound.episode_return for bound in found]),
        "net_rate": np.array([bound.net_rate for bound in found]),
        "cycle_time_s": np.array([bound.cycle_time_s for bound in found]),
        "method": found[0].method,
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
        report["bound"] = {"method": gaps["method"]} | {
            key: float(gaps[key].mean()) for key in ("return", "net_rate", "cycle_time_s")
        }
        for row, scores in zip(policies, results.values(), strict=True):
            row["gap_return"] = float((gaps["return"] - scores.returns).mean())
            row["gap_net_rate"] = float((gaps["net_rate"] - scores.scorecard["net_rate"]).mean())
    return report


def _print(console: Console, title: str, report: dict[str, Any]) -> None:
    from rich import box
    from rich.table import Table

    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
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
        table.add_row(row["policy"], *cells)
    if bound:
        cells = [f"{bound[key]:.4g}" if key in bound else "" for key in ("return", *COLUMNS)]
        table.add_row("bound", *cells, style="dim")
    console.print(table)
    if report["differences"]:
        first = report["policies"][0]["policy"]
        table = Table(title=f"{first} minus ..., paired, 95 % interval", box=box.SIMPLE_HEAD, title_justify="left")
        table.add_column("", no_wrap=True)
        for heading in ("return", "net rate", "cycle s"):
            table.add_column(heading, justify="right")
        for row in report["differences"]:
            table.add_row(row["to"], *(_interval(row[key]) for key in ("return", "net_rate", "cycle_time_s")))
        console.print(table)
    if bound:
        console.print(f"Bound: {bound['method']}; the cycle time is the shortest at the bound's net rate.", style="dim")


def _interval(values: dict[str, Any]) -> str:
    star = "*" if values["significant"] else " "
    return f"{values['mean']:+.4f} [{values['low']:+.4f}, {values['high']:+.4f}]{star}"


if __name__ == "__main__":
    app = typer.Typer(add_completion=False)
    app.command()(main)
    execute(app, "python scripts/evaluate.py")
