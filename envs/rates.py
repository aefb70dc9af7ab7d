"""What a scorecard comes to in a grower's units: area, row, trays or items an hour, and the energy that they take.

The energy is the tool's own (laser light, work against the soil) plus the positive mechanical work of the motors that
move the tool. The latter is an estimate: the mean power of motions like those of the task, from the machine's closed
form dynamics, times the seconds that the machine spent on such motions; a braking motor gives nothing back. What
nothing here models is not in it: losses in motors and lasers, fans, pumps and cooling, and driving over the field.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..mechanisms.bodies import Dynamics
from ..motion import QUINTIC
from ..motion.efforts import law_columns
from .core import Array

Scores = Mapping[str, float]
"""A scorecard."""
HOUR_S = 3600.0
JOULES_PER_KWH = 3.6e6


class Rates(NamedTuple):
    """How the scorecards of one configuration are read.

    Attributes:
        unit: what an hour's work is counted in, as ``"ha"``.
        per_h: an hour's work.
        tool_j: the tool's own energy in the episode.
        motor_w: mean power of the motors in the phases in which they move the tool, by the phase's name.
        loss_percent: name of the score that says what the crop lost; empty where there is no crop to lose.
        demanded: net rate that an hour's work has to reach to count; 0 where none is demanded.
    """

    unit: str
    per_h: Callable[[Scores], float]
    tool_j: Callable[[Scores], float] = lambda scores: 0.0
    motor_w: Mapping[str, float] = {}
    loss_percent: str = ""
    demanded: float = 0.0

    def joules(self, scores: Scores) -> float:
        """Energy of tool and motors in the episode."""
        moving = sum(watts * scores.get(f"phase_{phase}_s", 0.0) for phase, watts in self.motor_w.items())
        return self.tool_j(scores) + moving


def items() -> Rates:
    """Of a task that says nothing else: finished targets an hour."""
    return Rates("items", lambda scores: 60.0 * scores["throughput_per_min"])


def motor_power_w(
    machine: Dynamics,
    position: Array,
    velocity: Array,
    acceleration: Array,
    duration_s: ArrayLike,
    friction: Sequence[float] = (0.0,),
) -> float:
    """Mean power of the motors over motions: their positive mechanical work / the motions' time.

    Args:
        machine: its dynamics.
        position: of the motions, (n, samples, .), at equal steps of time.
        velocity: as if each took one second, likewise.
        acceleration: likewise.
        duration_s: how long each takes, (n,).
        friction: dry, of each motor, N or N m.
    """
    time_s = np.asarray(duration_s, dtype=np.float64)[:, None]
    rate = machine.rates(position, velocity) / time_s[..., None]
    effort = machine.efforts(position, velocity / time_s[..., None], acceleration / time_s[..., None] ** 2)
    effort = effort + rate * np.array(machine.viscous) + np.sign(rate) * np.asarray(friction)
    power = np.maximum(effort * rate, 0.0).sum(axis=-1)
    mean_w = 0.5 * (power[:, 1:] + power[:, :-1]).mean(axis=1)
    return float((mean_w * time_s[:, 0]).sum() / time_s.sum())


def straight_power_w(
    machine: Dynamics, start: Array, stroke: Array, duration_s: ArrayLike, friction: Sequence[float] = (0.0,)
) -> float:
    """``motor_power_w`` of straight motions from rest to rest, ``start`` and ``stroke`` (n, .)."""
    s, v, a = law_columns(QUINTIC)
    ways = stroke[:, None]
    return motor_power_w(machine, start[:, None] + s * ways, v * ways, a * ways, duration_s, friction)


def driving_power_w(moved_kg: float, stroke_m: float, duration_s: float, friction_n: float) -> float:
    """Mean power of the drive of a cart that goes from rest to rest: what it puts into speed and friction."""
    if duration_s <= 0.0:
        return 0.0
    top_m_s = QUINTIC.peak_velocity * stroke_m / duration_s
    return (0.5 * moved_kg * top_m_s**2 + friction_n * stroke_m) / duration_s
