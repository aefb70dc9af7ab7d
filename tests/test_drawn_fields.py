"""What is drawn from a generator stays what it was: fields of every scenario, by digests that were taken down once."""

import hashlib
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.envs import env_ids, task

SEEDS = 3, 8
TAKEN_DOWN: dict[str, dict[str, str]] = {
    "fieldgym/SafflowerPicking-v0": {
        "pots": "24b35e81445134d8",
        "row-sparse": "ea0ea4ffaab28ffb",
        "row": "592def2b5671e7ea",
        "row-dense": "145b10bdaec36380",
    },
    "fieldgym/TrayTransplanting-v0": {
        "fill-low": "7dde9944654b5331",
        "fill": "323053e3f3b0c524",
        "fill-high": "be38b161ac5cf699",
        "replug-low": "59dc1c74557255ca",
        "replug": "625a7ecbfa2c6f9e",
        "replug-high": "047b3caad9a7c8fb",
    },
    "fieldgym/LaserWeeding-v0": {
        "load-0.7": "48de638badc06469",
        "load-1.0": "48de638badc06469",
        "load-1.25": "48de638badc06469",
        "load-1.6": "48de638badc06469",
        "load-1.0-even": "7904dadf22e418ec",
        "load-1.6-even": "7904dadf22e418ec",
        "dense": "26dc2bb72f6a220d",
    },
    "fieldgym/HoeWeeding-v0": {
        "load-0.7": "2c5c3c74c53be284",
        "load-1.0": "2c5c3c74c53be284",
        "load-1.25": "2c5c3c74c53be284",
        "load-1.6": "2c5c3c74c53be284",
        "load-1.0-even": "03bbc6b4af6cebe9",
        "load-1.6-even": "03bbc6b4af6cebe9",
        "dense": "165b66f5e8b61eba",
    },
    "fieldgym/ProduceSorting-v0": {
        "load-0.7": "facec3c43824011a",
        "load-1.0": "e27b4769409aaee0",
        "load-1.25": "4fa21524ee1d7702",
        "load-1.6": "167e3958d875ce3e",
        "clumped-1.25": "eda3168e1da7a2f0",
    },
}
"""Digests of two fields of every scenario; the speed variant's are the laser's."""


def core_of(env_id: str, scenario: str, worlds: int = 1) -> Any:
    seen: dict[str, Any] = {"eyes": "classical", "pictures": "easy"} if "Weeding" in env_id else {}
    env: Any = gym.make_vec(env_id, worlds, vectorization_mode="vector_entry_point", scenario=scenario, **seen)
    return env.unwrapped.core


def digest(fields: list[Any]) -> str:
    """Of all that fields hold, to the ninth decimal: another C library may round the last digit in another way."""
    sha = hashlib.sha256()
    for field in fields:
        for kind, table in field.tables():
            for name, values in table.arrays().items():
                rounded = np.round(values, 9) + 0.0 if values.dtype == np.float64 else values
                sha.update(f"{kind}.{name}:{len(values)};".encode() + rounded.tobytes())
    return sha.hexdigest()[:16]


@pytest.mark.parametrize("env_id", TAKEN_DOWN)
def test_fields_are_those_that_were_taken_down(env_id: str) -> None:
    assert task(env_id).headline in TAKEN_DOWN[env_id]
    for scenario, known in TAKEN_DOWN[env_id].items():
        core = core_of(env_id, scenario)
        assert digest([core.draw_field(np.random.default_rng(seed)) for seed in SEEDS]) == known, scenario


@pytest.mark.parametrize("env_id", env_ids())
def test_a_field_does_not_depend_on_those_drawn_beside_it(env_id: str) -> None:
    core = core_of(env_id, task(env_id).headline)
    generators = [np.random.default_rng(seed) for seed in range(5)]
    fields = core.unstack(core.draw(generators))
    for seed, field in enumerate(fields):
        alone = np.random.default_rng(seed)
        assert core.draw_field(alone) == field
        assert alone.random() == generators[seed].random(), "another number of numbers was drawn"
