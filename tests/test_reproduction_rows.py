"""Rows of the five-bars' chapters, computed once more in another way."""

import numpy as np
import pytest
from scipy.optimize import fsolve

from fieldgym.mechanisms import FiveBar
from fieldgym.papers import Verdict, safflower, safflower_formulas, safflower_forward, transplanting
from fieldgym.papers.safflower_picking import period_s

UNEVEN = FiveBar.from_lengths(*safflower_formulas.LENGTHS)


@pytest.fixture(scope="module")
def motion() -> safflower_formulas.Motion:
    return safflower_formulas.moving(UNEVEN)


def test_a_wrong_form_is_refuted_whatever_its_correction(motion):
    row = safflower_formulas.compared("a", "b", motion.t + 1e-4, motion.t)
    assert row.verdict is Verdict.REFUTED
    assert safflower_formulas.compared("a", "b", motion.t + 1e-8, motion.t).verdict is Verdict.REPRODUCED
    both = safflower_formulas.compared("a", "b", motion.t + 1.0, motion.t, motion.t + 0.5, "half")
    assert both.verdict is Verdict.REFUTED and "with half" in both.why


def test_the_machine_of_the_rows_is_the_papers():
    """Each equation that is called right, solved for one pose by a root finder that knows none of the others."""
    l1, l2, l3, l4, l5, l6, l7 = safflower_formulas.LENGTHS
    tool = np.array([0.27, -0.36])
    q1, q4 = UNEVEN.inverse(tool)

    def closure(unknown):
        q2, q3 = unknown
        return [
            l1 * np.cos(q1) + l2 * np.cos(q2) + 2 * l3 - l5 * np.cos(q3) - l6 * np.cos(q4) - l7,
            l1 * np.sin(q1) + l2 * np.sin(q2) - l5 * np.sin(q3) - l6 * np.sin(q4),
        ]

    q2, q3 = np.asarray(fsolve(closure, [-0.6, -2.5], xtol=1e-14))
    d = [l7 + l6 * np.cos(q4) + l5 * np.cos(q3), l6 * np.sin(q4) + l5 * np.sin(q3)]
    np.testing.assert_allclose(d, tool + np.array([l3, l4]), atol=1e-12)
    np.testing.assert_allclose(
        [l1 * np.cos(q1) + l2 * np.cos(q2), l1 * np.sin(q1) + l2 * np.sin(q2)], tool + np.array([-l3, l4]), atol=1e-12
    )
    # Eq. 27 with its root over W + X - Y, q1 measured from the other side.
    w = l1**2 + 4 * l3**2 + l5**2 + l6**2 + l7**2 - l2**2 - 4 * l3 * l7
    p = np.pi - q1
    x = 2 * ((l6 * l7 - 2 * l3 * l6) * np.cos(q4) + (l1 * l7 - 2 * l1 * l3) * np.cos(p))
    x += 2 * l1 * l6 * np.cos(p + q4)
    y = 2 * (l5 * l7 - 2 * l3 * l5 + l1 * l5 * np.cos(p) + l5 * l6 * np.cos(q4))
    z = 2 * (l5 * l6 * np.sin(q4) - l1 * l5 * np.sin(p))
    roots = 2 * np.arctan((-z + np.array([1.0, -1.0]) * np.sqrt(z**2 - (w + x - y) * (w + x + y))) / (w + x - y))
    assert np.abs(np.exp(1j * roots) - np.exp(1j * q3)).min() < 1e-9


def test_the_erring_tool_is_where_eq_31_puts_it(motion):
    l1, l2, l3, l4, l5, l6, l7 = safflower_formulas.LENGTHS
    q1, q4 = motion.q[0, [0, 3]] + safflower_forward.DRIVE_ERROR_RAD

    def circles(t):
        return [
            (-l1 * np.cos(q1) + t[0] - l3) ** 2 + (t[1] + l4 - l1 * np.sin(q1)) ** 2 - l2**2,
            (l6 * np.cos(q4) + l7 - t[0] - l3) ** 2 + (t[1] + l4 - l6 * np.sin(q4)) ** 2 - l5**2,
        ]

    found = np.asarray(fsolve(circles, motion.t[0], xtol=1e-14))
    np.testing.assert_allclose(UNEVEN.forward([q1, q4]), found, atol=1e-12)
    by_item = {row.item: row for row in safflower_forward.drive_errors(UNEVEN, motion)}
    assert by_item["Eq. 32, erring tool"].verdict is Verdict.REPRODUCED_WITH_CORRECTION
    assert by_item["Eq. 33, error"].verdict is Verdict.REPRODUCED


def test_on_the_edge_one_leg_is_in_line_and_the_other_is_not():
    """Eq. 30: the product of the two factors vanishes, the chain of equal signs does not."""
    factors = safflower._boundary_factors(FiveBar.safflower())
    assert factors.shape[1] > 50
    assert np.all(factors.min(axis=0) < 1e-5) and np.median(factors.max(axis=0)) > 0.1
    # A touch inside the edge neither is.
    bar = FiveBar.safflower()
    inside = bar.chains(np.array([0.5 * bar.base_m, -0.40]))
    assert np.abs(np.sin(inside.q_passive - inside.q)).min() > 0.1


def test_the_time_to_find_a_head_is_the_whole_of_the_calibration():
    """Every head waits for it once, so that it stands in the period as it is: 16 s follow from it, not it from 16 s."""
    without, half, whole = (period_s(locate_s, fields=16) for locate_s in (0.0, 3.652, 7.304))
    assert whole - without == pytest.approx(7.304, abs=0.05)
    assert half - without == pytest.approx(3.652, abs=0.05)
    assert 8.0 < without < 9.5


def test_two_readings_save_the_same_seven_hundredths():
    """0.07 s: the gate path, and out and back over 600 mm; one stroke saves half."""

    def saved(*strokes):
        return sum(
            np.sqrt(constant * s / 60.0) * sign
            for s in strokes
            for constant, sign in ((84.0 * np.sqrt(5.0) / 25.0, 1.0), (10.0 / np.sqrt(3.0), -1.0))
        )

    assert saved(0.15, 0.6, 0.15) == pytest.approx(saved(0.6, 0.6), abs=1e-15)
    assert saved(0.6, 0.6) == pytest.approx(0.0676, abs=5e-5)
    row = next(row for row in transplanting._laws() if "time saved" in row.item)
    assert row.corrected == pytest.approx(saved(0.6, 0.6), abs=1e-9)
    assert row.computed == pytest.approx(0.5 * saved(0.6, 0.6), abs=1e-9)


def test_the_rate_has_all_its_readings_in_one_row():
    across = max(np.sqrt(10.0 / np.sqrt(3.0) * 0.6 / 60.0), 1.875 * 0.6 / 4.5)
    once = across + 2.0 * np.sqrt(10.0 / np.sqrt(3.0) * 0.15 / 60.0)
    row = transplanting._rate()
    assert row.verdict is Verdict.NOT_DETERMINABLE
    low, high = (float(word) for word in re_numbers(row.computed))
    assert low == pytest.approx(30.0 / once, abs=1e-3) and high == pytest.approx(60.0 / once, abs=1e-3)
    expected = {
        "minimum time, stop at corners": 73.5,
        "circular corners, r = 50 mm": 84.0,
        "circular corners, r = 100 mm": 95.0,
        "circular corners, r = 125 mm": 100.5,
        "circular corners, r = 150 mm": 105.0,
        "free path after 0 mm straight": 130.0,
        "free path after 30 mm straight": 110.0,
        "free path after 50 mm straight": 102.0,
    }
    rates = dict(transplanting._ways())
    for way, rate in expected.items():
        assert rates[way] == pytest.approx(rate, rel=0.01)
        assert f"{way} {rates[way]:.1f}" in row.why


def re_numbers(text) -> list[str]:
    return [word for word in str(text).split() if word.replace(".", "").isdigit()]
