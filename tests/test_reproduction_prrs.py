"""The 3-PRRS paper's chapter: each correction on its own, then the chapter as a whole."""

from dataclasses import replace

import numpy as np
import pytest

from fieldgym.mechanisms import ThreePRRS
from fieldgym.mechanisms.geometry import line_distance, segment_distance
from fieldgym.papers import Verdict
from fieldgym.papers.prrs import (
    ALTERNATIVE,
    LEVEL,
    PUBLISHED_LIMITS_MM,
    TILTED,
    chapter,
    corners,
    extent_mm,
    limits_rms_mm,
    line_clearance,
    mismatch,
)
from fieldgym.papers.prrs_influence import level_volume

MACHINE = ThreePRRS.published()


def test_line_distance_is_the_common_normal():
    rng = np.random.default_rng(0)
    a, b, c, d = rng.normal(size=(4, 200, 3))
    found = line_distance(a, b, c, d)
    share = 1e3
    long = segment_distance(a - share * (b - a), a + share * (b - a), c - share * (d - c), c + share * (d - c))
    np.testing.assert_allclose(found, long, atol=1e-6)
    assert (found <= segment_distance(a, b, c, d) + 1e-12).all()
    parallel = line_distance(a, b, a + np.array([0.0, 0.0, 1.0]), b + np.array([0.0, 0.0, 1.0]))
    u = (b - a) / np.linalg.norm(b - a, axis=-1, keepdims=True)
    np.testing.assert_allclose(parallel, np.hypot(u[:, 0], u[:, 1]), atol=1e-9)


def test_infinite_lines_meet_on_the_axis_and_on_every_mirror_plane():
    """Erratum: the printed clearance vanishes there, while the links themselves stay 60 mm apart."""
    places = np.array([[0.0, 0.0, 0.08], [0.03, 0.0, 0.08], [-0.02, 0.0, 0.12]])
    np.testing.assert_allclose(line_clearance(MACHINE, LEVEL, places), 0.0, atol=1e-12)
    margins = MACHINE.margins(np.hstack([places, np.zeros((3, 3))]))
    apart = np.min([margins[name] for name in ("clearance12", "clearance23", "clearance31")], axis=0)
    assert (apart + MACHINE.link_clearance_m > 0.05).all()
    assert MACHINE.reachable(np.hstack([places, np.zeros((3, 3))])).all()


def test_one_set_of_dimensions_gives_the_twelve_numbers():
    assert limits_rms_mm(MACHINE) < 1.5
    assert limits_rms_mm(ALTERNATIVE) < 1.5
    # The bound tells machines apart: a neighbour off the ridge breaks it.
    assert limits_rms_mm(replace(MACHINE, cone_rad=np.deg2rad(53.0))) > 1.5


def test_extent_is_that_of_a_fine_search():
    """The twelve numbers against plain lattices of columns, which fall short by less than their spacing."""
    for orientation in PUBLISHED_LIMITS_MM:
        lower, upper = MACHINE.box(orientation)
        axes = [np.linspace(lower[k], upper[k], 350) for k in (0, 1)]
        low, high = MACHINE.heights(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1), orientation)
        covered = np.isfinite(low)
        found = 1e3 * np.array(
            [
                [axes[0][covered.any(axis=1)].min(), axes[0][covered.any(axis=1)].max()],
                [axes[1][covered.any(axis=0)].min(), axes[1][covered.any(axis=0)].max()],
                [np.nanmin(low), np.nanmax(high)],
            ]
        )
        np.testing.assert_allclose(found, extent_mm(MACHINE, orientation), atol=0.8)


def test_symmetry_is_three_fold():
    """Erratum: not symmetric about Z as an axis of half turns."""
    assert mismatch(MACHINE, LEVEL, 2 * np.pi / 3, False) < 1e-6
    assert mismatch(MACHINE, LEVEL, 0.0, True) < 1e-6
    assert mismatch(MACHINE, LEVEL, np.pi, False) > 0.1
    assert mismatch(MACHINE, TILTED, 2 * np.pi / 3, False) > 0.1


def test_level_volume_is_largest_where_the_circles_are_equal():
    """Fig. 5's optima do not follow from the printed constraints alone."""
    for l_mm in (98.3, 155.0):
        for boxed in (False, True):
            volumes = [level_volume(l_mm, 150.0 + g, 150.0, boxed) for g in range(-100, 101, 20)]
            assert int(np.argmax(volumes)) == 5
    assert level_volume(155.0, 195.0, 70.0, True) < 0.6 * level_volume(155.0, 70.0, 70.0, True)


@pytest.mark.parametrize("l_mm, base, platform", [(98.3, 158.6, 70.0), (155.0, 195.0, 95.0), (130.0, 90.0, 180.0)])
def test_level_volume_is_the_mechanisms(l_mm, base, platform):
    machine = replace(MACHINE, link_m=l_mm / 1e3, base_diameter_m=base / 1e3, platform_diameter_m=platform / 1e3)
    assert level_volume(l_mm, base, platform, False, cells=200) == pytest.approx(machine.volume(cells=200), rel=0.01)


@pytest.mark.parametrize("contact, clearance", [("clear", 10.0), ("among", 0.0), ("among", 5.0)])
def test_contact_takes_away_what_touches_a_column(contact, clearance):
    """The volume counted over thrown level poses, platform and columns drawn as circles one by one."""
    l_mm, base, platform = 170.0, 225.0, 95.0
    machine = replace(MACHINE, link_m=l_mm / 1e3, base_diameter_m=base / 1e3, platform_diameter_m=platform / 1e3)
    points = np.random.default_rng(0).uniform((-0.1, -0.1, 0.0), (0.1, 0.1, 0.25), (200_000, 3))
    good = machine.reachable(np.hstack([points, np.zeros_like(points)]))
    x, y = 1e3 * points[:, 0], 1e3 * points[:, 1]
    columns = [(0.5 * base * np.cos(a), 0.5 * base * np.sin(a)) for a in np.deg2rad([0.0, 120.0, 240.0])]
    for across, along in columns:
        good &= np.hypot(x - across, y - along) >= 0.5 * platform + clearance
    if contact == "among":
        for one, two in ((0, 1), (1, 2), (2, 0)):
            (ax, ay), (bx, by) = columns[one], columns[two]
            good &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0
    thrown = 0.2 * 0.2 * 0.25 * np.count_nonzero(good) / len(good)
    assert level_volume(l_mm, base, platform, True, contact, clearance) == pytest.approx(thrown, rel=0.02)


def test_a_platform_that_fills_the_columns_goes_nowhere():
    assert level_volume(155.0, 90.0, 95.0, True, "clear") == 0.0
    # Without room between two columns it stays among them, whatever is free outside.
    closed = level_volume(155.0, 110.0, 95.0, True, "clear")
    assert 0.0 < closed < 0.1 * level_volume(155.0, 125.0, 95.0, True, "clear")


def test_corners_counts_corners():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    angle = np.linspace(0.0, 2.0 * np.pi, 100, endpoint=False)
    assert corners(square + 0.013) == 4
    assert corners(np.roll(square, 1, axis=0)) == 4
    assert corners(np.stack([np.cos(angle), np.sin(angle)], axis=-1)) == 0


@pytest.mark.slow
def test_chapter():
    result = chapter()
    assert result.key == "prrs"
    verdicts = {finding.item: finding.verdict for finding in result.findings}
    assert len(verdicts) == len(result.findings)
    assert verdicts["Section 2, the twelve limits of both workspaces"] is Verdict.IDENTIFIED
    assert verdicts["Section 2 (2), symmetry at 0 deg"] is Verdict.REPRODUCED_WITH_CORRECTION
    assert verdicts["Section 2 (1) and abstract, interior"] is Verdict.REPRODUCED_WITH_CORRECTION
    for panel in "abc":
        finding = next(finding for finding in result.findings if finding.item == f"Fig. 5({panel})")
        assert finding.verdict is Verdict.NOT_DETERMINABLE
        assert "always at D = d" in finding.why
    for item in ("Eq. 5, L_i", "Eq. 6, theta_i", "Section 1, [T]"):
        assert verdicts[item] is Verdict.NOT_DETERMINABLE
    assert verdicts["alpha = 0 deg, width of Z"] is Verdict.REFUTED
    assert [figure.stem for figure in result.figures] == ["workspace-0", "workspace-15", "influence", "clearance"]
