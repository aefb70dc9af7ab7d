"""A specification survives JSON with every keyword, and a keyword that others keep for themselves has a second name."""

import json
from dataclasses import fields
from typing import Any

import gymnasium as gym
import pytest
from gymnasium.envs.registration import EnvSpec

from fieldgym import env_ids, task
from fieldgym.envs.assembly import KEYWORDS

pytestmark = pytest.mark.portable
OWN = tuple(env_id for env_id in env_ids() if env_id.startswith("fieldgym/"))
VALUES: dict[str, Any] = {
    "backend": "analytic",
    "engine": "analytic",
    "perception": "perfect",
    "render_mode": "rgb_array",
    "observation": "pixels",
    "pixel_rows": 40,
    "depth": True,
    "slots": 5,
    "motion": "blended",
    "eyes": "classical",
    "pictures": "easy",
    "camera": "overview",
    "width": 320,
    "height": 200,
}
"""Keywords of which every task takes the same value."""


def value_of(env_id: str, keyword: str) -> Any:
    """Another value than the one that is taken without the keyword."""
    spec = task(env_id)
    changes = {f"weights.{fields(spec.assembly.config().weights)[0].name}": 0.125}
    config = spec.assembly.configured(spec.scenarios[-1], overrides=changes)
    choices = {
        "scenario": spec.scenarios[-1],
        "config": config,
        "overrides": changes,
        "source_tray": 72,
        "target_tray": 50,
    }
    return (choices | VALUES)[keyword]


CASES = [(env_id, keyword) for env_id in OWN for keyword in (*KEYWORDS, *task(env_id).assembly.settings)]


@pytest.mark.parametrize(("env_id", "keyword"), CASES)
def test_a_specification_goes_to_json_and_back_with_every_keyword(env_id: str, keyword: str) -> None:
    given = {"engine": "analytic", keyword: value_of(env_id, keyword)}
    if keyword in ("pixel_rows", "depth"):
        given["observation"] = "pixels"
    first: Any = gym.make(env_id, **given)
    assert first.spec is not None
    told = first.spec.to_json()
    assert keyword in json.loads(told)["kwargs"]
    second: Any = gym.make(EnvSpec.from_json(told))
    for name in ("scenario", "backend", "perception", "render_mode", "shot"):
        assert getattr(second.unwrapped, name) == getattr(first.unwrapped, name)
    assert second.unwrapped.core.config == first.unwrapped.core.config
    assert second.observation_space == first.observation_space
    plain: Any = gym.make(env_id, backend="analytic")
    if keyword in ("config", "overrides", "scenario", *task(env_id).assembly.settings):
        assert plain.unwrapped.core.config != first.unwrapped.core.config
    for env in (first, second, plain):
        env.close()


@pytest.mark.parametrize("make", [gym.make, gym.make_vec])
def test_engine_is_another_name_of_the_backend(make: Any) -> None:
    assert make("fieldgym/LaserWeeding-v0", engine="analytic", backend="analytic").unwrapped.backend == "analytic"
    with pytest.raises(ValueError, match=r"^backend = 'analytic' and engine = 'pybullet': two names of one keyword"):
        make("fieldgym/LaserWeeding-v0", engine="pybullet", backend="analytic")
    with pytest.raises(ValueError, match=r"^backend = 'magic' is unknown"):
        make("fieldgym/LaserWeeding-v0", engine="magic")


def test_a_limit_of_decisions_is_gymnasium_s_and_survives_too() -> None:
    env: Any = gym.make("fieldgym/LaserWeeding-v0", engine="analytic", max_episode_steps=3)
    again: Any = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.spec.max_episode_steps == 3
    again.reset(seed=0)
    assert [again.step(again.action_space.n - 1)[3] for _ in range(3)] == [False, False, True]


def test_an_unknown_keyword_is_told_as_python_tells_it() -> None:
    """TorchRL tries ``frameskip=1`` and leaves it out where it reads these words."""
    with pytest.raises(
        TypeError, match=r"^got an unexpected keyword argument 'frameskip': choose one of 'scenario', 'backend'"
    ):
        gym.make("fieldgym/LaserWeeding-v0", engine="analytic", frameskip=1)
