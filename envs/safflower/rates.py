"""What the picker's scorecards come to in a grower's units: metres of row an hour."""

from __future__ import annotations

import numpy as np

from ...motion import QUINTIC
from ...simulation.dynamics import picker_dynamics, picker_moved_kg
from ..rates import HOUR_S, Rates, Scores, driving_power_w, straight_power_w
from .config import SafflowerConfig
from .drawing import reach_table

_ACROSS = 9
_HEAD_M = 0.05
"""How far the cart drives from head to head of a stop, for the estimate of its power alone."""


def rates_of(config: SafflowerConfig) -> Rates:
    """Of a configuration: the arm's motors and the cart's drive; the shear's and the fan's energy are not modelled."""
    picker, scenario = config.machine.picker, config.scenario
    row_m = scenario.plants * scenario.pitch_m

    def per_h(scores: Scores) -> float:
        served_m = min((scores["stop"] + 1.0) * scenario.window_m, row_m)
        return HOUR_S * served_m / max(scores["duration_s"], 1e-9)

    def driving_w(stroke_m: float) -> float:
        time_s = float(QUINTIC.duration(stroke_m, picker.cart_velocity_m_s, picker.cart_acceleration_m_s2))
        return driving_power_w(picker_moved_kg(picker), stroke_m, time_s, picker.cart_friction_n)

    travel_w = _arm_w(config) + driving_w(_HEAD_M)
    return Rates("m of row", per_h, motor_w={"travel": travel_w, "drive": driving_w(scenario.window_m)})


def _arm_w(config: SafflowerConfig) -> float:
    """Mean power of the arm: rises from the middle of its reach, traverses over its width, descents."""
    picker, clear = config.machine.picker, config.machine.clear_level_m
    levels, widths = reach_table(picker.five_bar)
    below = (levels < clear) & (widths >= 0.0)
    lowest = float(levels[below].min()) if below.any() else clear
    across = max(float(np.interp(clear, levels, widths)), 0.0) * np.linspace(-1.0, 1.0, _ACROSS)
    half = 0.5 * (lowest + clear)
    inner = max(float(np.interp(half, levels, widths)), 0.0) * np.linspace(-1.0, 1.0, _ACROSS)
    high, low = np.column_stack([inner, np.full(_ACROSS, clear)]), np.column_stack([inner, np.full(_ACROSS, half)])
    ends = np.column_stack([across, np.full(_ACROSS, clear)])
    start = np.concatenate([low, high, ends])
    end = np.concatenate([high, low, np.roll(ends, _ACROSS // 2, axis=0)])
    lengths = np.linalg.norm(end - start, axis=1)
    time_s = QUINTIC.duration(lengths, picker.tool_velocity_m_s, picker.tool_acceleration_m_s2)
    friction = (picker.arm_friction_n_m,) * 2
    middle = np.array([0.5 * picker.five_bar.base_m, 0.0])
    return straight_power_w(picker_dynamics(picker), start + middle, end - start, time_s, friction)
