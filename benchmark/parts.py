"""What the benchmark's suites are made of: which scenarios, seen by what, how often, by whom."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from ..agents.policies.weights import LEARNED
from ..envs.task import TaskSpec, tasks
from ..kernels.seeds import HELD_OUT, SHOWN, TUNED, Block

QUICK_EPISODES = 8
QUICK_TOUR_EPISODES = 2
"""The first environment is compared, the others are shown: together they take two minutes on two cores."""
FULL_EPISODES = 200
FULL_PYBULLET_EPISODES = 24
FULL_BOUNDS, FULL_PYBULLET_BOUNDS, FULL_ORDERING_BOUNDS = 40, 12, 20
"""So many of the fields are bounded: a bound may take seconds, and gaps' intervals are narrow long before all are."""


class Part(NamedTuple):
    """A case of a suite, before it is known what its task has; ``bounds`` of the first seeds are bounded."""

    scenario: str
    backend: str
    perception: str
    block: Block
    episodes: int
    policies: tuple[str, ...]
    bounds: int = 0
    changes: Mapping[str, Any] = MappingProxyType({})


def few(spec: TaskSpec, scenario: str, everybody: tuple[str, ...]) -> tuple[str, ...]:
    """Of everybody the reference, who is recommended for a scenario, and who has learned."""
    return tuple(name for name in everybody if name in (spec.reference, spec.recommended(scenario), LEARNED))


def _quick(spec: TaskSpec, everybody: tuple[str, ...]) -> list[Part]:
    first = spec == tasks()[0]
    sees = spec.assembly.default_perception("pybullet") if first else "model"
    episodes = QUICK_EPISODES if first else QUICK_TOUR_EPISODES
    return [Part(spec.headline, "pybullet", sees, TUNED, episodes, everybody)]


def _full(spec: TaskSpec, everybody: tuple[str, ...]) -> list[Part]:
    headline, reference = spec.headline, (spec.reference,)
    rules = tuple(name for name in everybody if name != LEARNED)
    driven = few(spec, headline, everybody)
    parts = [
        Part(headline, "analytic", "model", HELD_OUT, FULL_EPISODES, everybody, FULL_BOUNDS),
        Part(headline, "pybullet", "model", HELD_OUT, FULL_PYBULLET_EPISODES, driven, FULL_PYBULLET_BOUNDS),
    ]
    if "camera" in spec.perceptions:
        parts += [
            Part(headline, "analytic", "camera", HELD_OUT, fields, reference, changes=changes)
            for changes, fields in spec.sights
        ]
    if len(spec.sights) > 1:
        parts.append(Part(headline, "analytic", "perfect", HELD_OUT, FULL_EPISODES, reference))
    for scenario in spec.ordering:
        parts.append(Part(scenario, "analytic", "model", HELD_OUT, FULL_EPISODES, everybody, FULL_ORDERING_BOUNDS))
    for scenario, sees in spec.demands.items():
        parts.append(Part(scenario, "analytic", sees, HELD_OUT, FULL_EPISODES, rules))
    return parts


def _tiers(spec: TaskSpec, everybody: tuple[str, ...]) -> list[Part]:
    return [
        Part(scenario, "analytic", "model", SHOWN, FULL_EPISODES, everybody, FULL_EPISODES)
        for scenario in spec.scenarios
    ]


PARTS = {"quick": _quick, "full": _full, "tiers": _tiers}
