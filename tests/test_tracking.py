"""What the pages on machines and ground have their figures from: the shipped machine is varied, sums are as by hand."""

import argparse
from typing import Any

import numpy as np
import pytest

from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.kernels.config import ConfigError, override
from fieldgym.scripts import drive_errors, ground, tracking
from fieldgym.simulation.picker import measure_tracking
from fieldgym.simulation.picker_model import PickerParameters
from fieldgym.simulation.urdf import Robot


def mass_kg(robot: Robot) -> float:
    return sum(link.mass_kg for link in robot.links)


def columns(table: Any, *places: int) -> list[tuple[str, ...]]:
    cells = [list(column.cells) for column in table.columns]
    return [tuple(cells[place][row] for place in places) for row in range(len(cells[0]))]


def test_the_shipped_variant_is_the_shipped_picker():
    shipped, (varied, spent_s) = measure_tracking(), tracking.run(tracking.SHIPPED, True)
    assert (varied.arm_error_m, varied.closure_error_m) == (shipped.arm_error_m, shipped.closure_error_m)
    assert spent_s > 0.0


def test_mass_on_the_wrists_is_the_tool_s():
    plain, moved = (tracking.with_wrists(PickerParameters(), share).parts[0].robot for share in (0.0, 0.4))
    assert mass_kg(moved) == pytest.approx(mass_kg(plain), abs=1e-12)
    assert [link.mass_kg for link in moved.links[-2:]] == pytest.approx([0.3, 0.3])
    lighter, _ = tracking.run(tracking.SHIPPED._replace(on_wrists=0.4), True)
    assert lighter.closure_error_m < measure_tracking().closure_error_m


def test_a_stroke_is_as_long_and_as_fast_as_it_says():
    places = tracking.stroke(960.0)
    assert places[[0, -1]] == pytest.approx([-0.075, 0.075], abs=1e-9)
    assert np.diff(places, 2).max() * 960.0**2 == pytest.approx(10.0, rel=1e-3)


def test_one_limit_costs_more_where_motors_are_weaker():
    found = columns(tracking.limits(argparse.Namespace()), 0, 1, 2)
    assert [row[:2] for row in found] == [("transplanter", "x0.5"), ("transplanter", "x0.25"), ("sorter", "x0.25")]
    half, quarter, _ = (float(row[2]) for row in found)
    assert 0.0 < half < quarter


def test_the_room_of_a_tool_ends_where_it_is_refused():
    (laser, up, down), (hoe, _, _) = columns(ground.room(argparse.Namespace()), 0, 1, 2)
    assert (laser, hoe) == ("laser", "hoe")
    for setting, usual_m, way in (("crop_height_m", 0.05, up), ("frame_m", 0.0, down)):
        name = f"scenario.bed.{setting}"
        override(WeedingConfig(), {name: usual_m + 1e-3 * int(way)})
        with pytest.raises(ConfigError):
            override(WeedingConfig(), {name: usual_m + 1e-3 * (int(way) + 1)})


def test_one_line_of_wheels_pitches_as_two_points_of_its_waves_do():
    """On 2,000 m of class C, drawn anew here."""
    waves = np.linspace(0.05, 3.5, 3_001)[1:]
    step = waves[1] - waves[0]
    size = np.sqrt(2.0 * 256e-6 * (waves / 0.1) ** -2.0 * step)
    phase = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, len(waves))
    along = np.arange(0.0, 2_000.0, 1.7)
    wheels = [(size * np.sinc(0.1 * waves) * np.cos(2.0 * np.pi * (along[:, None] + at) * waves + phase)).sum(axis=1)
              for at in (0.0, 1.1)]  # fmt: skip
    pitch_deg = np.degrees(((wheels[1] - wheels[0]) / 1.1).std())
    (told,) = [float(row[1]) for row in columns(ground.line(argparse.Namespace()), 0, 1) if row[0] == "C"]
    assert told == pytest.approx(pitch_deg, rel=0.05)


def test_level_fields_are_those_of_field_without_their_ground():
    rough, level = (drive_errors.played("LaserWeeding", False, 2, "analytic", flat)[0] for flat in (False, True))
    assert (level > rough).all()
