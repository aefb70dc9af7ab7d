"""Blocks of many generators are, bit for bit, what NumPy's calls give, and leave the generators where these do."""

from typing import Any

import numpy as np
import pytest
from numba.core import config

from fieldgym.kernels import chance, compiled
from fieldgym.kernels.sfc import SEEDS, Sfc, begun
from fieldgym.kernels.ziggurat import exponentials, normals, uniforms

SIZES = 700, 200_000, 0, 30
"""Enough normal numbers for the ziggurat's edges and its tail, which one in some thousand comes from."""


@pytest.mark.parametrize("bits", [np.random.PCG64, np.random.PCG64DXSM, np.random.Philox])
def test_numbers_and_states_are_those_of_numpy(bits: Any) -> None:
    ours, theirs = ([np.random.Generator(bits(seed)) for seed in range(3)] for _ in range(2))
    blocks, known = ([np.empty((3, size)) for size in SIZES] for _ in range(2))
    for generators in (ours, theirs):
        generators[1].integers(9, dtype=np.uint32)  # half a number is kept for the next one
    chance.fill_blocks(ours, blocks)
    for row, generator in enumerate(theirs):
        for number, block in enumerate(known):
            (generator.standard_normal if number % 2 else generator.random)(out=block[row])
    assert [block.tobytes() for block in blocks] == [block.tobytes() for block in known]
    assert np.abs(blocks[1]).max() > 3.7, "no number of the tail"
    for one, other in zip(ours, theirs, strict=True):
        assert one.integers(9, size=3, dtype=np.uint32).tolist() == other.integers(9, size=3, dtype=np.uint32).tolist()
        assert one.random() == other.random()


def test_a_generator_in_two_rows_goes_on() -> None:
    one, other = np.random.default_rng(5), np.random.default_rng(5)
    blocks = [np.empty((2, 4)), np.empty((2, 3))]
    chance.fill_blocks([one, one], blocks)
    for row in range(2):
        assert blocks[0][row].tolist() == other.random(4).tolist()
        assert blocks[1][row].tolist() == other.standard_normal(3).tolist()


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="kernels run as Python")  # type: ignore[attr-defined]
def test_kernels_find_the_state_and_step_it_only_where_it_is_known() -> None:
    assert chance._places([np.random.default_rng(0)]) is not None, (
        "this NumPy keeps the state elsewhere: draws are slow"
    )
    assert chance._places([np.random.default_rng(0), np.random.Generator(np.random.Philox(0))]) is None


@compiled
def three_rows(seeds: Any, one: Any, two: Any, three: Any) -> Any:
    return uniforms(exponentials(normals(begun(seeds), one), two), three)


@np.errstate(over="ignore")
def test_the_quick_generator_is_numpys() -> None:
    seeds = np.random.default_rng(2).random(SEEDS)
    rows = [np.empty(size) for size in (SIZES[1] // 10, SIZES[1] // 10, 100)]
    state = three_rows(seeds, *rows)
    bits: Any = np.random.SFC64()
    words = [*(seeds * 2.0**53).astype(np.uint64), np.uint64(1)]
    bits.state = {**bits.state, "state": {"state": np.array(words, np.uint64)}}
    bits.random_raw(12)
    theirs = np.random.Generator(bits)
    known = theirs.standard_normal(len(rows[0])), theirs.standard_exponential(len(rows[1])), theirs.random(100)
    assert [row.tobytes() for row in rows] == [row.tobytes() for row in known]
    assert np.abs(rows[0]).max() > 3.7 and rows[1].max() > 7.8, "no number of the tails"
    assert list(state) == bits.state["state"]["state"].tolist() and isinstance(state, Sfc)
