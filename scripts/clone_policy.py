"""Clone the policy of a dataset, and hold the clone against it on seeds that neither has seen.

    fieldgym collect LaserWeeding --policy expert --episodes 200
    python scripts/clone_policy.py LaserWeeding

The clone is the network that training uses, taught by cross-entropy alone; its file is one that every command takes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from fieldgym.kernels.seeds import CLONES, POLICY_SEEDS
from fieldgym.scripts.common import CommandError, at_least_one, environment_id, execute, told_in_one_line

app = typer.Typer(add_completion=False)


@app.command()
def main(
    env: Annotated[str, typer.Argument(metavar="ID", help="An environment; see fieldgym list.", show_default=False)],
    dataset: Annotated[
        str | None, typer.Option(metavar="NAME", help="Minari's name; by default fieldgym/ENVIRONMENT/expert-v0.")
    ] = None,
    episodes: Annotated[int, typer.Option(help="Seeds of the comparison.")] = 400,
    epochs: Annotated[int, typer.Option(help="Passes over the decisions.")] = 12,
    hidden: Annotated[int, typer.Option(help="Width of the network.")] = 64,
    relations: Annotated[int, typer.Option(help="Numbers that candidates hear of each other.")] = 0,
    seed: Annotated[int, typer.Option(help="Of the first weights and of the minibatches.")] = 0,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="By default results/clone/ENVIRONMENT.npz.")] = None,
) -> None:
    """Clone a dataset's policy, score both on fresh seeds, and write the clone."""
    try:
        import minari
        import torch

        from fieldgym.agents.learning.cloning import clone, lessons_of
    except ImportError as error:
        raise CommandError(f'{error.name} is missing: pip install "fieldgym[datasets,rl]"') from None
    from rich.console import Console

    from fieldgym.agents.learning import portable
    from fieldgym.agents.policies.layout import layout_of

    env_id = environment_id(env)
    short = env_id.rpartition("/")[2].rpartition("-v")[0]
    name = dataset or f"fieldgym/{short}/expert-v0"
    at_least_one(episodes, "--episodes")
    at_least_one(epochs, "--epochs")
    try:
        experience = minari.load_dataset(name)
    except FileNotFoundError:
        raise CommandError(f"no dataset is called {name}: fieldgym collect {short} --policy expert writes it") from None
    recovered: Any = experience.recover_environment()
    if recovered.spec.id != env_id.rpartition(":")[2]:
        raise CommandError(f"--dataset {name}: it is of {recovered.spec.id}, not of {env_id}")
    torch.set_num_threads(1)  # more change the last digits, and the network is small
    target = out or Path("results/clone") / f"{short}.npz"
    author = str(experience.storage.metadata["algorithm_name"])
    card = {"env_id": env_id, "scenario": recovered.unwrapped.scenario, "cloned_from": name, "policy": author}
    console = Console(stderr=True, highlight=False)
    with told_in_one_line():
        lessons = lessons_of(experience)
        with console.status("learning") as status:
            cloned = clone(
                lessons,
                layout_of(recovered),
                card,
                hidden=hidden,
                relations=relations,
                epochs=epochs,
                seed=seed,
                on_epoch=lambda n, loss: status.update(f"pass {n} of {epochs}, loss {loss:.4f}"),
            )
        target.parent.mkdir(parents=True, exist_ok=True)
        portable.save(target, cloned.policy)
    settings = recovered.spec.kwargs
    recovered.close()
    told = compared(env_id, author, cloned.policy, CLONES.take(episodes), settings)
    typer.echo(
        f"{short}: {cloned.decisions} decisions of {author}; the clone decides {100.0 * cloned.agreement:.1f} % of the "
        f"held-out ones alike\n  return {told['return']}\n  net rate {told['net rate']}\n  on {episodes} seeds from "
        f"{CLONES.first}; clone in {target}"
    )


def compared(env_id: str, author: str, clone: Any, seeds: range, settings: dict[str, Any]) -> dict[str, str]:
    """What a clone and its author reach on the same seeds, and the share, in words, by the name of the figure."""
    from fieldgym.agents import make_policy
    from fieldgym.agents.evaluation import evaluate
    from fieldgym.benchmark.statistics import paired_share

    own = evaluate(clone.fitted, env_id, seeds, **settings)
    other = evaluate(lambda env: make_policy(author, env, POLICY_SEEDS + seeds[0]), env_id, seeds, **settings)
    figures = {
        "return": (own.returns, other.returns, 1.0, ""),
        "net rate": (own.scorecard["net_rate"], other.scorecard["net_rate"], 100.0, " %"),
    }
    told = {}
    for name, (mine, its, scale, unit) in figures.items():
        share = paired_share(mine, its)
        told[name] = (
            f"{scale * mine.mean():.2f}{unit} of {scale * its.mean():.2f}{unit}: "
            f"{100.0 * share.value:.2f} % [{100.0 * share.low:.2f}, {100.0 * share.high:.2f}]"
        )
    return told


if __name__ == "__main__":
    execute(app, "python scripts/clone_policy.py")
