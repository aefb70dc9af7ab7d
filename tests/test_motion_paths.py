"""Curves, stopped paths and gates: geometry against finite differences, motions against their limits."""

import numpy as np
import pytest
from scipy.optimize import minimize

from fieldgym.motion import (
    GATE_STYLES,
    QUINTIC,
    SEPTIC,
    Bezier,
    CurvedPath,
    Gate,
    GateStyle,
    Line,
    OverlappedGate,
    StoppedPath,
    gate_corners,
    polyline,
    rounded,
)
from fieldgym.motion.gates import _bezier_durations

GATE = gate_corners((0.0, 0.0), (0.6, 0.0), 0.15)
V, A = 4.5, 60.0


def derivative(function, at, step):
    near = 8.0 * (function(at + step) - function(at - step))
    return (near - (function(at + 2.0 * step) - function(at - 2.0 * step))) / (12.0 * step)


def assert_fields_are_derivatives(motion, breaks=(), step=1e-5, tolerance=1e-5):
    """Position, velocity and acceleration belong together away from the ``breaks`` of the acceleration."""
    time = np.linspace(0.0, motion.duration_s, 203)[1:-1]
    for instant in breaks:
        time = time[np.abs(time - instant) > 3.0 * step]
    state = motion.sample(time)
    for order in range(2):
        slope = derivative(lambda t, order=order: motion.sample(t)[order], time, step)
        scale = np.max(np.abs(state[order + 1]))
        error = np.max(np.abs(state[order + 1] - slope), axis=-1)
        # A step of the finite difference may straddle a node, where only the acceleration's slope changes.
        assert np.quantile(error, 0.9) < tolerance * scale and np.max(error) < 0.2 * scale


def peak(vectors):
    return float(np.max(np.linalg.norm(vectors, axis=-1)))


@pytest.mark.parametrize(
    "path",
    [
        polyline(GATE),
        rounded(GATE, 0.1),
        rounded(GATE, 0.15),
        rounded(GATE, 0.1, "smooth"),
        rounded([[0.0, 0.0, 0.0], [0.3, 0.0, 0.1], [0.3, 0.4, 0.2], [0.0, 0.5, 0.9]], 0.08),
    ],
    ids=["sharp", "circle", "touching circles", "smooth", "space"],
)
def test_curves_are_walked_by_arc_length(path):
    inner = np.linspace(0.0, path.length_m, 401)[1:-1]
    inner = inner[np.min(np.abs(inner[:, None] - path.offsets), axis=-1) > 3e-4]
    point = path.at(inner)
    np.testing.assert_allclose(np.linalg.norm(point.tangent, axis=-1), 1.0, atol=1e-12)
    np.testing.assert_allclose(derivative(lambda s: path.at(s).position, inner, 1e-4), point.tangent, atol=1e-8)
    bend = derivative(lambda s: path.at(s).tangent, inner, 1e-4)
    np.testing.assert_allclose(bend, point.bend, atol=1e-4 * max(1.0, np.max(np.abs(point.bend))))


def test_rounding_keeps_the_ends_and_shortens_by_the_known_amount():
    path = rounded(GATE, 0.1)
    np.testing.assert_allclose(path.at([0.0, path.length_m]).position, GATE[[0, -1]], atol=1e-15)
    assert path.length_m == pytest.approx(0.9 - 2.0 * (2.0 - 0.5 * np.pi) * 0.1, abs=1e-14)
    assert not np.any(path.sharp) and np.all(path.kinked)
    assert not np.any(rounded(GATE, 0.1, "smooth").kinked)
    assert np.all(polyline(GATE).sharp)


def test_impossible_roundings_are_refused():
    with pytest.raises(ValueError, match=r"needs 0\.2 m of leg 0, which is 0\.15 m long: choose a smaller radius"):
        rounded(GATE, 0.2)
    with pytest.raises(ValueError, match=r"radius_m = -0\.1 m"):
        rounded(GATE, -0.1)
    with pytest.raises(ValueError, match="turns back on itself"):
        rounded([[0.0, 0.0], [0.1, 0.0], [0.0, 0.0]], 0.01)
    with pytest.raises(ValueError, match="at least one segment"):
        polyline([[0.1, 0.2], [0.1, 0.2]])
    with pytest.raises(ValueError, match=r"segments 0 and 1 are 1 m apart"):
        CurvedPath((Line(np.zeros(2), np.array([1.0, 0.0])), Line(np.array([2.0, 0.0]), np.array([3.0, 0.0]))))


def test_bezier_length_of_a_known_curve():
    control = 4.0 / 3.0 * np.tan(np.pi / 8.0)
    quarter = Bezier(np.array([[1.0, 0.0], [1.0, control], [control, 1.0], [0.0, 1.0]]))
    from scipy.integrate import quad

    expected, _ = quad(lambda u: np.linalg.norm(quarter._derivative(np.array([u]), 1)), 0.0, 1.0, epsabs=1e-13)
    assert quarter.length_m == pytest.approx(expected, abs=1e-12)


# --- paths with stops ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [QUINTIC, SEPTIC], ids=lambda law: law.name)
def test_stopped_paths_rest_at_every_corner(law):
    path = StoppedPath.under_limits(GATE, V, A, law)
    arrivals = np.concatenate([[0.0], np.cumsum(path.leg_s)])
    state = path.sample(arrivals)
    np.testing.assert_allclose(state.position, GATE, atol=1e-14)
    np.testing.assert_array_equal(state.velocity, np.zeros((4, 2)))
    assert_fields_are_derivatives(path, arrivals)
    state = path.sample(np.linspace(0.0, path.duration_s, 20_001))
    assert peak(state.velocity) <= V * (1 + 1e-12) and peak(state.acceleration) <= A * (1 + 1e-12)


def test_a_leg_may_wait_at_its_end():
    path = StoppedPath(np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.2]]), np.array([1.0, 0.5]), np.array([0.4, 0.5]))
    waiting = path.sample([0.4, 0.7, 1.0])
    np.testing.assert_allclose(waiting.position, [[0.1, 0.0]] * 3)
    assert path.duration_s == 1.5
    np.testing.assert_allclose(path.sample([-1.0, 9.0]).position, [[0.0, 0.0], [0.1, 0.2]])


def test_gate_corners_broadcast():
    corners = gate_corners(np.zeros((5, 2)), [0.3, -0.1], np.linspace(0.1, 0.2, 5))
    assert corners.shape == (5, 4, 2)
    np.testing.assert_allclose(corners[2], [[0.0, 0.0], [0.0, 0.15], [0.3, 0.15], [0.3, -0.1]])


# --- gates -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("style", GATE_STYLES)
@pytest.mark.parametrize(("start", "end", "level"), [((0, 0), (0.6, 0), 0.15), ((0.25, -0.62), (-0.1, -0.60), -0.52)])
def test_every_style_connects_the_ends_under_the_limits(style, start, end, level):
    gate = Gate(style, V, A, straight_m=0.02)
    motion = gate.motion(start, end, level)
    state = motion.sample(np.linspace(0.0, motion.duration_s, 8001))
    np.testing.assert_allclose(state.position[[0, -1]], [start, end], atol=1e-12)
    np.testing.assert_array_equal(state.velocity[[0, -1]], np.zeros((2, 2)))
    assert peak(state.velocity) <= V * (1.0 + 1e-9)
    assert peak(state.acceleration) <= A * (1.0 + 1e-4)
    assert np.max(state.position[:, 1]) == pytest.approx(level, abs=1e-6)
    # Straight where a plug leaves its cell and enters the next one.
    low = state.position[:, 1] < min(start[1], end[1]) + 0.02
    assert np.all(np.min(np.abs(state.position[low][:, :1] - [start[0], end[0]]), axis=-1) < 1e-12)


@pytest.mark.parametrize("style", ["blended", "time-optimal", "stop-quintic"])
def test_gate_motions_are_consistent(style):
    motion = Gate(style, V, A, straight_m=0.03).motion((0.0, 0.0), (0.6, 0.0), 0.15)
    assert_fields_are_derivatives(motion)


@pytest.mark.parametrize(
    ("style", "straight", "per_minute"),
    [
        ("stop-quintic", 0.0, 61.0),
        ("stop-fastest", 0.0, 73.5),
        ("blended", 0.1, 84.0),
        ("blended", 0.05, 95.0),
        ("blended", 0.025, 100.5),
        ("blended", 0.0, 105.0),
        ("time-optimal", 0.0, 130.0),
        ("time-optimal", 0.03, 110.0),
        ("time-optimal", 0.05, 102.0),
    ],
)
def test_rates_over_the_full_gate(style, straight, per_minute):
    """Out and back over 600 x 150 mm without grip time; corner radius is 150 mm less the straight rise."""
    motion = Gate(style, V, A, straight_m=straight).motion((0.0, 0.0), (0.6, 0.0), 0.15)
    assert 60.0 / (2.0 * motion.duration_s) == pytest.approx(per_minute, rel=0.01)


def test_better_ways_over_the_gate_are_faster():
    order: list[GateStyle] = ["stop-septic", "stop-quintic", "stop-fastest", "blended", "time-optimal"]
    for strokes in ((0.15, 0.6, 0.15), (0.05, 0.3, 0.05), (0.06, 0.1, 0.04)):
        times = [float(Gate(style, V, A, straight_m=0.01).durations(*strokes)) for style in order]
        assert times == sorted(times, reverse=True)


@pytest.mark.parametrize("style", GATE_STYLES)
def test_batched_durations_are_those_of_the_motions(style):
    gate = Gate(style, V, A, straight_m=0.01)
    across = np.array([[0.0, 0.1, 0.3], [0.3, 0.45, 0.1]])
    durations = gate.durations(0.05, across, 0.06)
    assert durations.shape == (2, 3)
    for stroke, duration in zip(across.ravel(), durations.ravel(), strict=True):
        motion = gate.motion((0.1, -0.60), (0.1 - stroke, -0.61), -0.55)
        assert motion.duration_s == pytest.approx(duration, rel=1e-7)
    assert gate.durations(0.0, 0.0, 0.0) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize(("straight", "per_minute"), [(0.05, 102.2), (0.03, 110.1), (0.0, 130.7)])
def test_the_free_gate_is_close_to_the_fastest_of_all_curves(straight, per_minute):
    """A direct transcription of half the gate, with forces in a disc, bounds what any curve could do."""
    steps = 16

    def roll(z):
        leave = z[-2] * np.sqrt(2.0 * A * straight)
        rise_s = (2.0 * np.sqrt(A * straight + 0.5 * leave**2) - leave) / A
        a, dt = z[:-2].reshape(steps, 2) * A, 0.1 * z[-1] / steps
        v = np.vstack([[0.0, leave], [0.0, leave] + np.cumsum(a, axis=0) * dt])
        r = np.array([0.0, straight]) + np.cumsum(v[:-1] * dt + 0.5 * a * dt * dt, axis=0)
        return rise_s, a, v, r

    def ends(z):
        _, _, v, r = roll(z)
        return np.array([10.0 * (r[-1, 0] - 0.3), 10.0 * (r[-1, 1] - 0.15), v[-1, 1]])

    def room(z):
        _, a, v, _ = roll(z)
        return np.concatenate([1.0 - np.sum(a**2, 1) / A**2, 1.0 - np.sum(v[1:] ** 2, 1) / V**2, [1.0 - z[-2], z[-2]]])

    first = np.concatenate([np.tile([0.6, -0.3], steps), [0.7, 1.2]])
    constraints = [{"type": "eq", "fun": ends}, {"type": "ineq", "fun": room}]
    cost = lambda z: 10.0 * roll(z)[0] + z[-1]  # noqa: E731
    found = minimize(cost, first, constraints=constraints, method="SLSQP", options={"maxiter": 300})
    assert found.success
    bound = 2.0 * (roll(found.x)[0] + 0.1 * found.x[-1])
    duration = Gate("time-optimal", V, A, straight_m=straight).motion((0.0, 0.0), (0.6, 0.0), 0.15).duration_s
    assert 30.0 / bound == pytest.approx(per_minute, abs=0.05)
    assert bound * 0.998 < duration < bound * 1.01


def test_the_searched_duration_is_that_of_the_motion(monkeypatch):
    monkeypatch.setattr("fieldgym.motion.gates._STEPS", 400)
    handles = np.array([[0.5, 0.5, 0.0], [0.7, 0.4, 0.0]])
    from fieldgym.motion import minimum_time
    from fieldgym.motion.gates import _controls

    times = _bezier_durations(0.15, 0.6, 0.12, 0.02, handles, V, A)
    for row, searched in zip(handles, times, strict=True):
        first, second = _controls(0.15, 0.6, 0.12, 0.02, row)
        lines = Line(np.zeros(2), first[0]), Line(second[-1], second[-1] - [0.0, 0.02])
        motion = minimum_time(CurvedPath((lines[0], Bezier(first), Bezier(second), lines[1])), V, A, nodes=2000)
        assert motion.duration_s == pytest.approx(searched, rel=3e-3)


def test_gates_that_make_no_sense_are_refused():
    with pytest.raises(ValueError, match="'sprint' is unknown: choose from stop-quintic"):
        Gate("sprint", V, A)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"acceleration_limit = 0\.0 must be positive"):
        Gate("blended", V, 0.0)
    with pytest.raises(ValueError, match=r"height = -0\.1 m lies below an end of the gate: raise it by 0\.1 m"):
        Gate("blended", V, A).motion((0.0, 0.0), (0.6, -0.2), -0.1)


# --- overlapped ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lift", "stroke", "rates"),
    [(0.025, 0.305, (111, 136, 175)), (0.05, 0.3, (97, 125, 177)), (0.15, 0.6, (61, 81, 120))],
)
def test_overlap_counted_per_axis_gives_the_catalogue_rates(lift, stroke, rates):
    corners = gate_corners((0.0, 0.0), (stroke, 0.0), lift)
    for overlap, rate in zip((0.0, 0.5, 1.0), rates, strict=True):
        gate = OverlappedGate.under_limits(corners, V, A, overlap, per_axis=True)
        assert 30.0 / gate.duration_s == pytest.approx(rate, abs=0.6)


@pytest.mark.parametrize("overlap", [0.0, 0.3, 0.5, 1.0])
def test_overlapped_gates_keep_the_limits_of_the_tool(overlap):
    gate = OverlappedGate.under_limits(GATE, V, A, overlap)
    state = gate.sample(np.linspace(0.0, gate.duration_s, 10_001))
    assert peak(state.velocity) <= V * (1 + 1e-6) and peak(state.acceleration) <= A * (1 + 1e-5)
    np.testing.assert_allclose(state.position[[0, -1]], GATE[[0, -1]], atol=1e-14)
    assert_fields_are_derivatives(gate, [*gate.start_s, *(gate.start_s + gate.moving_s)])
    started = gate.sample([gate.start_s[1]]).position[0]
    np.testing.assert_allclose(started, [0.0, gate.straight_m], atol=1e-12)
    slowest, fastest = (OverlappedGate.under_limits(GATE, V, A, share).duration_s for share in (0.0, 1.0))
    assert fastest <= gate.duration_s <= slowest


def test_a_short_traverse_does_not_start_the_fall_before_the_rise_has_ended():
    gate = OverlappedGate.under_limits(gate_corners((0.0, 0.0), (0.01, 0.0), 0.15), V, A, 1.0)
    assert gate.start_s[2] >= gate.start_s[0] + gate.moving_s[0] - 1e-15
    with pytest.raises(ValueError, match=r"overlap = 1\.5 is not a share"):
        OverlappedGate.under_limits(GATE, V, A, 1.5)
