"""Observations in which anything may stand, and what independent reckonings of rules share."""

from math import sqrt
from typing import Any

import numpy as np

WORLDS, K = 60, 6


def quintic_s(stroke: float, velocity: float, acceleration: float) -> float:
    """Shortest motion from rest to rest on a quintic law: peaks of 15/8 and 10/sqrt(3)."""
    return max(1.875 * abs(stroke) / velocity, sqrt(10.0 / sqrt(3.0) * abs(stroke) / acceleration))


def made_up(machine: Any, candidate: Any, seed: int, options: int, extras: int, kinds: tuple[tuple[str, ...], ...]):
    """Observations of worlds in which anything may stand, the last of them empty, and their candidates as dictionaries.

    Of each of the ``kinds``, tuples of columns, one is set.
    """
    rng, columns = np.random.default_rng(seed), candidate._fields
    table = rng.uniform(0.0, 1.5, (WORLDS, K, len(columns))).astype(np.float32)
    table[..., columns.index("present")] = rng.random((WORLDS, K)) < 0.8
    for names in kinds:
        chosen = rng.integers(len(names), size=(WORLDS, K))
        for place, name in enumerate(names):
            table[..., columns.index(name)] = chosen == place
    mask = (rng.random((WORLDS, K * options + extras)) < 0.6).astype(np.int8)
    there = table[..., columns.index("present")] > 0.0
    mask[:, : K * options] &= np.repeat(there, options, axis=1)
    mask[-1, : K * options] = 0
    mask[:, K * options :] = 1
    observation = {
        "machine": rng.uniform(0.0, 1.0, (WORLDS, len(machine._fields))).astype(np.float32),
        "candidates": (table * there[..., None]).reshape(WORLDS, -1),
        "action_mask": mask,
    }
    rows = [
        [dict(zip(columns, map(float, row), strict=True)) for row in world]
        for world in observation["candidates"].reshape(WORLDS, K, -1)
    ]
    return observation, rows


def machine_of(machine: Any, observation: Any, w: int) -> dict[str, float]:
    return dict(zip(machine._fields, map(float, observation["machine"][w]), strict=True))


def least(keys: dict[Any, float], otherwise: Any) -> Any:
    """The first of the smallest; ``otherwise`` where there is none."""
    return min(keys, key=lambda key: keys[key]) if keys else otherwise
