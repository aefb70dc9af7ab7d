"""An info block that makes its entries when somebody looks is a dictionary all the same."""

import copy
import json
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import DictInfoToList, RecordEpisodeStatistics

from fieldgym.envs.named import NamedColumns

pytestmark = pytest.mark.portable

VALUES = np.arange(6.0).reshape(3, 2)
PRESENT = np.array([True, False, True])
PLAIN = {"a": [0.0, 0.0, 4.0], "_a": PRESENT.tolist(), "b": [1.0, 0.0, 5.0], "_b": PRESENT.tolist()}


def lists(block):
    return {name: values.tolist() for name, values in block.items()}


@pytest.fixture
def block():
    return NamedColumns(("a", "b"), VALUES.copy(), PRESENT.copy())


LOOKS = {
    "items": lambda block: dict(block.items()),
    "dict": dict,
    "stars": lambda block: {**block},
    "or": lambda block: block | {},
    "ror": lambda block: {} | block,
    "copy": lambda block: block.copy(),
    "copy.copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda block: pickle.loads(pickle.dumps(block)),
    "iteration": lambda block: {name: block[name] for name in block},
    "keys": lambda block: dict(zip(block.keys(), block.values(), strict=True)),
    "reversed": lambda block: {name: block[name] for name in reversed(list(reversed(block)))},
    "get": lambda block: {name: block.get(name) for name in PLAIN},
    "update": lambda block: (plain := {}, plain.update(block))[0],
}


@pytest.mark.parametrize("look", LOOKS)
def test_every_look_finds_every_entry(block, look):
    assert lists(LOOKS[look](block)) == PLAIN


def test_looks_that_ask_for_no_entry(block):
    assert len(block) == 4 and bool(block) and "a" in block and "c" not in block


@pytest.mark.parametrize("name", ["__getitem__", "pop", "setdefault", "get"])
def test_the_first_look_fills(name):
    block = NamedColumns(("a",), np.ones((1, 1)), np.ones(1, bool))
    assert getattr(block, name)("a").tolist() == [1.0]


def test_the_first_look_may_be_a_comparison_or_a_print():
    assert NamedColumns(("a",), np.ones((1, 1)), np.ones(1, bool)) != {}
    assert "array([1.])" in repr(NamedColumns(("a",), np.ones((1, 1)), np.ones(1, bool)))


def test_what_is_written_before_a_look_stays(block):
    block["a"] = "mine"
    assert block["a"] == "mine" and block["b"].tolist() == [1.0, 0.0, 5.0]


def test_json_sees_it(block):
    assert json.loads(json.dumps(block, default=lambda values: values.tolist())) == PLAIN


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_later_steps_and_resets_do_not_show_through(mode):
    envs = [
        gym.make_vec(
            "fieldgym/SafflowerPicking-v0",
            3,
            vectorization_mode="vector_entry_point",
            autoreset_mode=mode,
            overrides={"scenario.time_limit_s": 40.0},
        )
        for _ in range(2)
    ]
    waiting, read = [], []
    for env, infos in zip(envs, (waiting, read), strict=True):
        observation, info = env.reset(seed=1)
        for step in range(20):
            infos.append(info if env is envs[0] else copy.deepcopy(info))
            if step % 7 == 6:
                observation, info = env.reset(options={"reset_mask": np.array([True, False, True])})
            else:
                observation, *_, info = env.step(observation["action_mask"].argmax(axis=1))
    for late, soon in zip(waiting, read, strict=True):
        # The last observations are no blocks, and NumPy does not compare arrays of dictionaries.
        for info in (late, soon):
            info.pop("final_obs", None)
        np.testing.assert_equal(copy.deepcopy(late), soon)


def test_wrappers_of_gymnasium_take_it():
    env = gym.make_vec("fieldgym/SafflowerPicking-v0", 3, vectorization_mode="vector_entry_point")
    wrapped = DictInfoToList(RecordEpisodeStatistics(env))
    observation, _ = wrapped.reset(seed=1)
    *_, infos = wrapped.step(observation["action_mask"].argmax(axis=1))
    assert len(infos) == 3 and infos[1]["scorecard"]["duration_s"] > 0.0
