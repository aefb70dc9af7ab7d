"""Motion laws and S-curves against finite differences, their limits, and Ruckig."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldgym.motion import MODIFIED_TRAPEZOID, QUINTIC, SEPTIC, SCurve

LAWS = [QUINTIC, SEPTIC, MODIFIED_TRAPEZOID]
by_name = pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)


def derivative(function, at, step):
    """Central difference of fourth order."""
    near = 8.0 * (function(at + step) - function(at - step))
    return (near - (function(at + 2.0 * step) - function(at - 2.0 * step))) / (12.0 * step)


@by_name
def test_each_field_is_the_derivative_of_the_one_before(law):
    # Off the eighths, where the modified trapezoid's jerk has kinks.
    time = np.linspace(0.01, 0.69, 97) + 1e-3
    stroke, duration = -0.37, 0.7
    state = law.sample(time, stroke, duration)
    for order in range(3):
        slope = derivative(lambda t, order=order: law.sample(t, stroke, duration)[order], time, 1e-4)
        scale = np.max(np.abs(state[order + 1]))
        np.testing.assert_allclose(state[order + 1], slope, rtol=0, atol=2e-6 * scale)


@by_name
def test_it_runs_from_rest_to_rest_and_holds_its_ends(law):
    state = law.sample([-1.0, 0.0, 0.4, 9.0], 0.5, 0.4)
    np.testing.assert_allclose(state.position, [0.0, 0.0, 0.5, 0.5], atol=1e-14)
    for field in state[1:]:
        np.testing.assert_array_equal(field, np.zeros(4))
    near = law.sample([1e-9, 0.4 - 1e-9], 0.5, 0.4)
    assert np.max(np.abs(near.velocity)) < 1e-6 and np.max(np.abs(near.acceleration)) < 1e-5


@by_name
def test_the_stated_peaks_are_the_peaks(law):
    state = law.sample(np.linspace(1e-9, 1.0 - 1e-9, 200_001), 1.0, 1.0)
    assert np.max(state.velocity) == pytest.approx(law.peak_velocity, rel=1e-8)
    assert np.max(np.abs(state.acceleration)) == pytest.approx(law.peak_acceleration, rel=1e-8)
    assert np.max(np.abs(state.jerk)) == pytest.approx(law.peak_jerk, rel=1e-6)


@by_name
def test_it_is_symmetric_in_time(law):
    time = np.linspace(0.0, 1.0, 101)
    there, back = law.sample(time, 1.0, 1.0), law.sample(1.0 - time, 1.0, 1.0)
    np.testing.assert_allclose(there.position, 1.0 - back.position, atol=1e-14)
    np.testing.assert_allclose(there.velocity, back.velocity, atol=1e-12)
    np.testing.assert_allclose(there.acceleration, -back.acceleration, atol=1e-11)


def test_the_paper_s_constants():
    assert QUINTIC.peak_acceleration == pytest.approx(5.7735, abs=5e-5)
    assert SEPTIC.peak_acceleration == pytest.approx(7.51, abs=5e-3)
    assert (QUINTIC.peak_velocity, SEPTIC.peak_velocity) == (1.875, 2.1875)


limit = st.floats(0.01, 100.0)


@settings(max_examples=100, deadline=None)
@given(law=st.sampled_from(LAWS), stroke=st.floats(-2.0, 2.0), v=limit, a=limit, j=st.floats(1.0, 1e5))
def test_the_duration_is_the_shortest_that_keeps_every_limit(law, stroke, v, a, j):
    duration = float(law.duration(stroke, v, a, j))
    if duration == 0.0:
        assert abs(stroke) < 1e-100
        return
    peaks = np.array(
        [
            law.peak_velocity * abs(stroke) / duration / v,
            law.peak_acceleration * abs(stroke) / duration**2 / a,
            law.peak_jerk * abs(stroke) / duration**3 / j,
        ]
    )
    assert np.max(peaks) == pytest.approx(1.0, rel=1e-9)


@by_name
def test_durations_broadcast_and_nothing_takes_no_time(law):
    durations = law.duration([[0.0], [0.3]], [1.0, 2.0, 4.0], 50.0)
    assert durations.shape == (2, 3)
    np.testing.assert_array_equal(durations[0], np.zeros(3))
    assert np.all(np.diff(durations[1]) <= 0.0)
    assert law.sample(0.0, 0.0, 0.0).position == 0.0
    assert law.sample(0.0, 0.2, 0.0).position == 0.2


def test_limits_that_are_not_positive_are_named():
    with pytest.raises(ValueError, match=r"acceleration_limit = 0\.0 must be positive"):
        QUINTIC.duration(1.0, 1.0, 0.0)
    with pytest.raises(ValueError, match=r"velocity_limit = -1\.0 must be positive"):
        SCurve.under_limits(1.0, -1.0, 1.0)
    with pytest.raises(ValueError, match="both infinite"):
        SCurve.under_limits(1.0, 1.0, np.inf)


def random_strokes(count):
    rng = np.random.default_rng(0)
    stroke = 10.0 ** rng.uniform(-4, 1, count) * rng.choice([-1.0, 1.0], count)
    return (
        stroke,
        10.0 ** rng.uniform(-1, 1, count),
        10.0 ** rng.uniform(-1, 2, count),
        10.0 ** rng.uniform(0, 5, count),
    )


def test_s_curves_take_the_minimum_time_that_ruckig_finds():
    ruckig = pytest.importorskip("ruckig")
    rows = random_strokes(1000)
    curves = SCurve.under_limits(*rows)
    for index, (stroke, v, a, j) in enumerate(np.stack(rows, axis=-1)):
        task = ruckig.InputParameter(1)
        task.current_position, task.target_position = [0.0], [stroke]
        task.max_velocity, task.max_acceleration, task.max_jerk = [v], [a], [j]
        trajectory = ruckig.Trajectory(1)
        ruckig.Ruckig(1).calculate(task, trajectory)
        assert curves.duration_s[index] == pytest.approx(trajectory.duration, abs=1e-6)
        middle = 0.3 * trajectory.duration
        position, velocity, acceleration = (values[0] for values in trajectory.at_time(middle))
        one = SCurve.under_limits(stroke, v, a, j).sample(middle)
        assert one.position == pytest.approx(position, abs=1e-9 + 1e-9 * abs(stroke))
        assert one.velocity == pytest.approx(velocity, abs=1e-8 * v)
        assert one.acceleration == pytest.approx(acceleration, abs=1e-5 * a)


def test_s_curves_reach_at_least_one_limit_and_pass_none():
    stroke, v, a, j = random_strokes(500)
    curves = SCurve.under_limits(stroke, v, a, j)
    use = np.stack(
        [np.abs(curves.peak_velocity) / v, np.abs(curves.peak_acceleration) / a, np.abs(curves.peak_jerk) / j]
    )
    assert np.max(use) < 1.0 + 1e-9
    np.testing.assert_allclose(np.max(use, axis=0), 1.0, rtol=1e-9)
    state = curves.sample(np.linspace(0.0, 1.0, 301)[:, None] * curves.duration_s)
    assert np.all(np.abs(state.velocity) <= v * (1.0 + 1e-9))
    assert np.all(np.abs(state.acceleration) <= a * (1.0 + 1e-9))
    assert np.all(np.abs(state.jerk) <= j * (1.0 + 1e-9))
    np.testing.assert_allclose(state.position[-1], stroke, rtol=1e-12)
    assert np.all(np.diff(np.sign(stroke) * state.position, axis=0) >= -1e-12)


@pytest.mark.parametrize("limits", [(1.0, 8.0, 60.0), (5.0, 8.0, 60.0), (5.0, 80.0, 60.0), (0.2, 80.0, 60.0)])
def test_s_curve_fields_are_derivatives(limits):
    curve = SCurve.under_limits(-0.8, *limits)
    time = np.linspace(0.0, 1.0, 100)[1:-1] * curve.duration_s + 1e-4
    corners = np.cumsum([0.0] + [float(x) for x in (curve.ramp_s, curve.hold_s, curve.ramp_s, curve.cruise_s)] * 2)
    time = time[np.min(np.abs(time[:, None] - corners), axis=-1) > 1e-3]
    state = curve.sample(time)
    for order in range(3):
        slope = derivative(lambda t, order=order: curve.sample(t)[order], time, 1e-4)
        np.testing.assert_allclose(state[order + 1], slope, rtol=0, atol=1e-6 * np.max(np.abs(state[order + 1])) + 1e-8)


def test_without_a_jerk_limit_the_s_curve_is_the_trapezoid():
    curve = SCurve.under_limits([0.15, 0.6, -0.6, 0.0], 4.5, 60.0)
    expected = [2.0 * np.sqrt(0.15 / 60.0), 4.5 / 60.0 + 0.6 / 4.5, 4.5 / 60.0 + 0.6 / 4.5, 0.0]
    np.testing.assert_allclose(curve.duration_s, expected, rtol=1e-14)
    assert curve.peak_jerk[0] == np.inf and curve.peak_jerk[2] == -np.inf and curve.peak_jerk[3] == 0.0
    # A jerk limit that never binds changes nothing but the ramps.
    assert SCurve.under_limits(0.6, 4.5, 60.0, 1e9).duration_s == pytest.approx(expected[1], abs=1e-6)


def test_no_rest_to_rest_law_beats_the_s_curve():
    strokes = np.geomspace(1e-3, 2.0, 30)
    best = SCurve.under_limits(strokes, 4.5, 60.0).duration_s
    for law in LAWS:
        assert np.all(law.duration(strokes, 4.5, 60.0) > best)
    limited = SCurve.under_limits(strokes, 4.5, 60.0, 3000.0).duration_s
    for law in LAWS:
        assert np.all(law.duration(strokes, 4.5, 60.0, 3000.0) > limited)
