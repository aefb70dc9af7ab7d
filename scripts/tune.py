"""Search for training settings with Optuna; the study is kept in a file and goes on where it stopped.

    python scripts/tune.py SafflowerPicking --scenario row --trials 40

A trial is a short training run; what it scores is the best mean return on the held-out seeds that training chooses its
weights on, so neither the benchmark's seeds nor those of the trained policies' cards are touched. Runs that lag behind
the median of the earlier ones are ended early. What ships in ``agents/learning/settings/`` is set
by hand from such studies.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from fieldgym.scripts.common import CommandError, at_least_one, chosen, environment_id, execute, writable_folder

app = typer.Typer(add_completion=False)


@app.command()
def main(
    env: Annotated[str, typer.Argument(metavar="ID", help="An environment; see fieldgym list.", show_default=False)],
    scenario: Annotated[str | None, typer.Option(help="By default the environment's headline scenario.")] = None,
    trials: Annotated[int, typer.Option(help="Trials to run now; the study grows with each call.")] = 20,
    steps: Annotated[int, typer.Option(help="Decisions of a trial.")] = 500_000,
    threads: Annotated[int | None, typer.Option(help="PyTorch threads; by default one a core.")] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where the study and its runs go.")] = Path("results/tune"),
) -> None:
    """Search for training settings; Ctrl-C keeps what was found."""
    try:
        optuna: Any = import_module("optuna")
    except ImportError:
        raise CommandError("tuning needs Optuna: pip install optuna") from None
    import yaml
    from rich.console import Console

    from fieldgym.agents.learning.train_settings import tuned
    from fieldgym.agents.learning.training import train
    from fieldgym.envs import task

    env_id = environment_id(env)
    spec = task(env_id)
    scenario = chosen(scenario or spec.headline, spec.scenarios, f"scenario of {env_id}")
    at_least_one(trials, "--trials")
    at_least_one(steps, "--steps")
    name = f"{env_id.split('/')[-1]}-{scenario}"
    folder = writable_folder(out / name, "--out")
    console = Console(highlight=False)

    def objective(trial: Any) -> float:
        settings = tuned(env_id, scenario, algo="maskable-ppo", steps=steps, **suggested(trial))

        def report(progress: Any) -> None:
            if progress.held_out:
                trial.report(progress.held_out["return"], progress.steps)
                if trial.should_prune():
                    raise optuna.TrialPruned

        result = train(env_id, settings, folder / f"{trial.number:04d}", threads=threads, on_update=report)
        return max(point["return"] for point in result.curve)

    def tell(study: Any, trial: Any) -> None:
        value = "ended early" if trial.value is None else f"{trial.value:.4f}"
        console.print(f"trial {trial.number}: {value}; best so far {study.best_value:.4f}")

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(
        study_name=name,
        storage=f"sqlite:///{folder / 'study.db'}",
        load_if_exists=True,
        direction="maximize",
        sampler=optuna.samplers.TPESampler(seed=0),
        pruner=optuna.pruners.MedianPruner(n_startup_trials=5),
    )
    study.optimize(objective, n_trials=trials, callbacks=[tell])
    console.print(f"Best of {len(study.trials)} trials: return {study.best_value:.4f} with")
    console.print(yaml.safe_dump({"scenarios": {scenario: study.best_params}}, sort_keys=True))


def suggested(trial: Any) -> dict[str, Any]:
    """What a trial varies."""
    return {
        "learning_rate": trial.suggest_float("learning_rate", 1e-4, 3e-3, log=True),
        "n_steps": trial.suggest_categorical("n_steps", [32, 64, 128]),
        "batch_size": trial.suggest_categorical("batch_size", [1024, 2048, 4096]),
        "n_epochs": trial.suggest_int("n_epochs", 2, 8),
        "gamma": trial.suggest_categorical("gamma", [0.98, 0.99, 0.995, 1.0]),
        "gae_lambda": trial.suggest_float("gae_lambda", 0.9, 1.0),
        "ent_coef": trial.suggest_float("ent_coef", 1e-4, 2e-2, log=True),
        "hidden": trial.suggest_categorical("hidden", [32, 48, 64]),
    }


if __name__ == "__main__":
    execute(app, "python scripts/tune.py")
