"""What a transplanter believes of cells from what is reported of them: sowing and cameras' errors taken together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...envs.transplanting.chances import held, sown
from ...envs.transplanting.columns import H
from ...envs.transplanting.config import EMPTY, HEALTHY, POOR, PerceptionModel, TransplantingConfig
from ...envs.transplanting.process import speed_chances
from .base import Observation
from .dispatch import S, carousels

Array = NDArray[np.float64]


class Gains(NamedTuple):
    """What a transplant brings on average, at each of S speeds.

    Attributes:
        cells: (B, S), target cells more that hold what they are to hold.
        spoiled: (B, S), seedlings worth something that end elsewhere.
    """

    cells: Array
    spoiled: Array


class TrayBelief:
    """Chances of cells' contents and of what becomes of plugs, in a configuration and before its cameras.

    Attributes:
        closes: (S,), chance of each speed that a plug arrives, so that its cell is taken to be done.
        whole: (S,), chance that a plug that arrived is not hurt.
    """

    def __init__(self, config: TransplantingConfig, perception: PerceptionModel | None):
        """Take both; without a statistical camera, what was measured of the one that renders."""
        scenario = self._scenario = config.scenario
        eyes = perception or PerceptionModel.measured(scenario.source, scenario.target)
        self._source, target = np.array(eyes.source), np.array(eyes.target)
        chances = speed_chances(config.machine, config.process)
        self.closes = config.process.extraction * (1.0 - chances[:, H.lose])
        self.whole = 1.0 - chances[:, H.damage]
        waits = sown(scenario.vacancy, np.array(scenario.poor)) if scenario.replug else np.array([1.0, 0.0, 0.0])
        self._line = held(sown(scenario.vacancy, np.array(scenario.poor)), self._source)
        self._target = held(waits, target)

    def gains(self, observation: Observation, second: NDArray[np.bool_], clear: NDArray[np.bool_]) -> Gains:
        """What transplants into cells that are to hold the ``second`` grade (B,), cleared first or not (B,), bring.

        Plugs are reported to be of the grade that is to be there.
        """
        want = np.where(second, POOR, HEALTHY)
        plug, rows = self._plugs(observation)[:, 0], np.arange(len(want))
        waits = self._target[np.where(clear, POOR + HEALTHY - want, EMPTY)]
        right, any_plug = plug[rows, want, want], 1.0 - plug[rows, want, EMPTY]
        had = waits[rows, want]
        good = (right * np.where(clear, 1.0, waits[:, EMPTY]))[:, None] * (self.closes * self.whole)
        hit = np.where(clear[:, None], 1.0, any_plug[:, None] * self.closes)
        return Gains(good - had[:, None] * hit, (any_plug if self._scenario.orders.on else right)[:, None] - good)

    def reported(self, share: Array) -> Array:
        """Shares (..., 2) of cells that are reported healthy and poor, of sowings with these shares of poor ones."""
        return (sown(self._scenario.vacancy, share) @ self._source)[..., HEALTHY:]

    def right(self, share: Array) -> Array:
        """Chances (..., 2) that what is reported healthy or poor is so, of sowings with these shares of poor ones."""
        plugs = held(sown(self._scenario.vacancy, share), self._source)
        return np.stack([plugs[..., grade, grade] for grade in (HEALTHY, POOR)], axis=-1)

    def _plugs(self, observation: Observation) -> Array:
        """Chances (B, trays, 3, 3) of contents given reports, of the supply's trays from the presented one on."""
        worlds = len(observation["machine"])
        if not self._scenario.orders.on:
            return np.broadcast_to(self._line, (worlds, 1, 3, 3))
        share = carousels(observation).source[:, : self._scenario.source_trays, S.share].astype(np.float64)
        return held(sown(self._scenario.vacancy, share), self._source)
