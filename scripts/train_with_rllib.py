"""A short run of RLlib's PPO on one of the environments: where to begin on a cluster.

Ray pins an older Gymnasium than this package asks for, so it needs an environment of its own:

    python3.11 -m venv rllib && rllib/bin/pip install "ray[rllib]" torch numba pybullet opencv-python-headless scipy \
        typer rich && rllib/bin/pip install --no-deps -e .
    rllib/bin/python scripts/train_with_rllib.py [--id SafflowerPicking] [--iterations 3] [--workers 1]

RLlib's PPO knows no masks: an illegal action costs time, and the learner finds that out.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import gymnasium as gym

import fieldgym


def main() -> None:
    """Train and print."""
    names = {env_id.split("/")[1].split("-v")[0]: env_id for env_id in fieldgym.env_ids()}
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--id", default="SafflowerPicking", choices=tuple(names))
    parser.add_argument("--iterations", type=int, default=3)
    parser.add_argument("--workers", type=int, default=1, help="processes that play (default 1)")
    options = parser.parse_args()
    try:
        from ray.rllib.algorithms.ppo import PPOConfig  # pyright: ignore[reportMissingImports]
        from ray.tune.registry import register_env  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        parser.error(f"{error.name} is missing: see the head of this script for the environment that it needs")

    def make(config: dict[str, Any]) -> gym.Env[Any, Any]:
        # Workers import this package anew; its import registers the ids.
        import fieldgym  # noqa: F401

        return gym.wrappers.FlattenObservation(gym.make(names[options.id], backend="analytic"))

    register_env(options.id, make)
    config = PPOConfig().environment(options.id).env_runners(num_env_runners=options.workers)
    config = config.training(lr=1e-3, gamma=1.0, train_batch_size_per_learner=4000, minibatch_size=1000, num_epochs=4)
    algorithm = config.build_algo()
    for iteration in range(options.iterations):
        began = time.perf_counter()
        played = algorithm.train()["env_runners"]
        print(
            f"iteration {iteration + 1}: {played['num_env_steps_sampled_lifetime']:.0f} decisions, mean return "
            f"{played.get('episode_return_mean', float('nan')):.3f}, {time.perf_counter() - began:.1f} s",
            flush=True,
        )
    algorithm.stop()


if __name__ == "__main__":
    main()
