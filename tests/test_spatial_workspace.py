"""Regions in space and on lattices against shapes whose volume, extent and holes are known."""

import numpy as np
import pytest

from fieldgym.mechanisms import ThreePRRS
from fieldgym.mechanisms.regions import boundary_loops, enclosed_voids, label_regions
from fieldgym.mechanisms.spatial_workspace import grid_section, polar_sections, spatial_extent, spatial_workspace
from fieldgym.mechanisms.studies import parameter_study
from fieldgym.mechanisms.workspace import planar_workspace, polygon_area

BOX = np.full(3, -1.2), np.full(3, 1.3)


def ellipsoid(points):
    return np.sum((points / np.array([1.0, 0.8, 0.6])) ** 2, axis=-1) <= 1.0


def tube(points):
    radius = np.hypot(points[:, 0], points[:, 1])
    return (radius >= 0.3) & (radius <= 1.0) & (np.abs(points[:, 2]) <= 0.5)


def shell(points):
    radius = np.linalg.norm(points, axis=-1)
    return (radius >= 0.5) & (radius <= 1.0)


@pytest.mark.parametrize(("method", "tolerance"), [("monte-carlo", 0.02), ("polar", 0.002), ("grid", 0.01)])
def test_ellipsoid(method, tolerance):
    found = spatial_workspace(ellipsoid, *BOX, method, samples=120_000)
    assert found.volume_m3 == pytest.approx(4.0 / 3.0 * np.pi * 0.48, rel=tolerance)
    slack = 0.06 if method == "monte-carlo" else 1e-5
    np.testing.assert_allclose(found.upper, [1.0, 0.8, 0.6], atol=slack)
    np.testing.assert_allclose(found.lower, [-1.0, -0.8, -0.6], atol=slack)
    assert found.hollow_sections == 0
    assert found.voids == ()


@pytest.mark.parametrize("method", ["polar", "grid"])
def test_tunnel_is_found_in_every_section(method):
    found = spatial_workspace(tube, *BOX, method, samples=100_000)
    assert found.hollow_sections == len(found.sections) > 5
    assert found.volume_m3 == pytest.approx(np.pi * (1.0 - 0.09), rel=0.05)
    assert found.voids == ()  # open at both ends


def test_cavity_is_found_with_its_volume():
    found = spatial_workspace(shell, *BOX, "grid", samples=64_000)
    assert len(found.voids) == 1
    assert found.voids[0] == pytest.approx(4.0 / 3.0 * np.pi * 0.125, rel=0.05)


def test_nothing_reachable_says_so():
    for method in ("monte-carlo", "polar", "grid"):
        with pytest.raises(ValueError, match="no point of the box"):
            spatial_workspace(lambda p: np.zeros(len(p), dtype=bool), *BOX, method, samples=10_000)
    with pytest.raises(ValueError, match="'sonar' is unknown"):
        spatial_workspace(ellipsoid, *BOX, "sonar")  # type: ignore[arg-type]


def test_extent_follows_a_slanted_tip():
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    halves = np.array([1.0, 0.3, 0.2])
    low, high = spatial_extent(lambda p: np.sum((p @ turn / halves) ** 2, axis=-1) <= 1.0, *BOX)
    expected = np.sqrt(np.sum((turn * halves) ** 2, axis=-1))
    np.testing.assert_allclose(high, expected, atol=1e-5)
    np.testing.assert_allclose(low, -expected, atol=1e-5)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_sections_of_an_ellipsoid(axis):
    halves = np.array([1.0, 0.8, 0.6])
    a, b = np.delete(halves, axis)
    level = float(0.5 * halves[axis])
    (polar,) = polar_sections(ellipsoid, *BOX, axis, [level], rays=180)
    grid = grid_section(ellipsoid, *BOX, axis, level, cells=60)
    for section in (polar, grid):
        assert section.area_m2 == pytest.approx(np.pi * a * b * 0.75, rel=2e-3)
        space = section.in_space(section.outlines[0])
        np.testing.assert_allclose(space[:, axis], level)
        np.testing.assert_allclose(np.sum((space / halves) ** 2, axis=-1), 1.0, atol=1e-6)
    (nothing,) = polar_sections(ellipsoid, *BOX, axis, [1.1])
    assert nothing.area_m2 == 0.0 and nothing.outlines == ()


def test_notch_of_the_rim_is_not_a_hole():
    def horns(p):
        outer, bite = np.hypot(p[:, 0], p[:, 1]) <= 1.0, np.hypot(p[:, 0] - 0.9, p[:, 1]) < 0.4
        return outer & ~bite & (np.abs(p[:, 2]) < 1.0)

    (polar,) = polar_sections(horns, *BOX, 2, [0.0])
    assert polar.holes == ()
    grid = grid_section(horns, *BOX, 2, 0.0)
    assert len(grid.outlines) == 1 and grid.holes == ()


def test_boundary_loops_of_a_ring_and_an_island():
    def region(p):
        radius = np.hypot(p[:, 0], p[:, 1])
        return ((radius > 0.4) & (radius < 1.0)) | (np.hypot(p[:, 0] - 1.6, p[:, 1]) < 0.2)

    axis = np.linspace(-2.0, 2.0, 121)
    areas = sorted(polygon_area(loop) for loop in boundary_loops(region, axis, axis))
    np.testing.assert_allclose(areas, [-np.pi * 0.16, np.pi * 0.04, np.pi], rtol=0.02)
    with pytest.raises(ValueError, match="touches the rim"):
        boundary_loops(region, np.linspace(-0.9, 2.0, 30), axis)
    assert boundary_loops(lambda p: np.zeros(len(p), dtype=bool), axis, axis) == []


def test_labels_against_flood_fill():
    mask = np.random.default_rng(3).random((17, 23)) < 0.55
    labels = label_regions(mask)
    expected = np.zeros(mask.shape, dtype=int)
    for start in np.argwhere(mask):
        if expected[tuple(start)]:
            continue
        number, stack = expected.max() + 1, [tuple(start)]
        while stack:
            i, j = stack.pop()
            if 0 <= i < 17 and 0 <= j < 23 and mask[i, j] and not expected[i, j]:
                expected[i, j] = number
                stack += [(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)]
    np.testing.assert_array_equal(labels, expected)
    wrapped = label_regions(np.array([[True, False, True], [False, False, True]]), wrap=(1,))
    np.testing.assert_array_equal(wrapped, [[1, 0, 1], [0, 0, 1]])


def test_enclosed_voids():
    ring = np.ones((7, 9), dtype=bool)
    ring[2:5, 2:4] = ring[1, 7] = False
    np.testing.assert_array_equal(enclosed_voids(ring), [6, 1])
    ring[0, 7] = False
    np.testing.assert_array_equal(enclosed_voids(ring), [6])


def test_planar_grid_knows_holes():
    def ring(p):
        radius = np.hypot(p[:, 0], p[:, 1])
        return (radius > 0.4) & (radius < 1.0)

    found = planar_workspace(ring, (-1.5, -1.5), (1.5, 1.4), "grid", samples=40_000)
    assert found.area_m2 == pytest.approx(np.pi * 0.84, rel=0.005)
    assert len(found.holes) == 1
    assert polygon_area(found.boundary) == pytest.approx(np.pi, rel=0.005)
    assert abs(polygon_area(found.holes[0])) == pytest.approx(np.pi * 0.16, rel=0.01)


def test_parameter_study():
    study = parameter_study(lambda a, b: -((a - 1.0) ** 2) - (b - 2.0) ** 2, [0.0, 1.0, 2.0], [1.0, 2.0, 3.0, 4.0])
    assert study.values.shape == (3, 4)
    assert study.best == (1.0, 2.0)
    assert study.peaks == 1 and not study.best_on_rim

    axis = np.linspace(-1.0, 1.0, 21)
    two = parameter_study(lambda a, b: max(0.0, 0.3 - np.hypot(a - 0.5, b), 0.2 - np.hypot(a + 0.5, b)), axis, axis)
    assert two.peaks == 2  # and the floor at zero is none
    ridge = parameter_study(lambda a, b: 2.0 - abs(a - b), axis, axis)
    assert ridge.peaks == 1 and np.count_nonzero(ridge.summit) == 21

    def fails(a, b):
        if a > 1.0:
            raise ValueError("no such machine")
        return a * b

    study = parameter_study(fails, [0.0, 1.0, 2.0], [1.0, 2.0])
    assert np.isnan(study.values[2]).all()
    assert study.best == (1.0, 2.0) and study.best_on_rim


@pytest.mark.parametrize("orientation", [(0.0, 0.0, 0.0), (np.deg2rad(15.0), 0.0, 0.0)])
def test_methods_agree_on_the_mechanism(orientation):
    machine = ThreePRRS.published()
    exact = machine.volume(orientation, cells=400)
    thrown = machine.workspace(orientation, "monte-carlo", samples=300_000)
    searched = machine.workspace(orientation, "polar", samples=120_000)
    laid = machine.workspace(orientation, "grid", samples=64_000)
    assert thrown.volume_m3 == pytest.approx(exact, rel=0.015)
    assert searched.volume_m3 == pytest.approx(exact, rel=0.005)
    assert laid.volume_m3 == pytest.approx(exact, rel=0.01)
    np.testing.assert_allclose(searched.lower, laid.lower, atol=1e-6)
    assert (thrown.lower >= searched.lower - 1e-9).all() and (thrown.upper <= searched.upper + 1e-9).all()
    assert laid.voids == () and laid.hollow_sections == 0 and searched.hollow_sections == 0
