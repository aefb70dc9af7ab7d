"""``fieldgym collect``: experience of policies as Minari datasets, for learning without an environment."""

from __future__ import annotations

from typing import Annotated

import typer

from fieldgym.kernels.seeds import DATASETS
from fieldgym.scripts.common import (
    CommandError,
    Scenario,
    Sets,
    Trust,
    condition_of,
    environment_id,
    policy_of,
    seeds_of,
    told_in_one_line,
)


def main(
    env: Annotated[str, typer.Argument(metavar="ID", help="An environment; see fieldgym list.", show_default=False)],
    policy: Annotated[
        str, typer.Option(metavar="NAME|FILE", help="A policy, or of these: expert, medium, random.")
    ] = "expert,medium,random",
    episodes: Annotated[int | None, typer.Option(help="Seeds SEED to SEED + N - 1; by default 100.")] = None,
    seed: Annotated[
        int, typer.Option(help="First seed of the environment; see fieldgym.kernels.seeds.")
    ] = DATASETS.first,
    dataset: Annotated[
        str | None, typer.Option(metavar="NAME", help="Minari's name; by default fieldgym/ENVIRONMENT/POLICY-v0.")
    ] = None,
    scenario: Scenario = None,
    sets: Sets = None,
    backend: Annotated[str, typer.Option(help="analytic computes the machine, pybullet moves it.")] = "analytic",
    perception: Annotated[str | None, typer.Option(help="By default what suits the backend.")] = None,
    trust: Trust = False,
) -> None:
    """Write what policies did and got as Minari datasets; needs the datasets extra.

    The dataset has observations with masks, rewards by name, seeds and fields, and makes its environment again.
    MINARI_DATASETS_PATH names another folder than ~/.minari/datasets.

    Try:

      fieldgym collect SafflowerPicking --episodes 50

      fieldgym collect LaserWeeding --policy edf --episodes 200 --dataset laser/edf-v0
    """
    from rich.console import Console
    from rich.markup import escape

    from fieldgym.agents.datasets import LEVELS, collect, level_policy
    from fieldgym.kernels.seeds import POLICY_SEEDS

    env_id = environment_id(env)
    levels = policy.split(",")
    if dataset is not None and len(levels) > 1:
        raise CommandError(f"--dataset {dataset} for {len(levels)} policies: give one policy, or leave --dataset out")
    seeds = seeds_of(seed, episodes, None, 100)
    condition = condition_of(env_id, scenario, backend, perception, sets or (), None)
    console = Console(stderr=True, highlight=False)
    for level in levels:
        name = level_policy(env_id, level) if level in LEVELS else level
        source = policy_of(env_id, name, trust)
        short = env_id.rpartition("/")[2].rpartition("-v")[0]
        target = dataset or f"fieldgym/{short}/{level}-v0"
        with console.status(escape(f"{target}: 0 of {len(seeds)} episodes")) as status, told_in_one_line():
            try:
                written = collect(
                    lambda environment, source=source: source.make(environment, POLICY_SEEDS + seed),
                    env_id,
                    seeds,
                    target,
                    algorithm=source.name,
                    on_episode=lambda n, target=target, status=status: status.update(
                        escape(f"{target}: {n} of {len(seeds)} episodes")
                    ),
                    backend=backend,
                    **condition.settings,
                )
            except ImportError as error:
                if error.name != "minari":
                    raise
                raise CommandError(str(error)) from None
        typer.echo(
            f"{target}: {len(seeds)} episodes of {source.name}, {written.decisions} decisions, "
            f"mean return {written.returns.mean():.2f}, in {written.dataset.storage.data_path}"
        )
