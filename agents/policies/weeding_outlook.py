"""What policies expect of a weeding tool, from its public numbers."""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...envs.weeding.outcomes import Outcomes
from ...envs.weeding.perception import PerceptionModel, uncorrected
from ...envs.weeding.process import WeedingProcess
from ...envs.weeding.ridges import Ridges
from ...envs.weeding.tools.hoe.arm import HoeArm
from ...envs.weeding.tools.hoe.config import HoeWeedingConfig
from ...envs.weeding.tools.hoe.process import HoeProcess, crop_loss
from ...envs.weeding.tools.laser.aim import LaserArm
from ...envs.weeding.tools.laser.config import WeedingConfig
from ...envs.weeding.tools.laser.process import LaserProcess
from ...kernels.elementary import exp

Array = NDArray[np.float64]


THRIFTS = np.concatenate([[0.0], np.geomspace(2e-4, 0.05, 63)])
"""Prices of a joule, in killed weeds, that are tried where energy is scarce."""
LEAST_M = 0.3
"""A strip's end is reckoned with as this long."""


class Thrift(NamedTuple):
    """How much energy a metre takes by what a joule costs, descending; shots are fired where they are worth it.

    Attributes:
        price: (n,), of a joule, in killed weeds, ascending.
        use_j_per_m: (n,).
    """

    price: Array
    use_j_per_m: Array

    @classmethod
    def of(cls, tables: Outcomes, energy_j: Array) -> Thrift:
        """From the average shots at what is reported."""
        share = tables.own_count / tables.own_count.sum()
        worth = tables.own[..., None, :] - THRIFTS[:, None] * energy_j
        mode = worth.argmax(axis=-1)
        spent = np.where(worth.max(axis=-1) > 0.0, energy_j[mode], 0.0)
        use = tables.per_m[0] * (share[..., None] * spent).reshape(-1, spent.shape[-1]).sum(axis=0)
        return cls(THRIFTS, np.minimum.accumulate(use))

    def price_of(self, left_j: Array, left_m: Array) -> Array:
        """The lowest price (B,) at which what is left (B,) lasts for the metres that are left (B,)."""
        affordable = left_j / np.maximum(left_m, LEAST_M)
        first = np.searchsorted(-self.use_j_per_m, -affordable)
        return self.price[np.minimum(first, len(self.price) - 1)]


class Outlook(NamedTuple):
    """A tool as policies see it; M modes.

    Attributes:
        arm: numbers of its arm, for ``envs.weeding.timing``.
        lean_share: share of a plant's way from the machine's middle that the arm would lean, on average.
        work_s: (M,), seconds on a plant.
        energy_j: (M,).
        chance: (species, stage, M), expected probability of a kill.
        label: (species, stage), mode that a kind of weed calls for.
        harm: probability (..., M) that a crop plant at distances (...) from a weed dies with it.
        process: what it does to plants.
        perception: statistics of the cameras that look for it.
    """

    arm: Any
    lean_share: float
    work_s: Array
    energy_j: Array
    chance: Array
    label: NDArray[np.int64]
    harm: Callable[[Array], Array]
    process: WeedingProcess
    perception: PerceptionModel


@singledispatch
def outlook(config: Any) -> Outlook:
    """The outlook of the tool that a configuration describes; each tool registers its own.

    Raises:
        TypeError: no tool is known by such a configuration.
    """
    raise TypeError(f"config = {type(config).__name__}: no outlook is registered for it")


@outlook.register
def _laser(config: WeedingConfig) -> Outlook:
    numbers, process = config.process, LaserProcess(config.process)

    def harm(gap_m: Array) -> Array:
        width = numbers.spot_radius_m**2 + numbers.crop_heart_m**2
        arrives = process.energy_j * exp(-2.0 * gap_m * gap_m / width)[..., None]
        return numbers.response.crop_chance(arrives)

    return Outlook(
        arm=LaserArm.of(config.aim, config.cart.early_s, Ridges.of(config.scenario)),
        lean_share=config.reach.lean_m / config.reach.front_m,
        work_s=process.work_s.sum(axis=1),
        energy_j=process.energy_j,
        chance=numbers.response.chances(),
        label=numbers.response.labels(),
        harm=harm,
        process=process,
        perception=PerceptionModel.measured(config.eyes, config.pictures),
    )


@outlook.register
def _hoe(config: HoeWeedingConfig) -> Outlook:
    numbers, process = config.process, HoeProcess(config.passing)
    # The loss falls to zero within the hoe's reach: half a millimetre between the gaps of the table is fine enough.
    gaps = np.arange(0.0, process.work.reach_m + 1e-3, 5e-4)
    losses = crop_loss(numbers, gaps)

    def harm(gap_m: Array) -> Array:
        return np.stack([np.interp(gap_m, gaps, losses[:, mode]) for mode in range(losses.shape[1])], axis=-1)

    return Outlook(
        arm=HoeArm.of(config.reach, config.cart.early_s, Ridges.of(config.scenario)),
        lean_share=0.0,
        work_s=process.work_s.sum(axis=1),
        energy_j=process.energy_j,
        chance=numbers.response.chances(),
        label=numbers.response.labels(),
        harm=harm,
        process=process,
        perception=uncorrected(PerceptionModel.measured(config.eyes, config.pictures)),
    )
