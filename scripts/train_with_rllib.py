"""A short run of RLlib's PPO on one of the environments: where to begin on a cluster.

Ray pins an older Gymnasium than this package asks for, so it needs an environment of its own:

    python3.11 -m venv rllib && rllib/bin/pip install "ray[rllib]" torch numba pybullet opencv-python-headless scipy \
        typer rich && rllib/bin/pip install --no-deps -e .
    rllib/bin/python scripts/train_with_rllib.py [--id SafflowerPicking] [--iterations 3] [--workers 1]

RLlib's PPO knows no masks: an illegal action costs time, and the learner finds that out.
"""

from __future__ import annotations

import time
from typing import Annotated, Any

import gymnasium as gym
import typer

from fieldgym.scripts.common import CommandError, environment_id, execute

app = typer.Typer(add_completion=False)


@app.command()
def main(
    env: Annotated[str, typer.Option("--id", help="An environment; see fieldgym list.")] = "SafflowerPicking",
    iterations: int = 3,
    workers: Annotated[int, typer.Option(help="Processes that play.")] = 1,
) -> None:
    """Train with RLlib's PPO and print how it goes."""
    env_id = environment_id(env)
    try:
        from ray.rllib.algorithms.ppo import PPOConfig  # pyright: ignore[reportMissingImports]
        from ray.tune.registry import register_env  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise CommandError(f"{error.name} is missing: the head of this script says what it needs") from None

    def make(config: dict[str, Any]) -> gym.Env[Any, Any]:
        # Workers import this package anew; its import registers the ids.
        import fieldgym  # noqa: F401

        return gym.wrappers.FlattenObservation(gym.make(env_id, backend="analytic"))

    register_env(env_id, make)
    config = PPOConfig().environment(env_id).env_runners(num_env_runners=workers)
    config = config.training(lr=1e-3, gamma=1.0, train_batch_size_per_learner=4000, minibatch_size=1000, num_epochs=4)
    algorithm = config.build_algo()
    for iteration in range(iterations):
        began = time.perf_counter()
        played = algorithm.train()["env_runners"]
        print(
            f"iteration {iteration + 1}: {played['num_env_steps_sampled_lifetime']:.0f} decisions, mean return "
            f"{played.get('episode_return_mean', float('nan')):.3f}, {time.perf_counter() - began:.1f} s",
            flush=True,
        )
    algorithm.stop()


if __name__ == "__main__":
    execute(app, "python scripts/train_with_rllib.py")
