"""The sorter's accelerations within what its motors can give."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from ...mechanisms.bodies import EffortTerms, effort_terms
from ...motion import QUINTIC
from ...motion.efforts import law_columns
from ...motion.orientation import LEVEL, angle_between, conjugate, euler_angles, product, slerp, tilted
from ...simulation.dynamics import prrs_dynamics
from ..core import Array
from ..motors import ALL, Motions, Motor, Shares, shares
from .config import MachineConfig, SortingConfig
from .reach import ABOVE_M, radii, reach_m

_MOTIONS = 120
_LOOKS = 9
"""Places along a motion at which it is held to the reach."""


def within_motors(config: SortingConfig) -> SortingConfig:
    """The configuration with the platform's limits lowered to what the motors can give with the heaviest item.

    Raises:
        ConfigError: a motor cannot hold or move the platform.
    """
    machine, speed, item = config.machine, config.belt.speed_m_s, heaviest_kg(config)
    plain = SortingConfig()
    # The shipped machine's motors suffice (tested).
    if (machine, speed, item) == (plain.machine, plain.belt.speed_m_s, heaviest_kg(plain)):
        return config
    share = motor_shares(machine, speed, item)
    if share == ALL:
        return config
    sorter = machine.sorter
    slower = replace(
        sorter,
        velocity_m_s=share.speed * sorter.velocity_m_s,
        acceleration_m_s2=share.acceleration * sorter.acceleration_m_s2,
        turn_rad_s=share.speed * sorter.turn_rad_s,
        turn_rad_s2=share.acceleration * sorter.turn_rad_s2,
    )
    # Catching up with the belt and letting it go accelerate too, the more the shorter they are.
    ramp_s = machine.shortest_move_s / share.acceleration
    longer = replace(machine, sorter=slower, shortest_move_s=ramp_s, stop_s=max(machine.stop_s, ramp_s))
    return replace(config, machine=longer)


def heaviest_kg(config: SortingConfig) -> float:
    """Mass of the heaviest item that may come."""
    produce = config.produce
    thickness = produce.thickness[1]
    shapes = ((produce.tuber_length_m[1], produce.tuber_width[1]), (produce.fruit_length_m[1], produce.fruit_width[1]))
    return max(produce.density_kg_m3 * np.pi / 6.0 * length**3 * width**2 * thickness for length, width in shapes)


@lru_cache(maxsize=64)
def motor_shares(machine: MachineConfig, speed_m_s: float, payload_kg: float) -> Shares:
    """Shares of the platform's limits that the motors can give."""
    sorter, prefix = machine.sorter, "machine.sorter"
    slider = Motor(f"{prefix}.slider_force_limit_n", sorter.slider_force_limit_n, "N", sorter.slider_friction_n)
    swing = Motor(f"{prefix}.swing_torque_limit_n_m", sorter.swing_torque_limit_n_m, "N m", sorter.swing_friction_n_m)
    found = motions(machine, speed_m_s, payload_kg)
    return shares(found, (slider,) * 3 + (swing,) * 3, SortingConfig.__name__)


def motions(machine: MachineConfig, speed_m_s: float, payload_kg: float) -> Motions:
    """Level and upright strokes all over the reach, turning as far as the commands allow, mostly at its edge."""
    sorter = machine.sorter
    poses, velocity, acceleration, lengths = paths(machine)
    terms = effort_terms(prrs_dynamics(sorter, payload_kg, sorter.tool_m), poses, velocity, acceleration)
    # What following the belt adds to the acceleration, as a share of the platform's own limit.
    extra = QUINTIC.peak_velocity * speed_m_s / machine.shortest_move_s / sorter.acceleration_m_s2
    terms = EffortTerms(terms.inertia * (1.0 + extra), terms.viscous, terms.steady)
    accelerations = np.array([sorter.acceleration_m_s2, sorter.turn_rad_s2])
    accelerating = QUINTIC.duration(lengths, np.inf, accelerations).max(axis=1)
    speeds = np.array([sorter.velocity_m_s, sorter.turn_rad_s])
    return Motions(terms, QUINTIC.duration(lengths, speeds, accelerations).max(axis=1), accelerating)


def paths(machine: MachineConfig) -> tuple[Array, Array, Array, Array]:
    """Poses (n, samples, 6) on those strokes, twists and their rates as if each took a second, lengths (n, 2).

    Lengths are metres and radians.
    """
    start, end, first, last = _strokes(machine)
    s, v, a = law_columns(QUINTIC)
    angle = angle_between(first, last)
    turn = product(last, conjugate(first))
    turn *= np.where(turn[:, :1] < 0.0, -1.0, 1.0)
    norm = np.linalg.norm(turn[:, 1:], axis=1, keepdims=True)
    stroke = np.concatenate([end - start, angle[:, None] * turn[:, 1:] / np.where(norm > 0.0, norm, 1.0)], axis=1)
    ways = stroke[:, None]
    lengths = np.column_stack([np.linalg.norm(end - start, axis=1), angle])
    return _poses(start, end, first, last, s[:, 0]), v * ways, a * ways, lengths


def _strokes(machine: MachineConfig) -> tuple[Array, Array, Array, Array]:
    """Starts and ends (n, 3) and orientations (n, 4) there, always the same of a machine; one stands still at home.

    A third each goes up or down, turns from level as on the way to an item, and turns from one item to the next.
    """
    generator, mechanism = np.random.default_rng(0), machine.sorter.mechanism
    (start, first), (end, last) = (_places(machine, generator) for _ in range(2))
    kind = np.arange(len(start)) % 3
    upright = (kind == 0)[:, None]
    heights = generator.uniform(0.0, machine.travel_level_m, len(start))
    end = np.where(upright, np.column_stack([start[:, :2], heights]), end)
    last = np.where(upright, first, last)
    first = np.where((kind == 1)[:, None], LEVEL, first)
    within = mechanism.reachable(_poses(start, end, first, last, np.linspace(0.0, 1.0, _LOOKS))).all(axis=1)
    kept = np.flatnonzero(within)[:_MOTIONS]
    home = mechanism.home_pose[:3]
    start, end = (np.concatenate([part[kept], home[None]]) for part in (start, end))
    first, last = (np.concatenate([part[kept], LEVEL[None]]) for part in (first, last))
    return start, end, first, last


def _places(machine: MachineConfig, generator: np.random.Generator) -> tuple[Array, Array]:
    """Positions (n, 3) at the travel level and orientations (n, 4), half of them at the edge of the reach."""
    n = 4 * _MOTIONS
    table = radii(machine.sorter.mechanism, machine.travel_level_m + ABOVE_M)
    tilt, yaw = (
        generator.uniform(0.0, machine.tilt_limit_rad, n),
        generator.uniform(-1.0, 1.0, n) * machine.yaw_limit_rad,
    )
    share = np.where(generator.random(n) < 0.5, 1.0, np.sqrt(generator.random(n)))
    edge = np.array([max(reach_m(table, *angles), 0.0) for angles in zip(tilt.tolist(), yaw.tolist(), strict=True)])
    around = generator.uniform(0.0, 2.0 * np.pi, n)
    radius = edge * share
    place = np.column_stack([radius * np.cos(around), radius * np.sin(around), np.full(n, machine.travel_level_m)])
    return place, tilted(tilt, generator.uniform(0.0, 2.0 * np.pi, n), yaw)


def _poses(start: Array, end: Array, first: Array, last: Array, share: Array) -> Array:
    """Poses (n, samples, 6) at shares (samples,) of strokes and turns."""
    position = start[:, None] + share[:, None] * (end - start)[:, None]
    parts = np.broadcast_to(share, (len(start), len(share)))
    return np.concatenate([position, euler_angles(slerp(first[:, None], last[:, None], parts))], axis=-1)
