"""From episodes to rows: what each policy scored under each condition, with intervals, differences and gaps."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..agents.policies.weights import LEARNED
from ..agents.sources import BY_ENDING
from ..envs.task import task
from .limits import Limit, limits
from .rates import derived
from .record import Record, condition, field_of
from .statistics import Difference, Estimate, compared, front, interquartile_mean, mean, paired_difference, paired_wins
from .suites import BOUND, Case, Condition

MAIN = ("net_rate", "cycle_time_s", "throughput_per_min", "damaged", "return")
"""Scores with an interquartile mean and a paired difference to the reference policy."""


RULE, PLANNER = "rule", "planner"
RIVALS = (RULE, PLANNER)
"""Kinds of scripted policies; every other policy is held against the best of each, beside the reference."""
HELD = ("net_rate", "cycle_time_s", "return")
"""Scores in which it is."""


Values = dict[str, float]


def is_learned(policy: str) -> bool:
    """Whether a policy's name is one of a learned one; these are compared with every rule."""
    return policy.startswith(LEARNED) or Path(policy).suffix in BY_ENDING


def kind_of(env_id: str, policy: str) -> str:
    """What a policy is: one of ``RIVALS``; empty for learned ones and those from a file or module."""
    if is_learned(policy) or ":" in policy:
        return ""
    try:
        return PLANNER if policy in task(env_id).planners else RULE
    except ValueError:  # of a task that is not installed here
        return RULE


@dataclass(frozen=True)
class Row:
    """One policy under one condition.

    Attributes:
        condition: what held.
        policy: its name; ``BOUND`` for the mean of what none can beat.
        reference: the policy of the differences.
        episodes: how many finished.
        scores: mean of every scorecard entry, of what is derived from it (see ``rates``), of ``return``,
            ``decision_ms`` (mean of an episode's decisions) and ``decision_p95_ms``, with intervals.
        iqm: interquartile mean of ``MAIN``.
        differences: of ``MAIN`` to the reference on the same seeds; empty for the reference and without it.
        gaps: to the bounds on the same seeds. Bound in expectation minus policy for ``net_rate`` and ``return``: its
            mean is not below 0, on some seeds it may be. With all luck known, none below 0: bound minus policy for
            ``clairvoyant_net_rate`` and ``clairvoyant_return``, policy minus bound at its own net rate for
            ``cycle_time_s``. Of ``BOUND`` itself the two ``clairvoyant_``. Empty where there is no bound.
        over_rules: of a learned policy: its return minus that of every other policy, on the same seeds.
        rivals: the best rule and the best planner by mean return, by ``RIVALS``; what there is none of is missing.
        over: of ``HELD`` to each of them on the same seeds, by ``RIVALS`` and score; a policy is not held against
            itself. These and ``differences`` are told together (``Difference.together``) with all of their condition.
        wins: share of the fields on which the return is larger than that of the ``reference``, the best ``rule``, the
            best ``planner``, ties counted half.
        front: no other policy has both as high a net rate and as short a cycle, by the means, and one of them better.
        charged: whether thinking was added to the clocks, see ``thinking``; such figures differ from run to run.
    """

    condition: Condition
    policy: str
    reference: str
    episodes: int
    scores: Mapping[str, Estimate]
    iqm: Mapping[str, Estimate] = field(default_factory=dict)
    differences: Mapping[str, Difference] = field(default_factory=dict)
    gaps: Mapping[str, Difference] = field(default_factory=dict)
    over_rules: Mapping[str, Difference] = field(default_factory=dict)
    rivals: Mapping[str, str] = field(default_factory=dict)
    over: Mapping[str, Mapping[str, Difference]] = field(default_factory=dict)
    wins: Mapping[str, Estimate] = field(default_factory=dict)
    front: bool = False
    charged: bool = False

    @property
    def least_over_rules(self) -> tuple[str, Difference, bool] | None:
        """The rule that a learned policy is least over, by how much, and whether it is better than every rule."""
        told = {rule: item for rule, item in self.over_rules.items() if math.isfinite(item.low)}
        if not told:
            return None
        hardest = min(told, key=lambda rule: told[rule].low)
        return hardest, told[hardest], all(item.significant and item.low > 0.0 for item in told.values())


def summarise(records: Iterable[Record], cases: Sequence[Case], bounds: Iterable[Record] = ()) -> list[Row]:
    """Rows for all ``records`` without an error, in the order of ``cases``; policies beyond them follow by name.

    Args:
        records: of episodes.
        cases: give the order and the reference policies.
        bounds: records of bounds; each condition that has some ends with a row of their means.
    """
    groups: dict[Condition, dict[str, dict[int | str, Values]]] = {}
    charged: set[Condition] = set()
    for record in records:
        if "error" not in record:
            policies = groups.setdefault(condition(record), {})
            policies.setdefault(record["policy"], {})[field_of(record)] = _values(record)
            if record.get("charged"):
                charged.add(condition(record))
    known: dict[Condition, dict[int | str, Limit]] = {}
    for (where, drawn), limit in limits(bounds).items():
        known.setdefault(where, {})[drawn] = limit
    order = {case.condition: case for case in cases}
    references = {case.condition.env_id: case.reference for case in cases}
    rows = []
    for group in sorted(groups, key=lambda item: (_place(item, list(order)), str(item))):
        wanted = list(order[group].policies) if group in order else []
        names = sorted(groups[group], key=lambda name: (_place(name, wanted), name))
        policies = {name: groups[group][name] for name in names}
        maker = _RowMaker(group, references.get(group.env_id, ""), policies, known.get(group, {}), group in charged)
        rows += _together([maker.row(policy) for policy in names])
        if group in known:
            rows.append(maker.bound())
    return rows


REFERENCE = "reference"
Pair = tuple[frozenset[str], str]
"""Two policies and a score."""


def comparisons(rows: Iterable[Row]) -> dict[Pair, Difference]:
    """All comparisons of the rows of one condition, to the reference and to the best of ``RIVALS``, each pair once."""
    found: dict[Pair, Difference] = {}
    for row in rows:
        for other, of in (
            (row.reference, row.differences),
            *((row.rivals[whose], of) for whose, of in row.over.items()),
        ):
            for name, item in of.items():
                found.setdefault((frozenset({row.policy, other}), name), item)
    return found


def _together(rows: Sequence[Row]) -> list[Row]:
    """The rows of one condition, each of their comparisons told among all of them, and those on the front."""
    found = compared(comparisons(rows))
    ahead = front({row.policy: (_mean(row, "net_rate"), -_mean(row, "cycle_time_s")) for row in rows})

    def told(policy: str, other: str, of: Mapping[str, Difference]) -> dict[str, Difference]:
        pair = frozenset({policy, other})
        return {name: replace(item, together=found[pair, name].together) for name, item in of.items()}

    return [
        replace(
            row,
            differences=told(row.policy, row.reference, row.differences),
            over={whose: told(row.policy, row.rivals[whose], of) for whose, of in row.over.items()},
            front=row.policy in ahead,
        )
        for row in rows
    ]


def _mean(row: Row, name: str) -> float:
    return row.scores[name].value if name in row.scores else math.nan


def _place(item: Any, order: Sequence[Any]) -> int:
    return order.index(item) if item in order else len(order)


def _values(record: Record) -> Values:
    """All numbers of an episode under one name each; None becomes NaN."""
    values = {name: np.nan if value is None else float(value) for name, value in record["scorecard"].items()}
    if values.get("done") == 0.0:
        values["cycle_time_s"] = np.nan  # without a finished target there is no cycle
    values["return"] = np.nan if record["return"] is None else float(record["return"])
    done = values.get("done", np.nan)
    for name in [name for name in values if name.startswith("phase_")]:
        values[name.removesuffix("_s") + "_s_each"] = values[name] / done if done > 0.0 else np.nan
    values["decision_ms"] = 1000.0 * record["decision_s"] / max(record["steps"], 1)
    values["decision_p95_ms"] = float(record.get("decision_p95_ms", np.nan))
    values["wall_s"] = float(record["wall_s"])
    return {**values, **derived(record)}


@dataclass(frozen=True)
class _RowMaker:
    """Everything that was measured under one condition: values by policy, field and name, and bounds by field."""

    group: Condition
    reference: str
    policies: Mapping[str, Mapping[Any, Values]]
    known: Mapping[Any, Limit]
    charged: bool

    def row(self, policy: str) -> Row:
        own = self.policies[policy]
        # In the order of the seeds, not of the workers: the bootstrap is the same for the same episodes.
        values = [own[seed] for seed in sorted(own)]
        names = list(dict.fromkeys(name for each in values for name in each))
        columns = {name: [each.get(name, np.nan) for each in values] for name in names}
        main = [name for name in MAIN if name in columns]
        compared = self.reference in self.policies and policy != self.reference
        rules = [name for name in self.policies if not is_learned(name)]
        return Row(
            condition=self.group,
            policy=policy,
            reference=self.reference,
            episodes=len(own),
            scores={name: mean(column) for name, column in columns.items()},
            iqm={name: interquartile_mean(columns[name]) for name in main},
            differences={name: self._difference(policy, self.reference, name) for name in main if compared},
            gaps=self._gaps(own),
            over_rules={name: self._difference(policy, name, "return") for name in rules} if is_learned(policy) else {},
            rivals=self.rivals,
            over={
                whose: {name: self._difference(policy, rival, name) for name in HELD if name in columns}
                for whose, rival in self.rivals.items()
                if rival != policy
            },
            wins={
                whose: paired_wins(*self._pairs(policy, rival, "return"))
                for whose, rival in {REFERENCE: self.reference, **self.rivals}.items()
                if rival != policy and rival in self.policies
            },
            charged=self.charged,
        )

    def bound(self) -> Row:
        """Means of the bounds in expectation, and how far those with all luck known are above them.

        Cycle times are bounded at a policy's own net rate only, so there is none here.
        """
        known = [self.known[seed] for seed in sorted(self.known)]
        hope = {
            "net_rate": [_or_nan(each.expected_net_rate) for each in known],
            "return": [_or_nan(each.expected_return) for each in known],
        }
        scores, gaps = (
            {name: mean(column) for name, column in hope.items()},
            _clairvoyant(known, hope["net_rate"], hope["return"]),
        )
        return Row(self.group, BOUND, self.reference, len(known), scores, gaps=gaps, charged=self.charged)

    @cached_property
    def rivals(self) -> dict[str, str]:
        """The best of every kind of scripted policies, the first of equals."""
        found: dict[str, str] = {}
        best: dict[str, float] = {}
        for name, own in self.policies.items():
            kind = kind_of(self.group.env_id, name)
            value = float(np.mean([own[seed]["return"] for seed in sorted(own)]))
            if kind and value > best.get(kind, -math.inf):
                found[kind], best[kind] = name, value
        return {kind: found[kind] for kind in RIVALS if kind in found}

    def _difference(self, policy: str, other: str, name: str) -> Difference:
        return paired_difference(*self._pairs(policy, other, name))

    def _pairs(self, policy: str, other: str, name: str) -> tuple[list[float], list[float]]:
        """A score of two policies on the fields that both played, in the order of the fields."""
        own, theirs = self.policies[policy], self.policies[other]
        shared = sorted(own.keys() & theirs.keys())
        return [own[seed].get(name, np.nan) for seed in shared], [theirs[seed].get(name, np.nan) for seed in shared]

    def _gaps(self, own: Mapping[Any, Values]) -> dict[str, Difference]:
        shared = [(own[seed], self.known[seed]) for seed in sorted(own.keys() & self.known.keys())]
        if not shared:
            return {}
        own_limits = [limit for _, limit in shared]
        net_rate = [values.get("net_rate", np.nan) for values, _ in shared]
        returns = [values["return"] for values, _ in shared]
        cycle_s = [values.get("cycle_time_s", np.nan) for values, _ in shared]
        shortest_s = [limit.cycle_time_s(rate) for rate, limit in zip(net_rate, own_limits, strict=True)]
        return {
            "net_rate": paired_difference([_or_nan(limit.expected_net_rate) for limit in own_limits], net_rate),
            "cycle_time_s": paired_difference(cycle_s, shortest_s),
            "return": paired_difference([_or_nan(limit.expected_return) for limit in own_limits], returns),
            **_clairvoyant(own_limits, net_rate, returns),
        }


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


def _clairvoyant(known: Sequence[Limit], net_rate: Sequence[float], returns: Sequence[float]) -> dict[str, Difference]:
    """How far the bounds with all luck known are above net rates and returns on the same fields."""
    return {
        "clairvoyant_net_rate": paired_difference([_or_nan(each.net_rate) for each in known], net_rate),
        "clairvoyant_return": paired_difference([_or_nan(each.episode_return) for each in known], returns),
    }
