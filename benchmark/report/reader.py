"""Results as the page needs them; fields that an older benchmark did not write are simply not shown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...agents import policy_names, reference_policy
from ...envs import tasks
from ...envs.task import TaskSpec
from ..limits import CURVE_SHARES, limits
from ..record import Record, condition, field_of
from ..statistics import Difference, compared, mean, paired_difference
from ..suites import BOUND, Case, Condition
from ..summary import Row, summarise
from .episodes import Curve, Timeline, chosen_timelines, mean_curve
from .folders import Source, sources, task_of

Array = NDArray[np.float64]
Seeded = Mapping[Any, float]
"""A score of every episode by its field (a file's name, else the seed); NaN where there is none."""

COMPARED = ("net_rate", "cycle_time_s", "return")
"""Scores that are compared between backends and between perceptions."""


@dataclass(frozen=True)
class BoundWords:
    """How a tier's bounds were found.

    Attributes:
        frontier: (n, 2) net rate and the shortest cycle time at it, at equal shares of each instance's largest net
            rate, mean over the instances.
        methods: in words.
        proven: share of the instances whose bound is their optimum.
        wall_s: mean seconds that a bound took.
    """

    frontier: Array
    methods: tuple[str, ...]
    proven: float
    wall_s: float


@dataclass(frozen=True)
class Tier:
    """All policies under one condition.

    Attributes:
        condition: what held.
        rows: as ``summary.summarise`` gives them, the bound's left out.
        bound: the bound's row, None without.
        bound_words: how it was found, None without.
        seeds: of the episodes; names of files where fields were played.
        values: of ``COMPARED`` by policy, score and field.
        most: largest net rate that the bound leaves, by field; empty without bounds.
        curves: net rate against time, by policy.
        timelines: one episode a policy, all of the same seed.
    """

    condition: Condition
    rows: tuple[Row, ...]
    bound: Row | None
    bound_words: BoundWords | None
    seeds: tuple[int | str, ...]
    values: Mapping[str, Mapping[str, Seeded]]
    most: Seeded
    curves: Mapping[str, Curve]
    timelines: Mapping[str, Timeline]

    @property
    def reference(self) -> str:
        """The paper's own order."""
        return self.rows[0].reference

    @property
    def policies(self) -> tuple[str, ...]:
        """In the order of the rows."""
        return tuple(row.policy for row in self.rows)

    @property
    def all_rows(self) -> tuple[Row, ...]:
        """The policies' rows and, last, the bound's."""
        return self.rows if self.bound is None else (*self.rows, self.bound)

    def row(self, policy: str) -> Row | None:
        """The row of a policy; None when it did not run."""
        return next((row for row in self.rows if row.policy == policy), None)


@dataclass(frozen=True)
class Move:
    """One policy under two conditions on the same fields: the second minus the first.

    Attributes:
        policy: its name.
        means: (first, second) of each score on the shared fields.
        differences: of each score.
    """

    policy: str
    means: Mapping[str, tuple[float, float]]
    differences: Mapping[str, Difference]


@dataclass(frozen=True)
class Comparison:
    """Every policy that was run under both of two conditions.

    Attributes:
        first: what is compared with.
        second: what is compared.
        moves: a policy each.
    """

    first: Condition
    second: Condition
    moves: tuple[Move, ...]

    @property
    def pairs(self) -> int:
        """Shared fields, of the policy that has most."""
        return max(move.differences["net_rate"].n for move in self.moves)


@dataclass(frozen=True)
class Chapter:
    """One environment.

    Attributes:
        task: what it is.
        headline: the tier that the page is about.
        others: every other tier.
        driven: the headline scenario from the analytic backend to PyBullet; None when it ran on one.
        seen: the headline scenario from the camera's model to the rendered camera on one backend; None likewise.
        sights: the headline scenario from perfect perception to the rendered cameras, by what these see and what looks
            at it; empty without both.
    """

    task: TaskSpec
    headline: Tier
    others: tuple[Tier, ...]
    driven: Comparison | None
    seen: Comparison | None
    sights: tuple[Comparison, ...] = ()


@dataclass(frozen=True)
class Study:
    """All results.

    Attributes:
        sources: where they are from.
        chapters: in the order of the registry.
    """

    sources: tuple[Source, ...]
    chapters: tuple[Chapter, ...]


def load(*folders: Path) -> Study:
    """Read results folders; a task that several of them hold is the last one's.

    Raises:
        ResultsError: there are no results in one of them; the message says what to do.
    """
    found = sources(folders)
    bounds = [record for source in found for record in source.bounds]
    groups: dict[Condition, list[Record]] = {}
    for record in (record for source in found for record in source.episodes):
        groups.setdefault(condition(record), []).append(record)
    cases = [_case(group, members) for group, members in groups.items()]
    rows: dict[Condition, list[Row]] = {}
    for row in summarise([record for members in groups.values() for record in members], cases, bounds):
        rows.setdefault(row.condition, []).append(row)
    tiers = {group: _tier(group, members, rows[group], bounds) for group, members in groups.items()}
    chapters = []
    for spec in tasks():
        own = [tier for group, tier in tiers.items() if task_of(groups[group][0]) == spec]
        if own:
            chapters.append(_chapter(spec, own))
    return Study(found, tuple(_seen_together(chapters)))


def _seen_together(chapters: Sequence[Chapter]) -> list[Chapter]:
    """The chapters with what cameras change told together: it stands in one table."""
    told = _together([() if item.seen is None else item.seen.moves for item in chapters])
    return [
        item if item.seen is None else replace(item, seen=replace(item.seen, moves=moves))
        for item, moves in zip(chapters, told, strict=True)
    ]


def _together(tables: Sequence[Sequence[Move]]) -> list[tuple[Move, ...]]:
    """Moves with their differences told together, those of all tables."""
    found = compared(
        {
            (i, move.policy, name): item
            for i, moves in enumerate(tables)
            for move in moves
            for name, item in move.differences.items()
        }
    )
    return [
        tuple(
            replace(move, differences={name: found[i, move.policy, name] for name in move.differences})
            for move in moves
        )
        for i, moves in enumerate(tables)
    ]


def _case(group: Condition, members: Sequence[Record]) -> Case:
    known = policy_names(group.env_id)
    there = {record["policy"] for record in members}
    policies = [name for name in known if name in there] + sorted(there.difference(known))
    return Case(group, tuple(policies), reference_policy(group.env_id), ())


def _chapter(task: TaskSpec, tiers: Sequence[Tier]) -> Chapter:
    """The headline is the headline scenario where most episodes were run, PyBullet first when they are as many."""

    def rank(tier: Tier) -> tuple[bool, int, bool]:
        where = tier.condition
        return where.scenario == task.headline, len(tier.seeds), where.backend == "pybullet"

    def place(tier: Tier) -> tuple[bool, int, str]:
        where = tier.condition
        at = task.scenarios.index(where.scenario) if where.scenario in task.scenarios else len(task.scenarios)
        return where.scenario != first.condition.scenario, at, str(where)

    first = max(tiers, key=rank)
    others = sorted((tier for tier in tiers if tier is not first), key=place)
    headlines = [tier for tier in tiers if tier.condition.scenario == first.condition.scenario]
    alike = [tier for tier in headlines if tier.condition.changes == first.condition.changes]
    driven = _comparison(
        first, [pair for pair in permutations(alike, 2) if _backends(*pair) == ("analytic", "pybullet")]
    )
    same = [pair for pair in permutations(alike, 2) if len(set(_backends(*pair))) == 1]
    eyes = [pair for pair in same if tuple(tier.condition.perception for tier in pair) == ("model", "camera")]
    return Chapter(task, first, tuple(others), driven, _comparison(first, eyes), _sights(first, headlines))


def _sights(first: Tier, tiers: Sequence[Tier]) -> tuple[Comparison, ...]:
    """From perfect perception to each rendered camera on the headline's backend, told together."""
    here = [tier for tier in tiers if tier.condition.backend == first.condition.backend]
    perfect = next((tier for tier in here if tier.condition.perception == "perfect"), None)
    cameras = [tier for tier in here if tier.condition.perception == "camera"]
    if perfect is None:
        return ()
    cameras.sort(key=lambda tier: tier.condition.changes)
    found = [each for tier in cameras if (each := _comparison(perfect, [(perfect, tier)])) is not None]
    return tuple(
        replace(each, moves=moves) for each, moves in zip(found, _together([each.moves for each in found]), strict=True)
    )


def _backends(first: Tier, second: Tier) -> tuple[str, str]:
    return first.condition.backend, second.condition.backend


def _tier(group: Condition, members: Sequence[Record], rows: Sequence[Row], bounds: Sequence[Record]) -> Tier:
    policies = [row for row in rows if row.policy != BOUND]
    by_policy: dict[str, list[Record]] = {row.policy: [] for row in policies}
    for record in members:
        by_policy[record["policy"]].append(record)
    values = {
        name: {score: {field_of(record): _score(record, score) for record in own} for score in COMPARED}
        for name, own in by_policy.items()
    }
    curves = {name: mean_curve(own) for name, own in by_policy.items()}
    return Tier(
        condition=group,
        rows=tuple(policies),
        bound=next((row for row in rows if row.policy == BOUND), None),
        bound_words=_bound_words([record for record in bounds if "error" not in record and condition(record) == group]),
        seeds=tuple(sorted({field_of(record) for record in members})),
        values=values,
        most={
            drawn: limit.net_rate
            for (where, drawn), limit in limits(bounds).items()
            if where == group and limit.net_rate is not None
        },
        curves={name: curve for name, curve in curves.items() if curve is not None},
        timelines=chosen_timelines(by_policy),
    )


def _score(record: Record, name: str) -> float:
    value = record["return"] if name == "return" else record["scorecard"].get(name)
    if value is None or (name == "cycle_time_s" and record["scorecard"].get("done") == 0.0):
        return math.nan  # without a finished target there is no cycle
    return float(value)


def _bound_words(records: Sequence[Record]) -> BoundWords | None:
    if not records:
        return None
    frontiers = [
        [(share * limit.net_rate, limit.cycle_time_s(share * limit.net_rate)) for share in CURVE_SHARES]
        for limit in limits(records).values()
        if limit.net_rate is not None
    ]
    told = [record["bound"] for record in records]
    hopes = [item["expected"] for item in told if "expected" in item]
    return BoundWords(
        frontier=np.mean(frontiers, axis=0) if frontiers else np.zeros((0, 2)),
        methods=(*_methods(told), *(f"on average: {words}" for words in _methods(hopes))),
        proven=float(np.mean([bool(item.get("proven")) for item in told])),
        wall_s=float(np.mean([float(record.get("wall_s", math.nan)) for record in records])),
    )


def _methods(told: Sequence[Mapping[str, Any]]) -> list[str]:
    return list(dict.fromkeys(str(item["method"]) for item in told if item.get("method")))


def _comparison(headline: Tier, pairs: Sequence[tuple[Tier, Tier]]) -> Comparison | None:
    """Of the pair that is most alike and, of these, has most fields."""
    if not pairs:
        return None
    first, second = max(
        pairs, key=lambda pair: (pair[0].condition.perception == pair[1].condition.perception, len(pair[1].seeds))
    )
    found = []
    for policy in headline.policies:
        if policy in first.values and policy in second.values:
            own, other = first.values[policy], second.values[policy]
            seeds = sorted(own["net_rate"].keys() & other["net_rate"].keys())
            columns = {name: [[side[name][seed] for seed in seeds] for side in (own, other)] for name in COMPARED}
            if seeds:
                means = {name: (mean(a).value, mean(b).value) for name, (a, b) in columns.items()}
                differences = {name: paired_difference(b, a) for name, (a, b) in columns.items()}
                found.append(Move(policy, means, differences))
    return Comparison(first.condition, second.condition, _together([found])[0]) if found else None
