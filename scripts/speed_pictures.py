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
EYES_MS = {"front": 15.0, "tool": 4.0}
"""What a weeder's front and tool camera may cost, all that is made of a picture."""


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
    """Decisions with the task's camera, and the detectors' part of them; weeders through both pairs of eyes."""
    for env_id in env_ids():
        if "camera" not in task(env_id).perceptions:
            continue
        name = env_id.removeprefix("fieldgym/").removesuffix("-v0")
        if "Weeding" not in env_id:
            yield from _looks(env_id, name, quick)
            continue
        yield from _looks(env_id, name, quick, eyes="classical", pictures="easy")
        for seen in ("easy", "field"):
            yield from _looks(env_id, f"{name}, learned eyes, {seen} pictures", quick, eyes="learned", pictures=seen)


def _looks(env_id: str, name: str, quick: bool, **kinds: Any) -> Iterator[Line]:
    """The reference's decisions on a field, and what its eyes and their detectors took of them."""
    steps = 15 if quick else 40
    env: Any = gym.make(env_id, backend="analytic", perception="camera", **kinds)
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
    yield Line(f"{name}, a decision by camera", 1e3 * spent / steps, "ms", note="analytic backend")
    for path, function, calls, seconds in _watched(watch):
        what, limit = f"{path.stem} found", DETECTOR_MS.get(path.stem)
        if path.stem == "eyes":
            what, limit = f"eyes of the {function} camera", EYES_MS[function]
        yield Line(f"{name}, {what}", 1e3 * seconds / calls, "ms", limit, True, f"a look, of {calls}")


def _watched(watch: cProfile.Profile) -> Iterator[tuple[Path, str, int, float]]:
    """File, function, calls and seconds of the detectors (room of perception) and of the eyes, by camera."""
    for (file, _, function), (calls, _, _, seconds, _) in pstats.Stats(watch).stats.items():  # type: ignore[attr-defined]
        path = Path(file)
        if (function == "detect" and path.parent.name == "perception") or (path.stem == "eyes" and function in EYES_MS):
            yield path, function, calls, seconds
