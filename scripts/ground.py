"""What ground that shakes does to weeding and picking, and what the camera beside the tool is worth on it.

    python scripts/ground.py worth [--fields 100] [--scenario load-1.0] [--policy edf]
    python scripts/ground.py stops [--fields 200]
    python scripts/ground.py profile [--fields 100] [--pivot 0.28]
    python scripts/ground.py line
    python scripts/ground.py room
    python scripts/ground.py cameras [--fields 24] [--strip 2]
    python scripts/ground.py backends [--fields 20] [--strip 2]

``worth`` prints the laser's net rate with its tool camera on and off, and the hoe's, by class of ground, with paired
95 % intervals. ``stops`` prints how the picker's frame stands at its stops, by how much its shears then miss, and what
that costs. ``profile`` prints what the drawn ground does to frame, cameras and tool, ``line`` what its density would do
to a frame on one line of wheels, without drawing any; ``room`` how far up and down the weeders' tools reach from the
ground that they are mounted for. ``cameras`` plays the same fields with rendered and with statistical cameras, by drift
of the odometry and by class; ``backends`` the same fields by analytic executor and in PyBullet. Where ``--strip`` is
given, fields are that long.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray
from rich.console import Console
from rich.table import Table

import fieldgym  # noqa: F401
from fieldgym.agents import act_single, make_policy, reference_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.benchmark.statistics import Estimate, mean, paired_difference
from fieldgym.envs.rough import WAVES_PER_M, density_m3
from fieldgym.envs.safflower.batch import stop_centres
from fieldgym.envs.safflower.standing import stand_error
from fieldgym.envs.shaking import frames_at, lands, sinks_m
from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.ground import draw_profiles, shape_of, surface_of
from fieldgym.envs.weeding.ground_config import GroundConfig
from fieldgym.envs.weeding.straying import Carrying, strayed
from fieldgym.envs.weeding.tools.hoe.config import HoeWeedingConfig
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.kernels.config import ConfigError, override
from fieldgym.kernels.seeds import DRIVES

CLASSES = ("none", "A", "B", "C", "D", "soil")
EASY: dict[str, Any] = {"eyes": "classical", "pictures": "easy"}
"""What the weeders' figures here were played with."""
LASER, HOE, PICKER = "fieldgym/LaserWeeding-v0", "fieldgym/HoeWeeding-v0", "fieldgym/SafflowerPicking-v0"
BASE_M = 1.1
"""A shorter wheel base, that of the published figures' arithmetic."""
CAMERA_M = 0.85
"""Height of a weeder's front camera."""
SPEED_M_S, EXPOSURE_S = 0.1, 0.002
"""Of a cart that weeds, and of its cameras."""
DEGREES = 180.0 / np.pi
_AT_M = np.arange(0.5, 7.5, 0.1)


def overrides(strip_m: float | None = None, **ground: Any) -> dict[str, Any]:
    """Settings of a ground, and of the strip's length where one is given."""
    rest = {} if strip_m is None else {"scenario.strip_m": strip_m}
    return {f"scenario.ground.{name}": value for name, value in ground.items()} | rest


def batch_scores(env_id: str, fields: int, scenario: str, policy: str, settings: dict[str, Any]) -> dict[str, Any]:
    """Scores (fields,) of a policy on the analytic backend with statistical cameras."""
    env = gym.make_vec(
        env_id,
        fields,
        vectorization_mode="vector_entry_point",
        scenario=scenario,
        overrides=settings,
        **EASY,
        autoreset_mode=gym.vector.AutoresetMode.DISABLED,
    )
    chooser = make_policy(policy, env, 0)  # type: ignore[arg-type]
    observation, _ = env.reset(seed=list(range(fields)))  # type: ignore[arg-type]
    chooser.reset(np.ones(fields, bool))
    over, scores = np.zeros(fields, bool), {}
    while not over.all():
        observation, _, terminated, truncated, info = env.step(np.asarray(chooser.act(observation)))
        ending = (terminated | truncated) & ~over
        for name in ("net_rate", "cycle_time_s"):
            scores.setdefault(name, np.full(fields, np.nan))[ending] = info["scorecard"][name][ending]
        over |= ending
    env.close()
    return scores


def scores_one_by_one(fields: int, scenario: str, policy: str, **kwargs: Any) -> dict[str, Any]:
    """Scores (fields,) of a policy of the laser weeder, one field after the other."""
    env = gym.make(LASER, scenario=scenario, disable_env_checker=True, **EASY, **kwargs)
    cards = []
    for seed in range(fields):
        observation, info = env.reset(seed=seed)
        chooser = make_policy(policy, env, 0)
        chooser.reset(np.ones(1, bool))
        over = False
        while not over:
            observation, _, terminated, truncated, info = env.step(act_single(chooser, observation))
            over = terminated or truncated
        cards.append(info["scorecard"])
    env.close()
    return {name: np.array([card[name] for card in cards]) for name in ("net_rate", "cycle_time_s")}


def shown(estimate: Estimate, factor: float = 100.0, digits: int = 1) -> str:
    """A value with its interval."""
    value, low, high = (factor * part for part in (estimate.value, estimate.low, estimate.high))
    return f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def worth(options: argparse.Namespace) -> Table:
    """Net rates with the tool camera on and off, paired."""
    table = Table("ground", "laser %", "without tool camera %", "worth, points", "hoe %", "hoe against a plane, points")
    level = None
    for iso_class in CLASSES:
        on, off = (
            batch_scores(
                LASER,
                options.fields,
                options.scenario,
                options.policy,
                overrides(options.strip, iso_class=iso_class, second_motion=True, tool_camera=used),
            )["net_rate"]
            for used in (True, False)
        )
        settings = overrides(options.strip, iso_class=iso_class)
        hoe = batch_scores(HOE, options.fields, options.scenario, options.policy, settings)["net_rate"]
        level = hoe if level is None else level
        parts = mean(on), mean(off), paired_difference(on, off), mean(hoe), paired_difference(hoe, level)
        table.add_row(iso_class, *map(shown, parts))
    return table


def rms(values: ArrayLike, factor: float) -> str:
    """A root mean square."""
    return f"{factor * np.sqrt((np.asarray(values, float) ** 2).mean()):.2f}"


def stops(options: argparse.Namespace) -> Table:
    """How the picker's frame stands at its stops, root mean squares, and net rates against a plane, paired."""
    table = Table("ground", "heave mm", "pitch deg", "roll deg", "shears mm", "net rate %", "against a plane, points")
    seeds, policy, level = DRIVES.take(options.fields), reference_policy(PICKER), None
    for iso_class in CLASSES:
        settings = overrides(iso_class=iso_class)
        kwargs: dict[str, Any] = {"scenario": "field", "perception": "model", "overrides": settings}
        scores = evaluate(partial(make_policy, policy), PICKER, seeds, **kwargs)
        rates = np.asarray(scores.scorecard["net_rate"])
        level = rates if level is None else level
        parts = shown(mean(rates), digits=2), shown(paired_difference(rates, level), digits=2)
        stands, missed = _stands(seeds, kwargs)
        table.add_row(
            iso_class,
            rms(stands[..., 0], 1e3),
            rms(stands[..., 1], DEGREES),
            rms(stands[..., 2], DEGREES),
            " / ".join(rms(missed[:, axis], 1e3) for axis in range(3)),
            *parts,
        )
    return table


def _stands(seeds: Sequence[int], kwargs: dict[str, Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How carts stand (rows, stops, 3), and how far off that puts the shears at every head (n, 3)."""
    env: Any = gym.make_vec(PICKER, len(seeds), vectorization_mode="vector_entry_point", **kwargs)
    env.reset(seed=list(seeds))
    core = env.unwrapped.core
    if not core.rough:
        return np.zeros((1, 1, 3)), np.zeros((1, 3))
    centres, state = stop_centres(core.config.scenario), core.state
    missed = []
    for slot in range(state.head_position.shape[1] - 1):
        heads = state.head_position[:, slot].copy()
        stop = np.abs(heads[:, :1] - centres).argmin(axis=1)
        off = stand_error(core.config, core.stands, stop, heads)
        missed.append(off[core.head_exists[:, slot]])
    env.close()
    return core.stands, np.concatenate(missed)


def line(_: argparse.Namespace) -> Table:
    """What one line of wheels would do to a frame, root mean squares of all waves of the ground's density."""
    table = Table("ground", "pitch deg", "heave mm", "camera mm", "heave m/s2", "spot in an exposure, um")
    edges = np.linspace(*WAVES_PER_M, 100_001)
    waves, width = 0.5 * (edges[1:] + edges[:-1]), edges[1] - edges[0]
    turn, climb = 2.0 * np.sin(np.pi * waves * BASE_M) / BASE_M, np.cos(np.pi * waves * BASE_M)
    rate = 2.0 * np.pi * waves * SPEED_M_S
    for iso_class in CLASSES[1:]:
        ground = GroundConfig(iso_class=iso_class)
        power = density_m3(ground, waves) * np.sinc(waves * ground.footprint_m) ** 2 * width

        def size(part: NDArray[np.float64], power: NDArray[np.float64] = power) -> float:
            return float(np.sqrt((power * part**2).sum()))

        table.add_row(
            iso_class,
            f"{DEGREES * size(turn):.2f}",
            f"{1e3 * size(climb):.1f}",
            f"{1e3 * CAMERA_M * size(turn):.1f}",
            f"{size(climb * rate**2):.4f}",
            f"{1e6 * EXPOSURE_S * CAMERA_M * size(turn * rate):.1f}",
        )
    return table


def room(_: argparse.Namespace) -> Table:
    """How far up and down tools reach from the level that they are mounted for, all over their window."""
    table = Table("tool", "up mm", "down mm")
    for name, config in (("laser", WeedingConfig()), ("hoe", HoeWeedingConfig())):
        usual_m = config.scenario.bed.crop_height_m
        ways: tuple[Callable[[float], dict[str, float]], ...] = (
            lambda way_m, usual_m=usual_m: {"scenario.bed.crop_height_m": usual_m + way_m},
            lambda way_m: {"scenario.bed.frame_m": way_m},
        )
        table.add_row(name, *(f"{_furthest_mm(config, way)}" for way in ways))
    return table


def _furthest_mm(config: Any, way: Callable[[float], dict[str, float]]) -> int:
    """The largest whole millimetre that is not refused."""
    reached = 0
    while True:
        try:
            override(config, way(1e-3 * (reached + 1)))
        except ConfigError:
            return reached
        reached += 1


def profile(options: argparse.Namespace) -> Table:
    """What the drawn ground does, root mean squares."""
    table = Table("ground", "wheel base m", "pitch deg", "roll deg", "heave mm", "track mm", "tool mm", "depth mm")
    looks = np.random.default_rng(0).random(options.fields)
    places = np.column_stack([_AT_M, np.zeros(len(_AT_M))])

    for iso_class in CLASSES[1:]:
        for base_m in (BASE_M, GroundConfig().wheel_base_m):
            ground = GroundConfig(iso_class=iso_class, wheel_base_m=base_m, pivot_m=options.pivot)
            config = replace(WeedingConfig(), scenario=replace(SCENARIOS["load-1.0"], ground=ground))
            profiles, shape = draw_profiles(config, looks), shape_of(config)
            surfaces = surface_of(config, profiles)
            carrying = Carrying.of(config, profiles, looks, False)
            frames = np.array([frames_at(surface, shape, _AT_M) for surface in surfaces])
            tracks = [strayed(carrying, r, *place) for r in range(len(surfaces)) for place in places.tolist()]
            tools = [
                np.array(lands(s, shape, x, x, 0.0, 0.0)) - np.array([x, 0.0]) for s in surfaces for x in _AT_M.tolist()
            ]
            depths = [sinks_m(surface, shape, x, x, 0.0) for surface in surfaces for x in _AT_M.tolist()]
            table.add_row(
                iso_class,
                f"{base_m}",
                rms(frames[..., 1], DEGREES),
                rms(frames[..., 2], DEGREES),
                rms(frames[..., 0], 1e3),
                " / ".join(rms([pair[axis] for pair in tracks], 1e3) for axis in (0, 1)),
                " / ".join(rms([pair[axis] for pair in tools], 1e3) for axis in (0, 1)),
                rms(depths, 1e3),
            )
    return table


CONDITIONS = (
    {"drift_share": 0.01},
    {"drift_share": 0.02},
    {"drift_share": 0.04},
    {"iso_class": "A", "drift_share": 0.01},
    {"iso_class": "C", "drift_share": 0.01},
    {"iso_class": "D", "drift_share": 0.01},
)
"""Grounds by which rendered and statistical cameras are compared."""


def compared(
    options: argparse.Namespace, kinds: dict[str, dict[str, str]], conditions: Sequence[dict[str, Any]]
) -> Table:
    """The same fields played in two ways."""
    first, second = kinds
    table = Table("ground", f"{first} %", f"{second} %", "difference, points", "cycle time, difference %")
    for ground in conditions:
        settings = overrides(options.strip, **ground)
        one, other = (
            scores_one_by_one(options.fields, options.scenario, options.policy, overrides=settings, **kwargs)
            for kwargs in kinds.values()
        )
        rates = one["net_rate"], other["net_rate"]
        cycle = 100.0 * (other["cycle_time_s"].mean() / one["cycle_time_s"].mean() - 1.0)
        words = ", ".join(f"{name} {value}" for name, value in ground.items())
        parts = shown(mean(rates[0])), shown(mean(rates[1])), shown(paired_difference(rates[1], rates[0]))
        table.add_row(words, *parts, f"{cycle:+.2f}")
        Console().print(words, *parts, f"{cycle:+.2f}")
    return table


def cameras(options: argparse.Namespace) -> Table:
    """Rendered cameras against statistical ones, both with the analytic executor."""
    kinds = {name: {"backend": "analytic", "perception": name} for name in ("model", "camera")}
    return compared(options, kinds, CONDITIONS)


def backends(options: argparse.Namespace) -> Table:
    """PyBullet against the analytic executor, both with statistical cameras."""
    kinds = {name: {"backend": name, "perception": "model"} for name in ("analytic", "pybullet")}
    return compared(options, kinds, [{"iso_class": iso_class} for iso_class in ("A", "B", "C", "D")])


COMMANDS = {
    "worth": worth,
    "stops": stops,
    "profile": profile,
    "line": line,
    "room": room,
    "cameras": cameras,
    "backends": backends,
}


def main() -> None:
    """Play and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=COMMANDS)
    parser.add_argument("--fields", type=int, default=24)
    parser.add_argument("--strip", type=float, help="length of the fields in metres")
    parser.add_argument("--scenario", default="load-1.0", choices=SCENARIOS)
    parser.add_argument("--policy", default="edf")
    parser.add_argument("--pivot", type=float, default=GroundConfig().pivot_m, help="height of what frames tilt about")
    options = parser.parse_args()
    if options.fields < 1:
        parser.error(f"--fields {options.fields}: give at least 1")
    Console(width=150).print(COMMANDS[options.what](options))


if __name__ == "__main__":
    main()
