"""What the transplanter's scorecards come to in a grower's units: trays an hour."""

from __future__ import annotations

import numpy as np

from ...motion import QUINTIC
from ...simulation.dynamics import transplanter_dynamics
from ..rates import HOUR_S, Rates, Scores, straight_power_w
from .config import TransplantingConfig

_ACROSS = 7
_NORMAL = 1
"""The carrying speed that stands for all."""


def rates_of(config: TransplantingConfig) -> Rates:
    """Of a configuration: the arm's motors, with and without a plug; the conveyors' energy is not modelled.

    Trays are healthy cells by the cells of a tray.
    """
    machine, cells = config.machine, config.scenario.target.cells

    def per_h(scores: Scores) -> float:
        return HOUR_S * scores["healthy"] / cells / max(scores["duration_s"], 1e-9)

    carrying = machine.carry_acceleration_m_s2[_NORMAL]
    carry_w = _gate_w(config, carrying, config.process.plug_kg)
    return Rates("trays", per_h, motor_w={"travel": _gate_w(config, machine.acceleration_m_s2, 0.0), "carry": carry_w})


def _gate_w(config: TransplantingConfig, acceleration_m_s2: float, payload_kg: float) -> float:
    """Mean power on gates between the trays that stop at their corners: up, across, down."""
    machine = config.machine
    (_, bottom), _ = machine.arm.window_m
    half = 0.5 * (config.scenario.source.columns - 1) * config.scenario.source.pitch_m
    left = -machine.tray_centre_m + half * np.linspace(-1.0, 1.0, _ACROSS)
    right = left + 2.0 * machine.tray_centre_m
    top = bottom + machine.lift_m
    corners = [np.column_stack([x, np.full(_ACROSS, y)]) for x, y in ((left, bottom), (left, top), (right, top))]
    corners.append(np.column_stack([right, np.full(_ACROSS, bottom)]))
    start, end = np.concatenate(corners[:-1]), np.concatenate(corners[1:])
    time_s = QUINTIC.duration(np.linalg.norm(end - start, axis=1), machine.velocity_m_s, acceleration_m_s2)
    dynamics = transplanter_dynamics(machine.parameters, payload_kg)
    return straight_power_w(dynamics, start, end - start, time_s, (machine.friction_n_m,) * 2)
