"""What a picker believes of heads from what its camera reports: what they bear, and what each effort gets of it.

All of it follows from the configuration and the camera's statistics. What drives and ground put the tool off by is not
counted: nothing tells a machine of that.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...envs.safflower.config import OPEN_STAGES, STAGES, PerceptionModel, SafflowerConfig
from ...envs.safflower.drawing import SIZE_SHARE, SPREAD_SIGMA, heads_per_plant, stage_shares
from ...envs.safflower.features import SIZE_SCALE_M, C
from ...envs.safflower.field import SPREAD_M
from ...envs.safflower.filling import MOST_SIGMAS
from ...envs.safflower.process import Shears, collected_share, cut_share, dropped_share
from ...kernels.elementary import exp

Array = NDArray[np.float64]

_NODES = 5
"""Of a quadrature over a normal law."""


class PickerBelief:
    """Means given reports.

    Attributes:
        shares: (E,), share of an open head's filaments that each effort gets with an empty bag.
        clog: (E,), share of that which a full bag lets drop; in between nearly in proportion to its fill.
        open: (4,), chance that what is reported to be of each stage is an open head.
    """

    def __init__(self, config: SafflowerConfig, perception: PerceptionModel | None):
        """Take both; without a statistical camera, what was measured of the one that renders."""
        eyes = perception or PerceptionModel.measured(config.scenario.camera_fit)
        self.shares, self.open = _shares(config, eyes, 0.0), _open(config, eyes)
        self.clog = 1.0 - _shares(config, eyes, config.scenario.bag.clog) / self.shares
        # Size and the logarithm of mass are jointly normal, and the report adds an error in proportion to the size.
        told = eyes.size_sigma * np.hypot(1.0, SPREAD_SIGMA)
        self._trust = SPREAD_SIGMA / (SPREAD_SIGMA**2 + told**2)
        self._steep = config.head_mass_spread * SIZE_SHARE

    def mass(self, candidates: NDArray[Any]) -> Array:
        """Mean filaments of candidates (..., F) relative to an average open head's, given their sizes and stages."""
        off = candidates[..., C.size].astype(np.float64) * (SIZE_SCALE_M / SPREAD_M) - 1.0
        chance = candidates[..., C.bud : C.bud + len(STAGES)] @ self.open
        sigmas = np.clip(self._trust * off, -MOST_SIGMAS, MOST_SIGMAS)
        return chance * exp(self._steep * sigmas - 0.5 * self._steep**2 * self._trust * SPREAD_SIGMA)


def _open(config: SafflowerConfig, eyes: PerceptionModel) -> Array:
    """See ``PickerBelief.open``."""
    scenario = config.scenario
    free, behind = np.array(eyes.recall)
    seen = stage_shares(scenario) * ((1.0 - scenario.occluded) * free + scenario.occluded * behind)
    both = seen[:, None] * np.array(eyes.stage_confusion)
    reported = both.sum(axis=0)
    # What is nothing at all is taken for either of the open stages.
    heads = scenario.plants * heads_per_plant(scenario)
    reported[list(OPEN_STAGES)] += eyes.false_per_stop * scenario.stops / (len(OPEN_STAGES) * heads)
    return both[list(OPEN_STAGES)].sum(axis=0) / np.where(reported > 0.0, reported, 1.0)


def _shares(config: SafflowerConfig, eyes: PerceptionModel, clog: float) -> Array:
    """See ``PickerBelief.shares``, with a bag that lets a share drop besides."""
    process = config.process
    node, weight = np.polynomial.hermite_e.hermegauss(_NODES)
    weight = weight / weight.sum()
    odds = exp(process.luck_logit * node)
    along, across, up = np.add.outer(np.array(eyes.bias_m), np.zeros(_NODES)) + np.outer(eyes.sigma_m, node)
    shears, shares = Shears.of(process), np.zeros(len(process.strokes))
    for effort, (strokes, suction_s) in enumerate(zip(process.strokes, process.suction_s, strict=True)):
        cut = sum(
            weight[i]
            * weight[j]
            * weight[k]
            * weight[luck]
            * cut_share(shears, float(strokes), along[i], across[j], up[k], float(odds[luck]))
            for i, j, k, luck in np.ndindex((_NODES,) * 4)
        )
        dropped = dropped_share(process, suction_s)
        dropped += (1.0 - dropped) * clog
        shares[effort] = cut * sum(w * collected_share(dropped, o) for w, o in zip(weight, odds, strict=True))
    return shares
