"""Pictures: every camera, what people and policies are shown, and what the detectors take of a look."""

from __future__ import annotations

import cProfile
import pstats
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym

from fieldgym.agents import act_single, make_policy, reference_policy
from fieldgym.envs import env_ids, task
from fieldgym.envs.pixels import DEFAULT_ROWS
from fieldgym.scripts.beside_tiny import times_s
from fieldgym.scripts.speed_lines import Line, best_of
from fieldgym.scripts.takes import takes

WARM_UP = 5
"""Decisions before those that count: machine code loads with the first."""
DETECTOR_MS = {"weeds": 5.0, "produce": 4.5}
"""Half of what a look's detector took at first."""


def pictures(quick: bool) -> Iterator[Line]:
    """Frames of every camera and pictures for people, each beside PyBullet's software renderer on the same scene."""
    for take in takes():
        own_s, theirs_s = times_s(take, 7 if quick else 15, 1 if quick else 3)
        name = f"picture for people, {take.name}" if take.people else take.name
        yield Line(name, 1e3 * own_s, "ms", take.target_ms, True, f"PyBullet {1e3 * theirs_s:.0f} ms")


def sights(quick: bool) -> Iterator[Line]:
    """Pictures as observations."""
    for env_id in env_ids():
        env: Any = gym.make(env_id, backend="analytic", observation="pixels")
        env.reset(seed=3)
        view = env.unwrapped.view
        seconds = best_of(lambda v=view: v.sight(DEFAULT_ROWS), 4 if quick else 12)
        env.close()
        name = env_id.removeprefix("fieldgym/").removesuffix("-v0")
        yield Line(f"{name}, a picture to decide by", 1e3 * seconds, "ms", note=f"{DEFAULT_ROWS} rows")


def looks(quick: bool) -> Iterator[Line]:
    """Decisions with the task's camera, and the detectors' part of them."""
    steps = 15 if quick else 40
    for env_id in env_ids():
        if "camera" not in task(env_id).perceptions:
            continue
        easy: dict[str, Any] = {"eyes": "classical", "pictures": "easy"} if "Weeding" in env_id else {}
        env: Any = gym.make(env_id, backend="analytic", perception="camera", **easy)
        policy = make_policy(reference_policy(env_id), env)
        observation, _ = env.reset(seed=3)
        watch = cProfile.Profile(time.thread_time)
        spent = 0.0
        for step in range(steps + WARM_UP):
            action = act_single(policy, observation)
            start = time.thread_time()
            if step >= WARM_UP:
                watch.enable()
            observation, _, end, cut, _ = env.step(action)
            if end or cut:
                observation, _ = env.reset()
            watch.disable()
            spent += time.thread_time() - start if step >= WARM_UP else 0.0
        env.close()
        name = env_id.removeprefix("fieldgym/").removesuffix("-v0")
        yield Line(f"{name}, a decision by camera", 1e3 * spent / steps, "ms", note="analytic backend")
        for detector, calls, seconds in _detectors(watch):
            limit = DETECTOR_MS.get(detector)
            yield Line(f"{name}, {detector} found", 1e3 * seconds / calls, "ms", limit, True, f"a look, of {calls}")


def _detectors(watch: cProfile.Profile) -> Iterator[tuple[str, int, float]]:
    """Name, calls and seconds of every detector of the room of perception that was called."""
    for (path, _, function), (calls, _, _, seconds, _) in pstats.Stats(watch).stats.items():  # type: ignore[attr-defined]
        if function == "detect" and Path(path).parent.name == "perception":
            yield Path(path).stem, calls, seconds
