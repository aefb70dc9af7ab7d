"""The laser weeder's accelerations within what its motors can give."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from .....mechanisms.bodies import effort_terms
from .....motion import QUINTIC
from .....motion.efforts import law_columns
from .....simulation.dynamics import weeder_dynamics, weeder_moved_kg
from .....simulation.weeder_model import WeederParameters
from ....core import Array
from ....motors import ALL, PLANNED, Motions, Motor, Shares, refuse, shares
from .aim import LaserReach, poses
from .config import EXCESS_M, WeedingConfig

_MOTIONS = 60
FLAT_M = 0.0, 0.0
"""Height of furrows and ridges where there are none."""
_STEP = 1e-4
"""Of the differences that turn a way of the beam into velocities and accelerations of the pose."""


def within_motors(config: WeedingConfig) -> WeedingConfig:
    """The configuration with the aim's limits lowered to what the motors can give.

    Raises:
        ConfigError: a motor cannot hold or move the platform, or the cart's drive cannot change its speed.
    """
    reach, acceleration, levels_m = config.aim, config.cart.acceleration_m_s2, config.scenario.bed.levels_m
    plain = WeedingConfig()
    # The shipped machine's motors suffice (tested).
    shipped = plain.reach, plain.machine, plain.cart.acceleration_m_s2, FLAT_M
    if (reach, config.machine, acceleration, levels_m) == shipped:
        return config
    share = motor_shares(reach, config.parameters, acceleration, levels_m)
    if share == ALL:
        return config
    slower = replace(
        config.reach,
        travel_velocity_m_s=share.speed * reach.travel_velocity_m_s,
        travel_acceleration_m_s2=share.acceleration * reach.travel_acceleration_m_s2,
        lean_velocity_m_s=share.speed * reach.lean_velocity_m_s,
        lean_acceleration_m_s2=share.acceleration * reach.lean_acceleration_m_s2,
    )
    return replace(config, reach=slower)


@lru_cache(maxsize=64)
def motor_shares(
    reach: LaserReach, parameters: WeederParameters, acceleration_m_s2: float, levels_m: tuple[float, float] = FLAT_M
) -> Shares:
    """Shares of the aim's limits that the motors can give while the cart changes its speed."""
    owner = WeedingConfig.__name__
    driving_n = weeder_moved_kg(parameters) * acceleration_m_s2
    thrust = Motor("machine.cart_force_limit_n", parameters.cart_force_limit_n, "N", parameters.cart_friction_n)
    if thrust.planned < driving_n:
        refuse(thrust, driving_n, owner, "change the cart's speed at its acceleration")
    thrust = thrust._replace(lost=thrust.lost + driving_n / PLANNED)
    leg = Motor("machine.leg_force_limit_n", parameters.leg_force_limit_n, "N", parameters.leg_friction_n)
    return shares(motions(reach, parameters, levels_m), (thrust, leg, leg, leg, leg), owner)


def motions(reach: LaserReach, parameters: WeederParameters, levels_m: tuple[float, float] = FLAT_M) -> Motions:
    """Moves of platform and beam over the whole reach and short ones all over it, each axis as fast as it may be.

    Where there are furrows and ridges (``levels_m``), the same moves stay in the ones, on the others, and change.
    """
    start, stroke = _strokes(reach)
    rises = [(begin, end - begin) for begin in dict.fromkeys(levels_m) for end in dict.fromkeys(levels_m)]
    rise = np.repeat(np.array(rises), len(start), axis=0)
    start, stroke = np.tile(start, (len(rises), 1)), np.tile(stroke, (len(rises), 1))
    terms = effort_terms(weeder_dynamics(parameters), *paths(reach, start, stroke, rise))
    pace, square = (np.array(values) for values in reach.paces)
    lengths = np.abs(stroke)
    lifted = np.abs(rise[:, 1])
    accelerating = np.sqrt(np.maximum((lengths * square).max(axis=1), lifted * square[0]))
    wanted = np.maximum((lengths * pace).max(axis=1), lifted * pace[0])
    return Motions(terms, np.maximum(wanted, accelerating), accelerating)


def paths(reach: LaserReach, start: Array, stroke: Array, rise: Array | None = None) -> tuple[Array, Array, Array]:
    """Places of cart and platform (n, samples, 5) on moves of the beam, and two derivatives, as if each took a second.

    Args:
        reach: of the aim.
        start: of the moves in beam coordinates, (n, 3).
        stroke: likewise.
        rise: height of the targets at first and what it grows by, (n, 2); level by default.
    """
    rise = np.zeros((len(start), 2)) if rise is None else rise
    s, v, a = law_columns(QUINTIC)

    def at(share: Array) -> Array:
        return poses(reach, start[:, None] + share * stroke[:, None], 0.0, rise[:, :1] + share[:, 0] * rise[:, 1:])

    here, ahead, behind = at(s), at(s + _STEP), at(s - _STEP)
    slope = (ahead - behind) / (2.0 * _STEP)
    bend = (ahead - 2.0 * here + behind) / _STEP**2
    still = np.zeros((*here.shape[:-1], 1))
    place, velocity, acceleration = (
        np.concatenate([still, part], axis=-1) for part in (here, slope * v, slope * a + bend * v**2)
    )
    return place, velocity, acceleration


def _strokes(reach: LaserReach) -> tuple[Array, Array]:
    """Starts and strokes (n, 3) in beam coordinates: between corners, then short ones at their limits anywhere."""
    generator = np.random.default_rng(0)
    most = np.array([reach.travel_m + EXCESS_M, reach.lean_m, reach.half_width_m])
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T * most
    first, last = np.triu_indices(len(corners), 1)
    start, end = np.concatenate([corners[first], corners[last]]), np.concatenate([corners[last], corners[first]])
    # All three axes accelerate as much as they may where their strokes are in proportion to their limits.
    square = np.array(reach.paces[1])
    sides = generator.choice([-1.0, 1.0], (_MOTIONS, 3))
    short = sides * 0.02 / (square / square.min())
    somewhere = generator.uniform(-1.0, 1.0, (_MOTIONS, 3))
    somewhere[::2] = np.sign(somewhere[::2])
    anywhere = somewhere * (most - np.abs(short))
    return np.concatenate([start, anywhere]), np.concatenate([end - start, short])
