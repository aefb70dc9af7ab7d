"""The transplanter's scripted rules, and the planning that they are made of."""

from itertools import permutations

import numpy as np
import pytest

from fieldgym.agents.policies.transplanting import best_order, mended, sequence_s
from fieldgym.envs.transplanting.config import SCENARIOS
from fieldgym.testing import check_policies

ID = "fieldgym/TrayTransplanting-v0"


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_policies_finish_and_fill_nearly_every_cell(scenario):
    for name, scores in check_policies(ID, scenario).items():
        assert name == "random" or (scores.scorecard["net_rate"] > 0.9).all()


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
