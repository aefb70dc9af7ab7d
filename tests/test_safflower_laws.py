"""The picker's process and its times against the formulas that they are written as."""

import math
from itertools import product

import numpy as np
import pytest

from fieldgym.envs.safflower.config import EFFORTS, ProcessConfig, SafflowerConfig
from fieldgym.envs.safflower.process import Shears, collected_share, cut_share, dropped_share
from fieldgym.envs.safflower.timing import (
    DRIVE,
    EMPTY,
    FINISH,
    NOTHING,
    STILL_M,
    P,
    Rates,
    beside_s,
    cart_s,
    legs_s,
    level_s,
    levels_s,
    settling_s,
    standing_s,
    tool_s,
)
from fieldgym.kernels.config import override
from fieldgym.motion import QUINTIC

PROCESS, CONFIG = ProcessConfig(), SafflowerConfig()
SHEARS, RATES = Shears.of(PROCESS), Rates.of(CONFIG)
PICKER = CONFIG.machine.picker
STROKES_M = np.array([0.0, 1e-6, 0.01, 0.05, 0.1, 0.2, 0.287, 0.3, 0.36, 0.5, 1.0, 3.0])


def odds_of(share: float) -> float:
    return share / (1.0 - share)


def test_the_cut_is_the_written_formula_on_a_grid():
    errors = (-0.0239, -0.012, -0.003, 0.0, 0.0005, 0.008, 0.016, 0.0241)
    for strokes, along, across, up, luck in product((1, 2, 3, 7), errors, errors, errors[1:6], (0.2, 1.0, 4.0)):
        share = cut_share(SHEARS, float(strokes), along, across, up, luck)
        radial = math.hypot(along, across)
        if radial > PROCESS.capture_radius_m:
            assert share == 0.0
            continue
        each = PROCESS.stroke_cut * math.exp(-0.5 * (radial / 0.012) ** 2 - 0.5 * (up / 0.010) ** 2)
        plain = 1.0 - (1.0 - each) ** strokes
        assert odds_of(share) == pytest.approx(luck * odds_of(plain), rel=1e-9)


def test_the_collection_is_the_written_formula_on_a_grid():
    for seconds, luck in product((0.0, 0.5, 1.0, 3.0, 10.0), (0.1, 1.0, 5.0)):
        slow = override(PROCESS, {"suction_decay_s": 2.5, "suction_loss": 0.6})
        assert dropped_share(slow, seconds) == pytest.approx(0.6 * math.exp(-seconds / 2.5), rel=1e-12)
        lost = 0.35 * math.exp(-seconds / 1.0)
        assert dropped_share(PROCESS, seconds) == pytest.approx(lost, rel=1e-12)
        kept = collected_share(lost, luck)
        assert odds_of(kept) == pytest.approx(luck * odds_of(1.0 - lost), rel=1e-9)


def test_shares_of_nothing_and_of_everything_stay_what_they_are():
    assert cut_share(SHEARS, 0.0, 0.0, 0.0, 0.0, 3.0) == 0.0
    assert cut_share(SHEARS, 3.0, PROCESS.capture_radius_m * 1.001, 0.0, 0.0, 1.0) == 0.0
    assert cut_share(SHEARS, 3.0, PROCESS.capture_radius_m * 0.999, 0.0, 0.0, 1.0) > 0.0
    assert collected_share(0.0, 0.1) == 1.0 and collected_share(1.0, 9.0) == 0.0


def test_motions_take_what_the_motion_law_says_to_the_last_bit():
    for sign in (-1.0, 1.0):
        cart = [cart_s(RATES, stroke) for stroke in sign * STROKES_M]
        tool = [tool_s(RATES, stroke) for stroke in sign * STROKES_M]
        assert cart == QUINTIC.duration(STROKES_M, PICKER.cart_velocity_m_s, PICKER.cart_acceleration_m_s2).tolist()
        assert tool == QUINTIC.duration(STROKES_M, PICKER.tool_velocity_m_s, PICKER.tool_acceleration_m_s2).tolist()
    assert beside_s(RATES, 0.3, -0.1) == max(cart_s(RATES, 0.3), tool_s(RATES, 0.1)) == cart_s(RATES, 0.3)
    assert beside_s(RATES, 0.01, -0.3) == tool_s(RATES, 0.3)


def test_levels_and_settling():
    clear = CONFIG.machine.clear_level_m
    assert level_s(RATES, clear - 0.2) == tool_s(RATES, clear - (clear - 0.2)) > 0.0
    assert level_s(RATES, clear) == level_s(RATES, clear + 0.1) == 0.0
    heights = clear - STROKES_M
    assert levels_s(RATES, heights).tolist() == [level_s(RATES, height) for height in heights]
    assert settling_s(RATES, 2.0 * STILL_M) == settling_s(RATES, -1.0) == 0.5
    assert settling_s(RATES, 0.5 * STILL_M) == 0.0


@pytest.mark.parametrize("slack", [0.0, 0.024])
@pytest.mark.parametrize("settle", [False, True])
def test_legs_are_all_pairs(slack, settle):
    rng = np.random.default_rng(1)
    begin, end = rng.uniform(-0.4, 0.4, (5, 3)), rng.uniform(-0.4, 0.4, (4, 2))
    end[0] = begin[0, :2]
    times = legs_s(RATES, begin, end, slack, settle)
    for i, j in product(range(5), range(4)):
        along, across = (max(abs(end[j, axis] - begin[i, axis]) - slack, 0.0) for axis in (0, 1))
        assert times[i, j] == beside_s(RATES, along, across) + (settling_s(RATES, along) if settle else 0.0)
    assert times[0, 0] == 0.0


def test_standing_times_are_the_process_s():
    config = override(CONFIG, {"process.strokes": (1, 4, 9), "process.suction_s": (0.5, 2.5, 7.0)})
    table = standing_s(config)
    assert table.shape == (len(EFFORTS) + 4, len(P)) and len(EFFORTS) == DRIVE
    assert table[:DRIVE, P.recognise].tolist() == [7.304] * 3
    assert table[:DRIVE, P.shear] == pytest.approx(np.array([1, 4, 9]) * 0.04785 / 0.030)
    assert table[:DRIVE, P.suck].tolist() == [0.5, 2.5, 7.0]
    assert table[DRIVE].tolist() == [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert table[NOTHING, P.recognise] == 1.0 and not table[FINISH].any()
    assert table[EMPTY].tolist() == [0.0, 0.0, 0.0, 0.0, 0.0, config.scenario.bag.empty_s]
    assert not table[:, [P.drive, P.travel, P.settle]].any()
