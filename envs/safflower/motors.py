"""The picker's accelerations within what its motors can give."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from ...mechanisms.bodies import effort_terms
from ...motion import QUINTIC
from ...motion.efforts import law_columns
from ...simulation.dynamics import picker_dynamics, picker_moved_kg
from ..core import Array
from ..motors import ALL, SLOWEST, Motions, Motor, refuse, shares
from .config import MachineConfig, SafflowerConfig
from .drawing import reach_table

_LEVELS, _ACROSS = 8, 9


def within_motors(config: SafflowerConfig) -> SafflowerConfig:
    """The configuration with the limits of tool and cart lowered to what the motors can give.

    Raises:
        ConfigError: a motor cannot hold or move the machine.
    """
    machine = config.machine
    # The shipped machine's motors suffice (tested).
    slower = machine if machine == MachineConfig() else fitted(machine)
    return config if slower is machine else replace(config, machine=slower)


@lru_cache(maxsize=64)
def fitted(machine: MachineConfig) -> MachineConfig:
    """The machine within its motors' limits."""
    picker = machine.picker
    prefix, owner = "machine.picker", SafflowerConfig.__name__
    arm = Motor(f"{prefix}.arm_torque_limit_n_m", picker.arm_torque_limit_n_m, "N m", picker.arm_friction_n_m)
    share = shares(motions(machine), (arm, arm), owner)
    drive = Motor(f"{prefix}.cart_force_limit_n", picker.cart_force_limit_n, "N", picker.cart_friction_n)
    wanted, moved_kg = picker.cart_acceleration_m_s2, picker_moved_kg(picker)
    if drive.planned < SLOWEST * wanted * moved_kg:
        refuse(drive, SLOWEST * wanted * moved_kg, owner, "move the cart slowly")
    cart = min(wanted, drive.planned / moved_kg)
    if share == ALL and cart == wanted:
        return machine
    slower = replace(
        picker,
        tool_acceleration_m_s2=share.acceleration * picker.tool_acceleration_m_s2,
        tool_velocity_m_s=share.speed * picker.tool_velocity_m_s,
        cart_acceleration_m_s2=cart,
    )
    return replace(machine, picker=slower)


def motions(machine: MachineConfig) -> Motions:
    """Rises from all over the reach to the level of the traverses, and traverses over its width."""
    picker, clear = machine.picker, machine.clear_level_m
    levels, widths = reach_table(picker.five_bar)
    below = (levels < clear) & (widths >= 0.0)
    lowest = float(levels[below].min()) if below.any() else clear
    share = np.linspace(-1.0, 1.0, _ACROSS)
    starts: list[Array] = []
    for level in np.linspace(lowest, clear, _LEVELS, endpoint=False):
        across = max(float(np.interp(level, levels, widths)), 0.0) * share
        starts.append(np.column_stack([across, np.full(_ACROSS, level)]))
    rises = np.concatenate(starts)
    ends = np.column_stack([rises[:, 0], np.full(len(rises), clear)])
    across = max(float(np.interp(clear, levels, widths)), 0.0) * share
    first, last = (side.ravel() for side in np.meshgrid(across, across))
    middle = np.array([0.5 * picker.five_bar.base_m, 0.0])
    start = np.concatenate([rises, np.column_stack([first, np.full(len(first), clear)])]) + middle
    stroke = np.concatenate([ends, np.column_stack([last, np.full(len(last), clear)])]) + middle - start
    s, v, a = law_columns(QUINTIC)
    ways = stroke[:, None]
    terms = effort_terms(picker_dynamics(picker), start[:, None] + s * ways, v * ways, a * ways)
    lengths, limit = np.linalg.norm(stroke, axis=1), picker.tool_acceleration_m_s2
    return Motions(
        terms,
        QUINTIC.duration(lengths, picker.tool_velocity_m_s, limit),
        QUINTIC.duration(lengths, np.inf, limit),
    )
