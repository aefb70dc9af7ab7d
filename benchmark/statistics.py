"""Means, interquartile means and paired differences with bootstrap intervals, the same on every run."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

CONFIDENCE = 0.95
RESAMPLES = 4999
BOOTSTRAP_SEED = 20220117
"""Fixed, so that a table made twice from the same episodes is the same table."""


FEWEST_PAIRS = 6
"""Below this even pairs that all point the same way could be chance: 2 * 0.5**5 > 0.05."""


@dataclass(frozen=True)
class Estimate:
    """A statistic of n episodes with its bootstrap interval.

    Attributes:
        value: the statistic; NaN without episodes.
        low: lower end of the 95 % interval; NaN below two episodes.
        high: upper end.
        n: episodes that it rests on.
    """

    value: float
    low: float
    high: float
    n: int


@dataclass(frozen=True)
class Difference(Estimate):
    """A paired difference, policy minus reference; ``n`` counts pairs."""

    @property
    def significant(self) -> bool:
        """Whether enough pairs were seen and the interval leaves out 0."""
        return self.n >= FEWEST_PAIRS and (self.low > 0.0 or self.high < 0.0)


def mean(values: ArrayLike) -> Estimate:
    """Mean of the finite ``values`` (n,) with its 95 % interval."""
    finite = _finite(values)
    return Estimate(*_bootstrap(finite, np.mean), len(finite))


def interquartile_mean(values: ArrayLike) -> Estimate:
    """Mean of the middle half of the finite ``values`` (n,): robust to a few lucky or hopeless episodes.

    Agarwal et al. 2021, Deep reinforcement learning at the edge of the statistical precipice.
    """
    finite = _finite(values)
    return Estimate(*_bootstrap(finite, _middle_mean), len(finite))


def paired_difference(values: ArrayLike, reference: ArrayLike) -> Difference:
    """Mean of ``values - reference`` (n,), pair by pair, with its 95 % interval; pairs with a NaN are left out.

    Raises:
        ValueError: the two have different shapes.
    """
    first, second = np.asarray(values, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    if first.shape != second.shape:
        raise ValueError(f"values {first.shape} and reference {second.shape} must be paired, one of each per seed")
    finite = _finite(first - second)
    return Difference(*_bootstrap(finite, np.mean), len(finite))


def _finite(values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=np.float64).ravel()
    return array[np.isfinite(array)]


def _middle_mean(values: Array, axis: int = -1) -> Any:
    from scipy.stats import trim_mean

    return trim_mean(values, 0.25, axis=axis)


def _bootstrap(values: Array, statistic: Callable[..., Any]) -> tuple[float, float, float]:
    """The statistic with the ends of its interval: bias-corrected and accelerated, the percentiles where that fails."""
    from scipy.stats import bootstrap

    if len(values) == 0:
        return np.nan, np.nan, np.nan
    value = float(statistic(values, axis=-1))
    if len(values) == 1:
        return value, np.nan, np.nan
    if np.ptp(values) == 0.0:
        return value, value, value
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a degenerate jackknife is what the second method is for
        for method in ("BCa", "percentile"):
            interval = bootstrap(
                (values,),
                statistic,
                n_resamples=RESAMPLES,
                confidence_level=CONFIDENCE,
                method=method,
                vectorized=True,
                rng=np.random.default_rng(BOOTSTRAP_SEED),
            ).confidence_interval
            if np.isfinite(interval.low) and np.isfinite(interval.high):
                return value, float(interval.low), float(interval.high)
    return value, np.nan, np.nan
