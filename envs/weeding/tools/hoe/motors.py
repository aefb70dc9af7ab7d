"""The hoe's accelerations within what its motors can give against the soil."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from .....mechanisms.bodies import EffortTerms, effort_terms
from .....motion import QUINTIC
from .....motion.efforts import law_columns
from .....simulation.dynamics import prrs_dynamics
from .....simulation.hoe_model import HoeParameters
from ....core import Array
from ....motors import ALL, Motions, Motor, Shares, shares
from .arm import HoeReach
from .config import EXCESS_M, HoeWeedingConfig
from .process import HoeProcessConfig, circle_s

_ALONG, _ACROSS = 5, 5
_NEIGHBOURS_M = 0.03
FLAT_M = 0.0, 0.0
"""Height of furrows and ridges where there are none."""


def within_motors(config: HoeWeedingConfig) -> HoeWeedingConfig:
    """The configuration with moves, plunges and stirs slowed to what the motors can give.

    Raises:
        ConfigError: a motor cannot hold or move the platform, or not against the soil.
    """
    reach, process, plain = config.reach, config.passing, HoeWeedingConfig()
    levels_m = config.scenario.bed.levels_m
    # The shipped machine's motors suffice (tested).
    if (reach, process, config.machine, levels_m) == (plain.reach, plain.process, plain.machine, FLAT_M):
        return config
    share = motor_shares(reach, process, config.parameters, levels_m)
    if share == ALL:
        return config
    return replace(
        config,
        reach=replace(
            reach,
            velocity_m_s=share.speed * reach.velocity_m_s,
            acceleration_m_s2=share.acceleration * reach.acceleration_m_s2,
        ),
        process=replace(
            config.process,
            plunge_velocity_m_s=share.speed * process.plunge_velocity_m_s,
            plunge_acceleration_m_s2=share.acceleration * process.plunge_acceleration_m_s2,
            stir_velocity_m_s=share.speed * process.stir_velocity_m_s,
            stir_acceleration_m_s2=share.acceleration * process.stir_acceleration_m_s2,
        ),
    )


@lru_cache(maxsize=64)
def motor_shares(
    reach: HoeReach, process: HoeProcessConfig, parameters: HoeParameters, levels_m: tuple[float, float] = FLAT_M
) -> Shares:
    """Shares of all limits of speed and acceleration that the motors can give."""
    p = parameters
    slider = Motor("machine.slider_force_limit_n", p.slider_force_limit_n, "N", p.slider_friction_n)
    swing = Motor("machine.swing_torque_limit_n_m", p.swing_torque_limit_n_m, "N m", p.swing_friction_n_m)
    return shares(motions(reach, process, p, levels_m), (slider,) * 3 + (swing,) * 3, HoeWeedingConfig.__name__)


def motions(
    reach: HoeReach, process: HoeProcessConfig, parameters: HoeParameters, levels_m: tuple[float, float] = FLAT_M
) -> Motions:
    """Moves over the reach, and the deepest plunge, stir and lift all over it; in furrows and on ridges."""
    parts = []
    for level_m in dict.fromkeys(levels_m):
        parts += [_moves(reach, process, parameters, level_m, end_m - level_m) for end_m in dict.fromkeys(levels_m)]
        parts += [_strokes(reach, process, parameters, level_m), _stirs(reach, process, parameters, level_m)]
    terms = EffortTerms(*(np.concatenate(column) for column in zip(*(part.terms for part in parts), strict=True)))
    wanted, accelerating = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("wanted_s", "accelerating_s")
    )
    return Motions(terms, wanted, accelerating)


def _grid(reach: HoeReach, excess_m: float) -> Array:
    """Places (n, 2) of the blade relative to the cart."""
    along = np.linspace(-1.0, 1.0, _ALONG) * (reach.travel_m + excess_m)
    across = np.linspace(-1.0, 1.0, _ACROSS) * reach.half_width_m
    return np.stack(np.meshgrid(along, across, indexing="ij"), axis=-1).reshape(-1, 2)


def _terms(
    parameters: HoeParameters, tip: Array, velocity: Array, acceleration: Array, soil: Array | None = None
) -> EffortTerms:
    """Terms of level motions whose blade is at ``tip`` (n, samples, 3); ``soil`` is the force on it."""
    dynamics = prrs_dynamics(parameters)
    pose, twist, change = (np.zeros((*tip.shape[:-1], 6)) for _ in range(3))
    pose[..., :3] = tip
    pose[..., 2] -= parameters.lowest_tip_m
    twist[..., :3], change[..., :3] = velocity, acceleration
    terms = effort_terms(dynamics, pose, twist, change)
    if soil is None:
        return terms
    still = np.zeros_like(pose)
    arm = np.array([0.0, 0.0, -parameters.tool_m])
    wrench = np.concatenate([soil, np.cross(arm, soil)], axis=-1)
    loaded = dynamics.efforts(pose, still, still, wrench=wrench)
    return EffortTerms(terms.inertia, terms.viscous, loaded)


def _moves(
    reach: HoeReach, process: HoeProcessConfig, parameters: HoeParameters, level_m: float, rise_m: float
) -> Motions:
    """Moves over ground that is ``level_m`` high where they begin and rises by ``rise_m``."""
    places = _grid(reach, EXCESS_M)
    corners = places[[0, _ACROSS - 1, len(places) - _ACROSS, len(places) - 1]]
    near = np.clip(places + _NEIGHBOURS_M, places.min(axis=0), places.max(axis=0))
    near = np.where(near == places, places - _NEIGHBOURS_M, near)
    start = np.concatenate([np.repeat(corners, 4, axis=0), places, near])
    stroke = np.concatenate([np.tile(corners, (4, 1)), near, places]) - start
    s, v, a = law_columns(QUINTIC)
    ways = np.concatenate([stroke, np.full((len(stroke), 1), rise_m)], axis=1)[:, None]
    origin = np.concatenate([start, np.full((len(start), 1), process.clearance_m + level_m)], axis=1)[:, None]
    terms = _terms(parameters, origin + s * ways, v * ways, a * ways)
    length = np.maximum(np.abs(stroke).max(axis=1), abs(rise_m))
    limits = reach.velocity_m_s, reach.acceleration_m_s2
    return Motions(terms, QUINTIC.duration(length, *limits), QUINTIC.duration(length, np.inf, limits[1]))


def _strokes(reach: HoeReach, process: HoeProcessConfig, parameters: HoeParameters, level_m: float) -> Motions:
    """Plunges and lifts; the soil pushes against them."""
    places, deepest = _grid(reach, 0.0), max(process.depth_m)
    s, v, a = law_columns(QUINTIC)
    high, low = process.clearance_m + level_m, level_m - deepest
    found = []
    for begin, stroke in ((high, low - high), (low, high - low)):
        tip = np.empty((len(places), len(s), 3))
        tip[..., :2] = places[:, None]
        tip[..., 2] = begin + s[:, 0] * stroke
        velocity, acceleration, soil = (np.zeros_like(tip) for _ in range(3))
        velocity[..., 2], acceleration[..., 2] = v[:, 0] * stroke, a[:, 0] * stroke
        soil[..., 2] = -np.sign(stroke) * _force_per_m(process) * np.maximum(level_m - tip[..., 2], 0.0)
        found.append(_terms(parameters, tip, velocity, acceleration, soil))
    terms = EffortTerms(*(np.concatenate(column) for column in zip(*found, strict=True)))
    limits = process.plunge_velocity_m_s, process.plunge_acceleration_m_s2
    ones = np.ones(2 * len(places))
    return Motions(
        terms,
        QUINTIC.duration((high - low) * ones, *limits),
        QUINTIC.duration((high - low) * ones, np.inf, limits[1]),
    )


def _stirs(reach: HoeReach, process: HoeProcessConfig, parameters: HoeParameters, level_m: float) -> Motions:
    """The widest circle at the greatest depth; the soil pushes against the blade's way."""
    places, radius = _grid(reach, 0.0), max(process.stir_radius_m)
    s, v, a = (2.0 * np.pi * column for column in law_columns(QUINTIC))
    out = np.concatenate([np.cos(s), np.sin(s), 0.0 * s], axis=1)
    along = np.concatenate([-np.sin(s), np.cos(s), 0.0 * s], axis=1)
    origin = np.column_stack([places, np.full(len(places), level_m - max(process.depth_m))])[:, None]
    shape = (len(places), len(s), 3)
    push = -_force_per_m(process) * max(process.depth_m) * along
    parts = radius * v * along, radius * (a * along - v * v * out), push
    velocity, acceleration, soil = (np.broadcast_to(part, shape) for part in parts)
    terms = _terms(parameters, origin + radius * out, velocity, acceleration, soil)
    limits = process.stir_velocity_m_s, process.stir_acceleration_m_s2
    ones = np.ones(len(places))
    return Motions(terms, circle_s(radius, *limits) * ones, circle_s(radius, np.inf, limits[1]) * ones)


def _force_per_m(process: HoeProcessConfig) -> float:
    """Resistance of the soil by depth, N/m."""
    return process.soil_resistance_pa * 2.0 * process.blade_radius_m
