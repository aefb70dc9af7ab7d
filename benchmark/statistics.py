"""Means, interquartile means and paired differences with bootstrap intervals, the same on every run."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

CONFIDENCE = 0.95
RESAMPLES = 4999
BOOTSTRAP_SEED = 20220117
"""Fixed, so that a table made twice from the same episodes is the same table."""


_ENDS = (0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE))

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
    """A paired difference, policy minus reference; ``n`` counts pairs.

    Attributes:
        p: of the paired t test that there is none; NaN below two pairs.
        together: the same among all comparisons that it stands with, see ``compared``; NaN where it stands alone.
    """

    p: float = np.nan
    together: float = np.nan

    @property
    def significant(self) -> bool:
        """Whether enough pairs were seen and the interval leaves out 0."""
        return self.n >= FEWEST_PAIRS and (self.low > 0.0 or self.high < 0.0)

    @property
    def stands(self) -> bool:
        """Whether it is significant among all comparisons that it stands with, too."""
        return self.significant and not self.together > 1.0 - CONFIDENCE


ROUNDING = 1e-9
"""Means that differ by less are the same: policies that take the same decisions, added up in another order."""
Key = TypeVar("Key", bound=Hashable)


def front(spots: Mapping[Key, tuple[float, float]]) -> frozenset[Key]:
    """Who is on the Pareto front of two means that are better the larger they are; NaN is nowhere."""
    finite = {key: spot for key, spot in spots.items() if np.isfinite(spot).all()}

    def beats(other: tuple[float, float], spot: tuple[float, float]) -> bool:
        more = [one - two for one, two in zip(other, spot, strict=True)]
        return min(more) >= -ROUNDING and max(more) > ROUNDING

    return frozenset(key for key, spot in finite.items() if not any(beats(other, spot) for other in finite.values()))


def compared(differences: Mapping[Key, Difference]) -> dict[Key, Difference]:
    """The same differences with their p values ``together``: Holm's, so that all false claims together are few.

    With them the chance that any of the differences is called one and is none is 5 % at most, however the tests depend
    on each other (Holm 1979, A simple sequentially rejective multiple test procedure). Those without a p value are no
    comparisons.
    """
    told = sorted((key for key, item in differences.items() if item.p >= 0.0), key=lambda key: differences[key].p)
    found, largest = dict(differences), 0.0
    for i, key in enumerate(told):
        largest = max(largest, min((len(told) - i) * differences[key].p, 1.0))
        found[key] = replace(differences[key], together=largest)
    return found


def mean(values: ArrayLike) -> Estimate:
    """Mean of the finite ``values`` (n,) with its 95 % interval."""
    finite = _finite(values)
    return Estimate(*_bootstrap(finite, _mean, np.float64), len(finite))


def interquartile_mean(values: ArrayLike) -> Estimate:
    """Mean of the middle half of the finite ``values`` (n,): robust to a few lucky or hopeless episodes.

    Agarwal et al. 2021, Deep reinforcement learning at the edge of the statistical precipice.
    """
    finite = _finite(values)
    return Estimate(*_bootstrap(finite, _middle_mean, np.int32), len(finite))


def paired_difference(values: ArrayLike, reference: ArrayLike) -> Difference:
    """Mean of ``values - reference`` (n,), pair by pair, with its 95 % interval; pairs with a NaN are left out.

    Raises:
        ValueError: the two have different shapes.
    """
    first, second = np.asarray(values, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    if first.shape != second.shape:
        raise ValueError(f"values {first.shape} and reference {second.shape} must be paired, one of each per seed")
    finite = _finite(first - second)
    return Difference(*_bootstrap(finite, _mean, np.float64), len(finite), _no_difference(finite))


def paired_wins(values: ArrayLike, reference: ArrayLike) -> Estimate:
    """Share of the pairs of (n,) and (n,) in which the first is larger, ties counted half, with its 95 % interval.

    The probability of improvement (Agarwal et al. 2021) of episodes that share their field and their luck.

    Raises:
        ValueError: the two have different shapes.
    """
    first, second = np.asarray(values, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    if first.shape != second.shape:
        raise ValueError(f"values {first.shape} and reference {second.shape} must be paired, one of each per seed")
    return mean(0.5 + 0.5 * np.sign(_finite(first - second)))


def paired_share(values: ArrayLike, reference: ArrayLike) -> Estimate:
    """Mean of ``values`` (n,) as a share of the mean of ``reference`` (n,), resampled in pairs (percentiles).

    Raises:
        ValueError: the two have different shapes, or the reference's mean is not positive.
    """
    first, second = np.asarray(values, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    if first.shape != second.shape:
        raise ValueError(f"values {first.shape} and reference {second.shape} must be paired, one of each per seed")
    pairs = np.stack([first.ravel(), second.ravel()])
    pairs = pairs[:, np.isfinite(pairs).all(axis=0)]
    n = pairs.shape[1]
    if n and not pairs[1].mean() > 0.0:
        raise ValueError(f"the reference's mean is {pairs[1].mean():g}: a share needs a positive one")
    if n < 2:
        return Estimate(float(pairs[0, 0] / pairs[1, 0]) if n else np.nan, np.nan, np.nan, n)
    sums = _resamples(n, np.float64) @ pairs.T
    low, high = np.quantile(sums[:, 0] / sums[:, 1], _ENDS)
    return Estimate(float(pairs[0].mean() / pairs[1].mean()), float(low), float(high), n)


def profile(groups: Sequence[ArrayLike], levels: ArrayLike) -> Array:
    """A performance profile over several tasks: share of the episodes that reach each of ``levels`` (L,).

    Every group, the scores (n,) of one task, counts the same and is resampled by itself (stratified, percentiles).
    Agarwal et al. 2021 call it a score distribution.

    Returns:
        Share, and the ends of its interval (3, L).
    """
    reached = [_finite(group)[:, None] >= np.asarray(levels, dtype=np.float64) for group in groups]
    found = _stratified([part.astype(np.float64) for part in reached])
    low, high = np.quantile(found, _ENDS, axis=0)
    return np.stack([np.mean([part.mean(axis=0) for part in reached], axis=0), low, high])


def mean_of_means(groups: Sequence[ArrayLike]) -> Estimate:
    """Mean over tasks of their means, each task's episodes (n,) resampled by themselves (stratified, percentiles)."""
    parts = [_finite(group)[:, None] for group in groups]
    low, high = np.quantile(_stratified(parts), _ENDS)
    return Estimate(float(np.mean([part.mean() for part in parts])), float(low), float(high), sum(map(len, parts)))


def _stratified(parts: Sequence[Array]) -> Array:
    """Resampled means (R, L) over groups of their means over values (n, L)."""
    means = []
    for i, part in enumerate(parts):
        # Groups of one size share their resamples: turned on, those of one group say nothing of another's.
        counts = np.roll(_resamples(len(part), np.float64), i * RESAMPLES // max(len(parts), 1), axis=0)
        means.append(counts @ part / len(part))
    return np.asarray(np.mean(means, axis=0))


def _no_difference(values: Array) -> float:
    """Of the t test that differences (n,) have the mean 0; where they are all alike, of the sign test."""
    from scipy.special import stdtr

    n = len(values)
    if n < 2:
        return np.nan
    spread = float(values.std(ddof=1))
    if spread == 0.0 or np.ptp(values) == 0.0:
        return 1.0 if values[0] == 0.0 else 0.5 ** (n - 1)
    return float(2.0 * stdtr(n - 1, -abs(values.mean()) * n**0.5 / spread))


def _finite(values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=np.float64).ravel()
    return array[np.isfinite(array)]


Counts = NDArray[Any]


def _mean(counts: Counts, values: Array) -> Array:
    """Means (R,) of ``values`` (n,), each taken as often as ``counts`` (R, n) says; all rows have the same sum."""
    return np.asarray(counts @ values / counts[0].sum())


def _middle_mean(counts: Counts, values: Array) -> Array:
    """Means (R,) of the middle half of ``values`` (n,), each taken as often as ``counts`` (R, n) says."""
    order = np.argsort(values)
    counts = counts.take(order, axis=1)
    size = int(counts[0].sum())
    cut = size // 4
    ends = np.cumsum(counts, axis=1, dtype=np.int32)
    begins = np.maximum(ends - counts, cut)
    inside = np.maximum(np.minimum(ends, size - cut) - begins, 0)
    return np.asarray(inside.astype(np.float64) @ values[order] / (size - 2 * cut))


@lru_cache(maxsize=4)
def _resamples(n: int, kind: type) -> Counts:
    """How often each of n values is taken, (RESAMPLES, n): the same for every statistic, so each is drawn once."""
    taken = np.random.default_rng(BOOTSTRAP_SEED).integers(0, n, (RESAMPLES, n))
    places = (taken + n * np.arange(RESAMPLES)[:, None]).ravel()
    return np.bincount(places, minlength=n * RESAMPLES).reshape(RESAMPLES, n).astype(kind)


def _bootstrap(values: Array, statistic: Callable[[Counts, Array], Array], kind: type) -> tuple[float, float, float]:
    """The statistic with the ends of its interval: bias-corrected and accelerated, the percentiles where that fails.

    Efron and Tibshirani 1993, An introduction to the bootstrap, chapter 14. ``kind`` is the type of the counts that
    ``statistic`` reckons with fastest.
    """
    from scipy.special import ndtr, ndtri

    n = len(values)
    if n == 0:
        return np.nan, np.nan, np.nan
    value = float(statistic(np.ones((1, n), kind), values)[0])
    if n == 1:
        return value, np.nan, np.nan
    if np.ptp(values) == 0.0:
        return value, value, value
    found = statistic(_resamples(n, kind), values)
    ends = np.array(_ENDS)
    below = 0.5 * (np.mean(found < value) + np.mean(found <= value))
    without = statistic(1 - np.eye(n, dtype=kind), values)
    influence = without.mean() - without
    spread = float(np.sum(influence**2))
    if 0.0 < below < 1.0 and spread > 0.0:
        acceleration = float(np.sum(influence**3)) / (6.0 * spread**1.5)
        shift = ndtri(below)
        turned = shift + ndtri(ends)
        corrected = ndtr(shift + turned / (1.0 - acceleration * turned))
        if np.isfinite(corrected).all():
            ends = corrected
    low, high = np.quantile(found, ends)
    return value, float(low), float(high)
