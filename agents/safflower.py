"""Scripted rules for the safflower picker."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..envs.safflower.config import EFFORTS, OPEN_STAGES, STAGES, SafflowerConfig
from ..envs.safflower.task import (
    ACROSS_SCALE_M,
    AHEAD_SCALE_M,
    CANDIDATE_FEATURES,
    MACHINE_FEATURES,
    SIZE_SCALE_M,
    TRAVEL_SCALE_S,
    candidate_table,
)
from ..motion import QUINTIC
from .policy import Actions, Observation, StatelessPolicy
from .routes import open_route

NORMAL = EFFORTS.index("normal")
_COLUMN = {name: i for i, name in enumerate(CANDIDATE_FEATURES)}
_OPEN = [_COLUMN[STAGES[stage]] for stage in OPEN_STAGES]
_MEAN_SIZE_M = 0.04785
_CENTRED_SHARE = 0.9
"""Share of a stroke's cut that is left on average at the camera's position error [assumed by the rule]."""


def wanted(observation: Observation) -> NDArray[np.bool_]:
    """Candidates (B, K) that can be reached and are reported to be in bloom."""
    candidates = candidate_table(observation)
    reachable = observation["action_mask"][:, : -1 : len(EFFORTS)] > 0
    return reachable & (candidates[..., _OPEN].max(axis=-1) > 0.5)


def _pick(slot: NDArray[Any], effort: NDArray[Any] | int, picks: Any, slots: int) -> Actions:
    return np.where(picks, slot * len(EFFORTS) + effort, slots * len(EFFORTS))


class FixedOrder(StatelessPolicy):
    """The paper's way: every open head in the order in which the camera reports it, normal effort."""

    name = "fixed-order"

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        open_heads = wanted(observation)
        return _pick(open_heads.argmax(axis=1), NORMAL, open_heads.any(axis=1), open_heads.shape[1])


class Nearest(StatelessPolicy):
    """The open head that cart and arm reach soonest, normal effort."""

    name = "nearest"

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        open_heads = wanted(observation)
        travel = np.where(open_heads, candidate_table(observation)[..., _COLUMN["travel"]], np.inf)
        return _pick(travel.argmin(axis=1), NORMAL, open_heads.any(axis=1), open_heads.shape[1])


class NearestTwoOpt(StatelessPolicy):
    """The first head of an open route through all open heads at the stop: nearest neighbour mended by 2-opt moves."""

    name = "nearest-2opt"

    def __init__(self, config: SafflowerConfig):
        """Take the machine's rates from the configuration."""
        picker = config.machine.picker
        self._velocity = np.array([picker.cart_velocity_m_s, picker.tool_velocity_m_s])
        self._acceleration = np.array([picker.cart_acceleration_m_s2, picker.tool_acceleration_m_s2])

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        open_heads = wanted(observation)
        slot = np.zeros(len(open_heads), np.int64)
        for row in np.flatnonzero(open_heads.any(axis=1)).tolist():
            slots = np.flatnonzero(open_heads[row])
            slot[row] = slots[open_route(self._move_times(observation, row, slots))[0]]
        return _pick(slot, NORMAL, open_heads.any(axis=1), open_heads.shape[1])

    def _move_times(self, observation: Observation, row: int, slots: NDArray[np.int64]) -> NDArray[np.float64]:
        """Seconds between the arm (index 0) and the candidates (1..n); rise and descent are the same in any order."""
        features = candidate_table(observation)[row, slots]
        across = observation["machine"][row, MACHINE_FEATURES.index("across")]
        ahead = np.append(0.0, features[:, _COLUMN["along"]]) * AHEAD_SCALE_M
        sideways = np.append(across, features[:, _COLUMN["across"]]) * ACROSS_SCALE_M
        places = np.column_stack([ahead, sideways])
        strokes = places[:, None] - places[None]
        return QUINTIC.duration_unchecked(strokes, self._velocity, self._acceleration).max(axis=-1)


class GramsPerSecond(StatelessPolicy):
    """Chooses head and effort by what they bring against what a second is worth.

    While the row can be finished in time a second costs what the reward charges, every head is worth its best effort
    and the soonest reached one comes next. When the time will not do, a second costs what picking earns on average:
    efforts shrink, the head with the highest surplus per second comes next, and below-average ones only within the
    stop's share.
    """

    name = "grams-per-second"

    def __init__(self, config: SafflowerConfig):
        """Tabulate what each effort takes and what it is expected to bring."""
        process = config.process
        strokes, suction = np.array(process.strokes), np.array(process.suction_s)
        cut = 1.0 - (1.0 - process.stroke_cut * _CENTRED_SHARE) ** strokes
        kept = 1.0 - process.suction_loss * np.exp(-suction / process.suction_decay_s)
        self._grams = config.head_mass_g * cut * kept
        self._process_s = strokes * process.stroke_m / process.shear_speed + suction
        self._process_s = self._process_s + process.locate_s + config.machine.settle_s
        self._price = abs(config.weights.seconds)
        self._average = float(np.max(self._grams / (self._process_s + 0.5 * TRAVEL_SCALE_S)))
        self._head_share = (self._process_s[NORMAL] + 0.5 * TRAVEL_SCALE_S) / config.scenario.time_limit_s

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        candidates, machine = candidate_table(observation), observation["machine"]
        open_heads = wanted(observation)
        used = machine[:, MACHINE_FEATURES.index("time")]
        served = 1.0 - machine[:, MACHINE_FEATURES.index("stops_left")]
        tight = used + self._head_share * open_heads.sum(axis=1) > served
        second = np.where(tight, self._average, self._price)[:, None, None]
        # Filaments grow with the tuft's area.
        area = (candidates[..., _COLUMN["size"]] * (SIZE_SCALE_M / _MEAN_SIZE_M)) ** 2
        travel_s = candidates[..., _COLUMN["travel"]] * TRAVEL_SCALE_S
        time_s = travel_s[..., None] + self._process_s
        surplus = area[..., None] * self._grams - second * time_s
        effort = surplus.argmax(axis=-1)
        best = surplus.max(axis=-1)
        rank = np.where(tight[:, None], best / time_s[..., NORMAL], -travel_s)
        worth = open_heads & ((best > 0.0) | tight[:, None])
        slot = np.where(worth, rank, -np.inf).argmax(axis=1)
        above_average = (open_heads & (best > 0.0)).any(axis=1)
        stay = worth.any(axis=1) & ~(tight & (used > served) & ~above_average)
        return _pick(slot, effort[np.arange(len(slot)), slot], stay, open_heads.shape[1])
