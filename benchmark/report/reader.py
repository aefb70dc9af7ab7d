"""A results folder as the page needs it; fields that an older benchmark did not write are simply not shown."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...agents import policy_names, reference_policy
from ...envs import ENV_IDS, describe
from ...envs.registry import TaskDescription
from ..episode import Record
from ..statistics import Difference, Estimate, mean, paired_difference
from ..store import EPISODES, MANIFEST, ResultsError, condition, read
from ..suites import Case, Condition
from ..tables import Row, summarise
from .timeline import Timeline, parse

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """Mean net rate against time.

    Attributes:
        time_s: (n,).
        rate: (n,) mean over the episodes; one that has ended keeps its last value.
        low: (n,) tenth percentile.
        high: (n,) ninetieth percentile.
        episodes: how many.
    """

    time_s: Array
    rate: Array
    low: Array
    high: Array
    episodes: int


@dataclass(frozen=True)
class Gap:
    """How far from what no policy can beat.

    Attributes:
        net_rate: bound minus policy, with interval, paired by seed.
        episode_return: the same of the return.
    """

    net_rate: Difference
    episode_return: Difference


@dataclass(frozen=True)
class BoundSummary:
    """Mean of the bounds of a tier's instances.

    Attributes:
        net_rate: largest net rate.
        cycle_time_s: shortest cycle time at that net rate.
        episode_return: largest return.
        methods: how they were found, in words.
        proven: share of the instances whose bound is the optimum.
    """

    net_rate: Estimate
    cycle_time_s: Estimate
    episode_return: Estimate
    methods: tuple[str, ...]
    proven: float


@dataclass(frozen=True)
class Tier:
    """All policies under one condition.

    Attributes:
        condition: what held.
        rows: as ``tables.summarise`` gives them.
        seeds: of the episodes.
        values: net rate of every finished episode by policy, for the profile.
        curves: by policy.
        timelines: one episode a policy, of the same seed where there is one.
        bound: of the instances, None without.
        gaps: to the bound, by policy.
    """

    condition: Condition
    rows: tuple[Row, ...]
    seeds: tuple[int, ...]
    values: Mapping[str, Array]
    curves: Mapping[str, Curve]
    timelines: Mapping[str, Timeline]
    bound: BoundSummary | None
    gaps: Mapping[str, Gap]

    @property
    def reference(self) -> str:
        """The paper's own order."""
        return self.rows[0].reference

    @property
    def policies(self) -> tuple[str, ...]:
        """In the order of the rows."""
        return tuple(row.policy for row in self.rows)

    @property
    def episodes(self) -> int:
        """Episodes of the policy that has most."""
        return max(row.episodes for row in self.rows)


@dataclass(frozen=True)
class Transfer:
    """One policy on both backends, same scenario and seeds: PyBullet minus analytic.

    Attributes:
        policy: its name.
        analytic: condition of the first.
        pybullet: condition of the second.
        means: (analytic, PyBullet) of each score on the shared seeds.
        differences: of each score.
    """

    policy: str
    analytic: Condition
    pybullet: Condition
    means: Mapping[str, tuple[float, float]]
    differences: Mapping[str, Difference]


@dataclass(frozen=True)
class Chapter:
    """One environment.

    Attributes:
        task: what it is.
        headline: the tier that the page is about.
        others: every other tier.
        transfer: the headline scenario on both backends.
    """

    task: TaskDescription
    headline: Tier
    others: tuple[Tier, ...]
    transfer: tuple[Transfer, ...]


@dataclass(frozen=True)
class Study:
    """A whole folder.

    Attributes:
        manifest: who made the results, with what.
        chapters: in the order of the registry.
    """

    manifest: Mapping[str, Any]
    chapters: tuple[Chapter, ...]


TRANSFERRED = ("net_rate", "cycle_time_s", "return")


def load(folder: Path) -> Study:
    """Read ``folder``.

    Raises:
        ResultsError: there are no results in it; the message says what to do.
    """
    path = folder / EPISODES
    try:
        records = [record for record in read(path) if "error" not in record]
    except OSError:
        raise ResultsError(
            f"no results in {folder}: name a folder with {EPISODES} in it, or make one with fieldgym benchmark"
        ) from None
    records = [record for record in records if record["env_id"] in ENV_IDS]
    if not records:
        raise ResultsError(f"{path} holds no finished episode: go on with fieldgym benchmark --resume")
    groups: dict[Condition, list[Record]] = {}
    for record in records:
        groups.setdefault(condition(record), []).append(record)
    cases = [_case(group, members) for group, members in groups.items()]
    rows: dict[Condition, list[Row]] = {}
    for row in summarise(records, cases):
        rows.setdefault(row.condition, []).append(row)
    chapters = []
    for env_id in ENV_IDS:
        tiers = {group: groups[group] for group in groups if group.env_id == env_id}
        if tiers:
            chapters.append(_chapter(describe(env_id), tiers, rows))
    return Study(_manifest(folder), tuple(chapters))


def _manifest(folder: Path) -> Mapping[str, Any]:
    try:
        found = json.loads((folder / MANIFEST).read_text())
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _case(group: Condition, members: Sequence[Record]) -> Case:
    known = policy_names(group.env_id)
    there = {record["policy"] for record in members}
    policies = [name for name in known if name in there] + sorted(there.difference(known))
    seeds = tuple(sorted({int(record["seed"]) for record in members}))
    return Case(group, tuple(policies), reference_policy(group.env_id), seeds)


def _chapter(
    task: TaskDescription, tiers: Mapping[Condition, list[Record]], rows: Mapping[Condition, list[Row]]
) -> Chapter:
    """The headline is the headline scenario where most episodes were run, PyBullet first when they are as many."""

    def rank(group: Condition) -> tuple[bool, int, bool]:
        seeds = len({record["seed"] for record in tiers[group]})
        return group.scenario == task.headline_scenario, seeds, group.backend == "pybullet"

    first = max(tiers, key=rank)
    order = sorted(
        (group for group in tiers if group != first),
        key=lambda group: (
            group.scenario != first.scenario,
            task.scenarios.index(group.scenario) if group.scenario in task.scenarios else len(task.scenarios),
            str(group),
        ),
    )
    return Chapter(
        task=task,
        headline=_tier(first, tiers[first], rows[first]),
        others=tuple(_tier(group, tiers[group], rows[group]) for group in order),
        transfer=_transfer(first.scenario, tiers, rows[first]),
    )


def _tier(group: Condition, members: Sequence[Record], rows: Sequence[Row]) -> Tier:
    by_policy: dict[str, list[Record]] = {row.policy: [] for row in rows}
    for record in members:
        by_policy[record["policy"]].append(record)
    bounds = {int(record["seed"]): record["bound"] for record in members if isinstance(record.get("bound"), Mapping)}
    curves = {name: curve for name, own in by_policy.items() if (curve := _curve(own)) is not None}
    return Tier(
        condition=group,
        rows=tuple(rows),
        seeds=tuple(sorted({int(record["seed"]) for record in members})),
        values={name: _finite([record["scorecard"].get("net_rate") for record in own]) for name, own in by_policy.items()},
        curves=curves,
        timelines=_timelines(by_policy),
        bound=_bound_summary(bounds),
        gaps={name: _gap(own, bounds) for name, own in by_policy.items()} if bounds else {},
    )


def _finite(values: Iterable[Any]) -> Array:
    array = np.array([np.nan if value is None else float(value) for value in values], dtype=np.float64)
    return array[np.isfinite(array)]


def _curve(members: Sequence[Record], points: int = 97) -> Curve | None:
    """Mean over the episodes that have a curve, on one grid of time."""
    told = [(float(record["scorecard"]["duration_s"]), record["curve"]) for record in members if record.get("curve")]
    if not told:
        return None
    time_s = np.linspace(0.0, max(duration for duration, _ in told), points)
    rates = np.stack(
        [np.interp(time_s, np.linspace(0.0, duration, len(curve)), np.array(curve)) for duration, curve in told]
    )
    low, high = np.percentile(rates, (10.0, 90.0), axis=0)
    return Curve(time_s, rates.mean(axis=0), low, high, len(told))


def _timelines(by_policy: Mapping[str, Sequence[Record]]) -> dict[str, Timeline]:
    """Of every policy the timeline of the seed that most policies have one of."""
    found = {
        name: {
            int(record["seed"]): timeline
            for record in members
            if (timeline := parse(name, int(record["seed"]), record.get("timeline"))) is not None
        }
        for name, members in by_policy.items()
    }
    seeds = sorted({seed for own in found.values() for seed in own})
    if not seeds:
        return {}
    best = max(seeds, key=lambda seed: (sum(seed in own for own in found.values()), -seed))
    return {name: own.get(best, next(iter(own.values()))) for name, own in found.items() if own}


def _bound_summary(bounds: Mapping[int, Mapping[str, Any]]) -> BoundSummary | None:
    if not bounds:
        return None
    values = list(bounds.values())
    return BoundSummary(
        net_rate=mean([_number(item.get("net_rate")) for item in values]),
        cycle_time_s=mean([_number(item.get("cycle_time_s")) for item in values]),
        episode_return=mean([_number(item.get("episode_return")) for item in values]),
        methods=tuple(dict.fromkeys(str(item["method"]) for item in values if item.get("method"))),
        proven=float(np.mean([bool(item.get("proven")) for item in values])),
    )


def _gap(members: Sequence[Record], bounds: Mapping[int, Mapping[str, Any]]) -> Gap:
    shared = [record for record in members if int(record["seed"]) in bounds]

    def difference(own: Sequence[Any], name: str) -> Difference:
        best = [_number(bounds[int(record["seed"])].get(name)) for record in shared]
        return paired_difference(best, [_number(value) for value in own])

    return Gap(
        net_rate=difference([record["scorecard"].get("net_rate") for record in shared], "net_rate"),
        episode_return=difference([record["return"] for record in shared], "episode_return"),
    )


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


def _transfer(scenario: str, tiers: Mapping[Condition, list[Record]], rows: Sequence[Row]) -> tuple[Transfer, ...]:
    """Every policy that ran on both backends; equal perception where there is one, else as each backend sees."""
    here = [group for group in tiers if group.scenario == scenario]
    pairs = [
        (first, second)
        for first in here
        for second in here
        if first.backend == "analytic" and second.backend == "pybullet"
    ]
    if not pairs:
        return ()
    first, second = max(pairs, key=lambda pair: (pair[0].perception == pair[1].perception, len(tiers[pair[1]])))
    found = []
    for row in rows:
        own, other = (
            {int(record["seed"]): record for record in tiers[group] if record["policy"] == row.policy}
            for group in (first, second)
        )
        seeds = sorted(own.keys() & other.keys())
        if not seeds:
            continue
        columns = {
            name: tuple([_score(side[seed], name) for seed in seeds] for side in (own, other)) for name in TRANSFERRED
        }
        found.append(
            Transfer(
                policy=row.policy,
                analytic=first,
                pybullet=second,
                means={name: (mean(a).value, mean(b).value) for name, (a, b) in columns.items()},
                differences={name: paired_difference(b, a) for name, (a, b) in columns.items()},
            )
        )
    return tuple(found)


def _score(record: Record, name: str) -> float:
    if name == "return":
        return _number(record["return"])
    if name == "cycle_time_s" and record["scorecard"].get("done") == 0.0:
        return math.nan  # without a finished target there is no cycle
    return _number(record["scorecard"].get(name))
