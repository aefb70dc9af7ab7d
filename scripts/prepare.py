"""Compile the rules and the pictures of every environment once, so that its first episode starts at once.

    python scripts/prepare.py

Machine code is kept in the user's cache folder (NUMBA_CACHE_DIR names another one) and renewed when they change;
without this command each environment compiles itself at its first reset.
"""

from __future__ import annotations

import time
from typing import Any

import typer
from rich.console import Console

from fieldgym.scripts.common import execute


def main() -> None:
    """Compile the rules and the pictures of every environment once, so that its first episode starts at once."""
    import gymnasium as gym

    from fieldgym.envs import env_ids

    console = Console(highlight=False)
    for env_id in env_ids():
        start = time.perf_counter()
        with console.status(f"compiling {env_id}"):
            env: Any = gym.make(env_id, backend="analytic")
            env.reset(seed=0)
            env.step(env.action_space.sample())
            env.close()
            parts, _ = env.unwrapped.equipped({})
            if "camera" in parts.perceptions:
                env = gym.make(env_id, backend="analytic", perception="camera", render_mode="rgb_array")
                env.reset(seed=0)
                env.render()
                env.close()
        console.print(f"{env_id} is ready ({time.perf_counter() - start:.1f} s)")


if __name__ == "__main__":
    app = typer.Typer(add_completion=False)
    app.command()(main)
    execute(app, "prepare.py")
