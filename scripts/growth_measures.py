"""How the cost of a step grows with what there is more of: one generator of (size, cost) a curve."""

from __future__ import annotations

import importlib.util
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, cast

import gymnasium as gym
import numpy as np

from fieldgym.scripts.speed_lines import best_of

Point = tuple[float, float]


class Growth(NamedTuple):
    """A curve to measure.

    Attributes:
        title: of its chart.
        size: what there is more of, the horizontal axis.
        cost: what it takes, with its unit, the vertical axis.
        curves: name and generator of points; a curve that cannot be measured here yields none.
    """

    title: str
    size: str
    cost: str
    curves: dict[str, Any]


def _step_ms(env_id: str, worlds: int, steps: int, **settings: Any) -> float:
    """CPU milliseconds a step of a batch, resets included: the best fifth of the steps, first legal actions."""
    env: Any = gym.make_vec(env_id, num_envs=worlds, vectorization_mode="vector_entry_point", **settings)
    env.reset(seed=0)
    spent = []
    for _ in range(steps):
        actions = np.argmax(env.action_masks(), axis=1)
        start = time.thread_time()
        env.step(actions)
        spent.append(time.thread_time() - start)
    env.close()
    fifth = max(1, steps // 5)
    return 1e3 * min(sum(spent[i : i + fifth]) for i in range(0, steps - fifth + 1, fifth)) / fifth


def config_of(env_id: str, scenario: str | None = None) -> Any:
    """The configuration of a task's scenario, the headline one by default."""
    env: Any = gym.make(env_id, backend="analytic", perception="model", scenario=scenario)
    config = env.unwrapped.core.config
    env.close()
    return config


def worlds_of(env_id: str, most: int) -> Iterator[Point]:
    """Worlds of a batch."""
    for worlds in 4 ** np.arange(9):
        if worlds <= most:
            yield float(worlds), _step_ms(env_id, int(worlds), 60 if worlds <= 4096 else 15)


def weeds() -> Iterator[Point]:
    """Weeds a metre of a treated band, the window full of them; the cart as fast as for few."""
    env_id = "fieldgym/LaserWeeding-v0"
    config = config_of(env_id)
    for density in (10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 640.0):
        most = int(2.0 * density * config.scenario.strip_m * config.scenario.band_m) + 40
        load = config.scenario.offered_load * density / config.scenario.density_per_m2
        scenario = replace(config.scenario, density_per_m2=density, offered_load=load, max_weeds=most)
        yield density * scenario.band_m, _step_ms(env_id, 64, 60, config=replace(config, scenario=scenario))


def slots(env_id: str) -> Iterator[Point]:
    """Candidates that a policy is shown."""
    config = config_of(env_id)
    for count in (4, 8, 16, 32, 64):
        yield float(count), _step_ms(env_id, 256, 60, config=replace(config, slots=count))


def planner(axis: str) -> Iterator[Point]:
    """Shots ahead or sequences kept of the laser's receding horizon: one decision, where most weeds can be shot."""
    from fieldgym.agents.policies.weeding_horizon import RecedingHorizon

    env_id = "fieldgym/LaserWeeding-v0"
    env: Any = gym.make(env_id, backend="analytic", config=replace(config_of(env_id, "dense"), slots=64))
    observation, _ = env.reset(seed=0)
    full = observation
    for _ in range(200):
        observation, *_ = env.step(int(np.flatnonzero(env.unwrapped.action_masks())[-1]))
        if observation["action_mask"].sum() > full["action_mask"].sum():
            full = observation
    batch = {name: values[None] for name, values in full.items()}
    config = env.unwrapped.core.config
    env.close()
    for size in (1, 2, 4, 8, 16, 32) if axis == "depth" else (1, 2, 4, 8, 16, 32, 64, 128, 256):
        policy = RecedingHorizon(config, **cast(Any, {"depth": 4, "width": 6, axis: size}))
        yield float(size), 1e3 * best_of(lambda p=policy: p.act(batch), 15)


def pixels() -> Iterator[Point]:
    """Pixels of a picture for people, of the picker's row."""
    env: Any = gym.make("fieldgym/SafflowerPicking-v0", scenario="row", backend="analytic", perception="model")
    env.reset(seed=0)
    view = env.unwrapped.view
    view.look() if hasattr(view, "look") else view.frame()
    for width in (80, 160, 320, 640, 1280, 1920):
        height = 3 * width // 4
        yield float(width * height), 1e3 * best_of(lambda w=width, h=height: view._scene.render(w, h), 5)
    env.close()


def jobs(engine: str) -> Iterator[Point]:
    """Worker processes of a benchmark, wall seconds of the same episodes; Ray's only where it is installed."""
    from fieldgym.benchmark import runner, suites

    if engine == "ray" and importlib.util.find_spec("ray") is None:
        return
    suite = suites.suite("full", ["fieldgym/SafflowerPicking-v0"]).narrowed(
        policies=("nearest", "route"), episodes=48, backend="analytic"
    )
    for count in (1, 2, 4, 8):
        if count > max(2, runner.usable_cores()):
            return
        with tempfile.TemporaryDirectory(prefix="fieldgym-growth-") as folder:
            start = time.perf_counter()
            runner.run_suite(suite, Path(folder) / "run", count, engine=engine)
            yield float(count), time.perf_counter() - start


def growths() -> dict[str, Growth]:
    """Every section of the page, by name."""
    picker, laser, sorter = (f"fieldgym/{name}-v0" for name in ("SafflowerPicking", "LaserWeeding", "ProduceSorting"))
    return {
        "worlds": Growth(
            "A step of a batch",
            "worlds",
            "ms a step",
            {
                "SafflowerPicking": lambda: worlds_of(picker, 65_536),
                "LaserWeeding": lambda: worlds_of(laser, 16_384),
                "ProduceSorting": lambda: worlds_of(sorter, 16_384),
            },
        ),
        "weeds": Growth("A step of 64 worlds of LaserWeeding", "weeds a metre", "ms a step", {"LaserWeeding": weeds}),
        "slots": Growth(
            "A step of 256 worlds",
            "slots",
            "ms a step",
            {
                "SafflowerPicking": lambda: slots(picker),
                "LaserWeeding": lambda: slots(laser),
            },
        ),
        "planner": Growth(
            "A decision of the laser's receding horizon",
            "shots ahead (6 kept), sequences kept (4 ahead)",
            "ms a decision",
            {"shots ahead": lambda: planner("depth"), "sequences kept": lambda: planner("width")},
        ),
        "pixels": Growth("A picture of the picker's row", "pixels", "ms a picture", {"SafflowerPicking": pixels}),
        "jobs": Growth(
            "96 analytic episodes of SafflowerPicking",
            "workers",
            "s in all",
            {"processes": lambda: jobs("local"), "Ray": lambda: jobs("ray")},
        ),
    }
