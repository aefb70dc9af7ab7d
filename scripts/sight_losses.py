"""What cameras lose, counted and put right: the part of ``sight_budget`` that is the same for every task.

A task's sights stand between an environment's cameras and its rules. They put everything that there is to see into one
category, and hand the rules what the cameras report, with the things of some categories reported as they are.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from fieldgym.agents import make_policy
from fieldgym.agents.rollout import decisions

Rights = frozenset[str]
"""Categories that are reported as they are."""
RIGHT = "reported right"


class Sights(ABC):
    """Between one environment's cameras and its rules.

    Attributes:
        categories: of what is lost, in the order of the table.
        given: those of them that no detector can get: the picture does not show it.
        counts: how many things were put into each.
        right: categories that are put right.
        field: number of the field that is played.
    """

    categories: tuple[str, ...]
    given: tuple[str, ...] = ()

    def __init__(self, env: Any):
        """Stand between them; nothing is put right yet."""
        self.env, self.core = env, env.core
        self.counts: Counter[str] = Counter()
        self.right: Rights = frozenset()
        self.field = 0
        self._receive: Callable[..., None] = env.core.receive
        env.core.receive = self.receive

    @abstractmethod
    def receive(self, row: int, *reports: Any) -> None:
        """Take what the cameras report, put right what is to be, and hand it to the rules by ``self._receive``."""


class Played(NamedTuple):
    """Of every field (n,): net rate in percent, and return."""

    net: NDArray[np.float64]
    gain: NDArray[np.float64]


def played(env: Any, policy: str, seeds: Sequence[int], sights: Sights | None = None) -> Played:
    """Let a policy play fields."""
    net, gain = np.zeros(len(seeds)), np.zeros(len(seeds))
    chosen = make_policy(policy, env, seed=1)
    for i, seed in enumerate(seeds):
        if sights is not None:
            sights.field = i
        observation, _ = env.reset(seed=seed)
        for decision in decisions(env, chosen, observation):
            gain[i] += decision.reward
            if decision.last:
                net[i] = 100.0 * decision.info["scorecard"]["net_rate"]
    return Played(net, gain)


class Row(NamedTuple):
    """A line of the table: what is put right, how many there were, and what is played then."""

    name: str
    things: int | None
    played: Played


def budget(env_id: str, scenario: str, policy: str, seeds: Sequence[int], kind: Callable[[Any], Sights]) -> list[Row]:
    """Play as it is, with each category put right alone, with all that a detector could get, and with perfect eyes."""
    env: Any = gym.make(env_id, scenario=scenario, backend="analytic", perception="camera")
    sights = kind(env.unwrapped)
    base = played(env, policy, seeds, sights)
    counts = Counter(sights.counts)
    rows = [Row("as it is", sum(counts[name] for name in (RIGHT, *sights.categories)), base)]
    rows.append(Row(RIGHT, counts[RIGHT], base))
    for name in sights.categories:
        if counts[name]:
            sights.right = frozenset({name})
            rows.append(Row(name, counts[name], played(env, policy, seeds, sights)))
    sights.right = frozenset(sights.categories) - frozenset(sights.given)
    if sights.given:
        rows.append(Row("all that pictures show", None, played(env, policy, seeds, sights)))
    env.close()
    perfect: Any = gym.make(env_id, scenario=scenario, backend="analytic", perception="perfect")
    rows.append(Row("everything: perfect perception", None, played(perfect, policy, seeds)))
    perfect.close()
    return rows


def shown(rows: Sequence[Row]) -> str:
    """The budget as a table in Markdown; +- is one standard error of the difference, paired by field."""
    base, every = rows[0].played, rows[0].things
    lines = ["| if only this were right | things | net rate, % | won, points | return won |", "|---|---|---|---|---|"]
    for name, count, (net, gain) in rows:
        number = "" if count is None else str(count) if not every else f"{count} ({100.0 * count / every:.1f} %)"
        if net is base.net:
            own = ("" if name == RIGHT else f"{net.mean():.2f}", "", "")
        else:
            own = (f"{net.mean():.2f}", _difference(net - base.net, 2), _difference(gain - base.gain, 3))
        lines.append(f"| {name} | {number} | {' | '.join(own)} |")
    return "\n".join(lines)


def _difference(won: NDArray[np.float64], digits: int) -> str:
    error = won.std(ddof=1) / np.sqrt(len(won)) if len(won) > 1 else 0.0
    return f"{won.mean():+.{digits}f} +- {error:.{digits}f}"


def interval(won: NDArray[np.float64]) -> tuple[float, float, float]:
    """Mean of differences (n,), and its 95 % interval over resampled fields."""
    rng = np.random.default_rng(0)
    means = won[rng.integers(0, len(won), (4000, len(won)))].mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(won.mean()), float(low), float(high)
