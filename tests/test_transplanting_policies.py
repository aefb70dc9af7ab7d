"""The transplanter's scripted rules, and the planning that they are made of."""

from itertools import permutations

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.agents import make_policy, policy_names
from fieldgym.agents.policies.transplanting import best_order, mended, sequence_s
from fieldgym.envs.transplanting.config import SCENARIOS

ID = "fieldgym/TrayTransplanting-v0"


@pytest.mark.parametrize("name", policy_names(ID))
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_policies_finish_without_an_illegal_action(name, scenario):
    env = gym.make_vec(ID, num_envs=2, scenario=scenario, autoreset_mode="Disabled")
    policy = make_policy(name, env, seed=1)
    observation, info = env.reset(seed=0)
    over = np.zeros(2, bool)
    for _ in range(600):
        observation, _, terminated, truncated, info = env.step(policy.act(observation))
        over |= terminated | truncated
        if over.all():
            break
    assert over.all()
    assert (info["scorecard"]["illegal"] == 0).all()
    if name != "random":
        assert (info["scorecard"]["net_rate"] > 0.9).all()


def cycle_tables(rng: np.random.Generator, sources: int, gaps: int) -> tuple[np.ndarray, np.ndarray]:
    return rng.random((sources, gaps)), rng.random((gaps, sources, gaps))


def test_best_order_is_the_best_of_all_orders():
    rng = np.random.default_rng(4)
    for _ in range(10):
        first, following = cycle_tables(rng, 5, 5)
        pairs = list(zip(rng.permutation(5).tolist(), range(5), strict=True))
        found = best_order(first, following, pairs)
        assert sorted(found) == sorted(pairs)
        best = min(sequence_s(first, following, list(order)) for order in permutations(pairs))
        assert sequence_s(first, following, found) == pytest.approx(best)


def test_mended_sequences_are_no_longer_and_use_each_cell_once():
    rng = np.random.default_rng(5)
    for _ in range(10):
        first, following = cycle_tables(rng, 6, 4)
        begin = [(i, i) for i in range(4)]
        found = mended(first, following, begin)
        assert sequence_s(first, following, found) < sequence_s(first, following, begin)
        for side, size in ((0, 6), (1, 4)):
            used = [pair[side] for pair in found]
            assert len(set(used)) == 4 and max(used) < size
