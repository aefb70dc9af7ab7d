"""The transplanter's accelerations within what its motors can give."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from ...mechanisms.bodies import effort_terms
from ...motion import QUINTIC
from ...motion.efforts import law_columns
from ...simulation.dynamics import transplanter_dynamics
from ..core import Array
from ..motors import ALL, Motions, Motor, Shares, shares
from .config import MachineConfig, TransplantingConfig

_ACROSS, _UP, _AROUND = 9, 4, 12


def within_motors(config: TransplantingConfig) -> TransplantingConfig:
    """The configuration with the tool's accelerations lowered to what the motors can give with a plug.

    Raises:
        ConfigError: a motor cannot hold or move the arm.
    """
    machine = config.machine
    # The shipped machine's motors suffice for every plug (tested).
    share = ALL if machine == MachineConfig() else motor_shares(machine, config.process.plug_kg)
    if share == ALL:
        return config
    most = share.acceleration * machine.acceleration_m_s2
    gentle, normal, fast = (min(limit, most) for limit in machine.carry_acceleration_m_s2)
    slower = replace(
        machine,
        acceleration_m_s2=most,
        carry_acceleration_m_s2=(gentle, normal, fast),
        velocity_m_s=share.speed * machine.velocity_m_s,
    )
    return replace(config, machine=slower)


@lru_cache(maxsize=64)
def motor_shares(machine: MachineConfig, payload_kg: float) -> Shares:
    """Shares of the tool's limits that the motors can give with a payload."""
    motor = Motor("machine.torque_limit_n_m", machine.torque_limit_n_m, "N m", machine.friction_n_m)
    owner = TransplantingConfig.__name__
    if machine.motion.startswith("stop"):
        return shares(stopped(machine, payload_kg), (motor, motor), owner)
    share = shares(anywhere(machine, payload_kg), (motor, motor), owner).acceleration
    # On a rounded way the whole speed may meet the whole acceleration: both are lowered, as in slow motion.
    return Shares(share, float(np.sqrt(share)))


def stopped(machine: MachineConfig, payload_kg: float) -> Motions:
    """Rises, falls and traverses with rest at their ends, all over the window."""
    (left, bottom), (right, _) = machine.arm.window_m
    level = bottom + machine.lift_m
    x = np.linspace(left, right, _ACROSS)
    low, high = (np.column_stack([x, np.full(_ACROSS, y)]) for y in (bottom, level))
    first, last = (side.ravel() for side in np.meshgrid(x, x))
    start = np.concatenate([low, high, np.column_stack([first, np.full(len(first), level)])])
    end = np.concatenate([high, low, np.column_stack([last, np.full(len(last), level)])])
    s, v, a = law_columns(QUINTIC)
    ways = (end - start)[:, None]
    dynamics = transplanter_dynamics(machine.parameters, payload_kg)
    terms = effort_terms(dynamics, start[:, None] + s * ways, v * ways, a * ways)
    lengths, limit = np.linalg.norm(end - start, axis=1), machine.acceleration_m_s2
    return Motions(
        terms, QUINTIC.duration(lengths, machine.velocity_m_s, limit), QUINTIC.duration(lengths, np.inf, limit)
    )


def anywhere(machine: MachineConfig, payload_kg: float) -> Motions:
    """Full speed with full acceleration in every direction all over the window, and full acceleration from rest."""
    places = machine.arm.window_grid(_ACROSS, _UP).reshape(-1, 1, 1, 2)
    angle = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    velocity = machine.velocity_m_s * np.concatenate([np.zeros((1, 2)), around])[:, None]
    acceleration = machine.acceleration_m_s2 * around
    states: list[Array] = [part.reshape(-1, 1, 2) for part in np.broadcast_arrays(places, velocity, acceleration)]
    dynamics = transplanter_dynamics(machine.parameters, payload_kg)
    ones = np.ones(len(states[0]))
    return Motions(effort_terms(dynamics, *states), ones, ones)
