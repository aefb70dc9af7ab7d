"""A picture and a replay of every environment: those that the repository holds, or made here."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import gymnasium as gym

from fieldgym.agents import act_single, make_policy
from fieldgym.envs.task import TaskSpec
from fieldgym.kernels.files import replaced

MOVING = (".webp", ".gif")
"""What moving pictures end in, the preferred one first."""
DECISIONS, SEED = 24, 1
"""After so many decisions of the reference policy a still picture is taken."""
REPLAY_S = 20.0
_SHARP = 85


def moving(media: Path, name: str) -> Path | None:
    """The moving picture of an environment, None where there is none."""
    return next((media / f"{name}{end}" for end in MOVING if (media / f"{name}{end}").exists()), None)


def still(spec: TaskSpec, target: Path) -> None:
    """Draw an environment in the middle of its work."""
    env: Any = gym.make(spec.id, backend="analytic", render_mode="rgb_array")
    policy = make_policy(spec.reference, env)
    observation, _ = env.reset(seed=SEED)
    for _ in range(DECISIONS):
        observation, _, terminated, truncated, _ = env.step(act_single(policy, observation))
        if terminated or truncated:
            break
    frame = env.render()
    env.close()
    done, data = cv2.imencode(".jpg", frame[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _SHARP])
    if not done:
        raise RuntimeError(f"{spec.id}: its picture cannot be written")
    target.parent.mkdir(parents=True, exist_ok=True)
    with replaced(target) as partial:
        Path(partial).write_bytes(data.tobytes())


def replay(spec: TaskSpec, target: Path) -> None:
    """Record the reference policy as a page of its own, by the command that does it, in a process of its own."""
    target.parent.mkdir(parents=True, exist_ok=True)
    words = ["view", spec.id, "--record", str(target), "--seconds", f"{REPLAY_S:g}"]
    subprocess.run([sys.executable, "-m", "fieldgym.scripts.cli", *words], check=True, stdout=subprocess.DEVNULL)
