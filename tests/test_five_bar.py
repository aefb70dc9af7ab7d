"""The safflower five-bar: the paper's formulas in their corrected form, and its workspace."""

import numpy as np
import pytest

from fieldgym.mechanisms import FiveBar
from fieldgym.mechanisms.workspace import best_triangle, planar_workspace

BAR = FiveBar.safflower()
LENGTHS = {"l1": 0.175, "l2": 0.350, "l3": 0.040, "l4": 0.060, "l5": 0.350, "l6": 0.175, "l7": 0.580}


def reachable_poses(count, seed=0):
    thrown = np.random.default_rng(seed).uniform((0.15, -0.51), (0.43, -0.22), (20 * count, 2))
    return thrown[BAR.reachable(thrown)][:count]


@pytest.fixture(scope="module")
def region():
    """The reachable region from points thrown into a close box: its area has a standard error of 0.14 %."""
    return planar_workspace(BAR.reachable, (0.14, -0.52), (0.44, -0.20), samples=400_000)


def test_inverse_agrees_with_the_corrected_equations_1_to_13():
    t = reachable_poses(300)
    l1, l2, l3, l4, l5, l6, l7 = LENGTHS.values()
    dx, dy = t[:, 0] + l3 - l7, t[:, 1] + l4
    rho = np.hypot(dx, dy)
    q4 = np.arctan2(dy, dx) + np.arccos((rho**2 + l6**2 - l5**2) / (2.0 * rho * l6))
    cx, cy = t[:, 0] - l3, t[:, 1] + l4
    q1 = np.arctan2(cy, cx) - np.arccos((cx**2 + cy**2 + l1**2 - l2**2) / (2.0 * l1 * np.hypot(cx, cy)))
    np.testing.assert_allclose(BAR.inverse(t), np.stack([q1, q4], axis=-1), rtol=0, atol=1e-12)


def test_forward_agrees_with_the_corrected_equations_23_to_28():
    t = reachable_poses(300)
    chains = BAR.chains(t)
    q1, q4 = chains.q.T
    l1, l2, l3, l4, l5, l6, l7 = LENGTHS.values()
    w = l1**2 + 4 * l3**2 + l5**2 + l6**2 + l7**2 - l2**2 - 4 * l3 * l7
    x = 2 * ((l6 * l7 - 2 * l3 * l6) * np.cos(q4) - (l1 * l7 - 2 * l1 * l3) * np.cos(q1) - l1 * l6 * np.cos(q1 - q4))
    y = 2 * ((l5 * l7 - 2 * l3 * l5) - l1 * l5 * np.cos(q1) + l5 * l6 * np.cos(q4))
    z = 2 * (l5 * l6 * np.sin(q4) - l1 * l5 * np.sin(q1))
    root = np.sqrt(z * z - (w + x - y) * (w + x + y))
    roots = [2.0 * np.arctan((-z + sign * root) / (w + x - y)) for sign in (1.0, -1.0)]
    apart = [np.abs(np.angle(np.exp(1j * (q3 - chains.q_passive[:, 1])))) for q3 in roots]
    assert np.max(np.min(apart, axis=0)) < 1e-9
    q3 = chains.q_passive[:, 1]
    tx = l6 * np.cos(q4) + l7 + l5 * np.cos(q3) - l3
    ty = l6 * np.sin(q4) + l5 * np.sin(q3) - l4
    np.testing.assert_allclose(np.stack([tx, ty], axis=-1), t, rtol=0, atol=1e-12)


def test_jacobian_agrees_with_the_corrected_equations_18_and_20():
    t = reachable_poses(300)
    chains = BAR.chains(t)
    (q1, q4), (q2, q3) = chains.q.T, chains.q_passive.T
    l1, l6 = LENGTHS["l1"], LENGTHS["l6"]
    s21, s34 = np.sin(q2 - q1), np.sin(q3 - q4)
    rates = [[np.cos(q2) / (l1 * s21), np.sin(q2) / (l1 * s21)], [np.cos(q3) / (l6 * s34), np.sin(q3) / (l6 * s34)]]
    np.testing.assert_allclose(BAR.jacobian(t), np.moveaxis(np.array(rates), -1, 0), rtol=1e-10)
    velocity = [[l1 * s21 * np.sin(q3), -l6 * s34 * np.sin(q2)], [-l1 * s21 * np.cos(q3), l6 * s34 * np.cos(q2)]]
    velocity = np.moveaxis(np.array(velocity) / np.sin(q3 - q2), -1, 0)
    np.testing.assert_allclose(np.linalg.inv(BAR.jacobian(t)), velocity, rtol=1e-8, atol=1e-12)


def test_accelerations_agree_with_the_corrected_equation_22():
    t = reachable_poses(300)
    rng = np.random.default_rng(1)
    v, a = rng.normal(size=t.shape), 20.0 * rng.normal(size=t.shape)
    chains = BAR.chains(t)
    (q1, q4), (q2, q3) = chains.q.T, chains.q_passive.T
    (w1, w4), l1, l2, l5, l6 = BAR.joint_rates(t, v).T, *(LENGTHS[name] for name in ("l1", "l2", "l5", "l6"))
    w2 = (-v[:, 0] * np.sin(q2) + v[:, 1] * np.cos(q2) - l1 * w1 * np.cos(q2 - q1)) / l2
    w3 = (-v[:, 0] * np.sin(q3) + v[:, 1] * np.cos(q3) - l6 * w4 * np.cos(q3 - q4)) / l5
    e2, e3 = np.stack([np.cos(q2), np.sin(q2)], -1), np.stack([np.cos(q3), np.sin(q3)], -1)
    a1 = (np.sum(a * e2, -1) + l1 * w1**2 * np.cos(q1 - q2) + l2 * w2**2) / (l1 * np.sin(q2 - q1))
    a4 = (np.sum(a * e3, -1) + l6 * w4**2 * np.cos(q4 - q3) + l5 * w3**2) / (l6 * np.sin(q3 - q4))
    np.testing.assert_allclose(BAR.joint_accelerations(t, v, a), np.stack([a1, a4], -1), rtol=1e-9, atol=1e-9)


def test_the_reachable_area_is_0_051_m2(region):
    assert region.area_m2 == pytest.approx(0.051, abs=0.0005)
    polar = BAR.workspace("polar")
    assert polar.area_m2 == pytest.approx(region.area_m2, rel=0.01)
    # The outline lies on the limits: a millimetre inwards is inside, a millimetre outwards is not.
    outward = polar.boundary - polar.points.mean(axis=0)
    outward /= np.linalg.norm(outward, axis=-1, keepdims=True)
    assert np.all(BAR.reachable(polar.boundary - 1e-3 * outward))
    assert not np.any(BAR.reachable(polar.boundary + 1e-3 * outward))


def test_the_reachable_area_is_nearly_the_published_triangle(region):
    triangle, overlap = best_triangle(region.points[:15_000], region.area_m2, 0.350)
    assert overlap >= 0.80
    # Apex down, level side up: the shape of the paper's Fig. 6.
    assert np.argmin(triangle[:, 1]) == 0 and triangle[1, 1] == pytest.approx(triangle[2, 1])


def test_the_workspace_is_the_same_for_the_same_seed():
    first, second, other = (BAR.workspace(samples=20_000, seed=seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.points, second.points)
    assert first.area_m2 != other.area_m2
    with pytest.raises(ValueError, match="'spiral' is unknown"):
        BAR.workspace("spiral")  # type: ignore[arg-type]


def test_margins_have_names():
    assert list(BAR.margins(reachable_poses(1)[0])) == [
        *("leg1_reach", "leg1_fold", "leg2_reach", "leg2_fold"),
        *("q1_lower", "q1_upper", "q4_lower", "q4_upper"),
        *("elbow1", "elbow2", "forearms", "clearance"),
    ]


def test_the_platform_split_of_the_base_does_not_change_the_motion():
    other = FiveBar.from_lengths(0.175, 0.350, 0.010, 0.060, 0.350, 0.175, 0.520)
    poses = reachable_poses(50)
    np.testing.assert_allclose(other.inverse(poses - [0.03, 0.0]), BAR.inverse(poses), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"l1": 0.0}, "l1 = 0.0 m is not a length"),
        ({"l7": np.inf}, "l7 = inf m is not a length"),
        ({"l3": -0.01}, "half_platform_m = -0.01 m"),
        ({"min_elbow_angle_rad": 2.0}, "min_elbow_angle_rad = 2.0 rad: give a number"),
        ({"link_clearance_m": -1.0}, "link_clearance_m = -1.0 m"),
        ({"arm_range_rad": (0.0, -1.0)}, "give -3/2 pi < lower < upper"),
    ],
)
def test_impossible_geometry_is_refused_by_name(change, message):
    limits = {name: value for name, value in change.items() if name not in LENGTHS}
    lengths = {**LENGTHS, **{name: value for name, value in change.items() if name in LENGTHS}}
    with pytest.raises(ValueError, match=message):
        FiveBar.from_lengths(*lengths.values(), **limits)
