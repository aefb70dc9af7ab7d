"""What a field does not say is filled in, and what does not fit the strip is refused by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..field import Array, Camera, FieldError, TableT, repeated
from .batch import places, stack, unstack
from .config import FieldTask, ScenarioConfig
from .field import Crops, Ground, Profile, Reports, WeedField, Weeds
from .gaps import crop_gaps
from .ground import draw_profile
from .sighting import Cameras, draw_tracks
from .straying import Carrying

REAL_M = 0.02
"""A track has a weed behind it when one stands this near to where it is shot at."""


def completed(
    config: FieldTask,
    cameras: Cameras | None,
    camera: Camera | None,
    field: WeedField,
    generator: np.random.Generator,
    carrying: Callable[[Sequence[Profile], Array], Carrying],
) -> WeedField:
    """A field with nothing missing that fits into the rules, everything sorted along the row.

    Reports that another camera made are drawn anew; a field for a camera that renders holds none.

    Args:
        config: the task's numbers.
        cameras: the statistical cameras, None where pictures are rendered.
        camera: their sign in fields.
        field: every value in its column's range; only what the task fills in is missing.
        generator: draws what is drawn.
        carrying: says how tracks are carried to the tool, of the ground and the strip's luck.

    Raises:
        FieldError: something lies outside the strip, is there twice, or there is too much of it.
    """
    scenario = config.scenario
    _check_weeds(scenario, field.weeds)
    ground = field.ground if field.ground is not None and len(field.ground) else Ground.empty(1).filled(generator)
    if len(ground) > 1:
        raise FieldError(f"{len(ground)} rows: the ground has one, leave the others out", "ground", 1)
    crops = _whole_crops(scenario, field.crops, generator)
    bare = WeedField(_along(field.weeds), _along(crops), ground, profile=_whole_profile(config, field.profile, ground))
    if cameras is None:
        return bare
    assert camera is not None
    if field.reports is not None and (field.camera is None or field.camera.code.tolist() == camera.code.tolist()):
        return replace(bare, reports=_whole_reports(config, cameras, bare, field.reports), camera=field.camera)
    uniform, normal = cameras.random_numbers(scenario.max_weeds)
    whole = stack(scenario, 0, [bare])
    luck = generator.random((1, uniform)), generator.standard_normal((1, normal))
    tracks = draw_tracks(cameras, whole.plants, *luck, carrying(whole.profiles, whole.plants.ground_look))
    return unstack(whole._replace(tracks=tracks), camera)[0]


def window(scenario: ScenarioConfig) -> dict[str, tuple[float, float]]:
    """Where weeds may stand, along and across."""
    return {"along_m": (0.0, scenario.strip_m), "across_m": (-0.5 * scenario.band_m, 0.5 * scenario.band_m)}


def _check_weeds(scenario: ScenarioConfig, weeds: Weeds) -> None:
    weeds.keep_to("weeds", scenario.max_weeds, "raise scenario.max_weeds")
    for (name, limits), what in zip(window(scenario).items(), ("strip", "band"), strict=True):
        weeds.keep_within("weeds", name, *limits, what)
    weeds.refuse("weeds", repeated(places(weeds)), "along_m", "another weed stands there, leave one out")


def _whole_crops(scenario: ScenarioConfig, crops: Crops | None, generator: np.random.Generator) -> Crops:
    """The crop rows; without any the scenario's, every plant in its place."""
    room, pitch = scenario.crops, scenario.crop_pitch_m
    if crops is None:
        rows = scenario.bed.rows
        along = pitch * (np.repeat(np.arange(room // rows, dtype=np.float64), rows) - 0.5)
        return Crops(along, np.tile(scenario.rows_m, room // rows), np.full(room, np.nan)).filled(generator)
    crops.keep_to("crops", room, "lower scenario.crop_pitch_m")
    crops.keep_within("crops", "along_m", -pitch, scenario.strip_m + 2.0 * pitch, "row")
    crops.refuse("crops", repeated(places(crops)), "along_m", "another crop plant stands there, leave one out")
    return crops


def _whole_profile(config: FieldTask, profile: Profile | None, ground: Ground) -> Profile | None:
    """The ground's heights, drawn where the scenario's ground is not level and the field says none."""
    if not config.scenario.ground.uneven:
        if profile is not None:
            raise FieldError(
                "the scenario's ground is level: leave the profile out, or give scenario.ground.iso_class or "
                "scenario.ground.second_motion",
                "profile",
            )
        return None
    if profile is None or not len(profile):
        return draw_profile(config, float(ground.look[0]))
    profile.refuse("profile", np.diff(profile.along_m, prepend=-np.inf) <= 0.0, "along_m", "give ascending rows")
    return profile


def _whole_reports(config: FieldTask, cameras: Cameras, bare: WeedField, reports: Reports) -> Reports:
    """Reports that aim where they say and know what is near."""
    scenario = config.scenario
    reports.keep_to("reports", cameras.capacity(scenario.max_weeds), "raise scenario.max_weeds")
    reports.keep_within("reports", "across_m", *window(scenario)["across_m"], "band")
    crop = stack(scenario, 0, [bare]).plants.crop[0]
    reports = reports.given(
        aim_along_m=reports.along_m,
        aim_across_m=reports.across_m,
        crop_gap_m=crop_gaps(crop, places(reports)),
    )
    aim = places(reports, "aim_along_m", "aim_across_m")
    return _along(reports.given(behind=_nearest_m(places(bare.weeds), aim) < REAL_M))


def _nearest_m(places_m: Array, to_m: Array) -> Array:
    """Distance (n,) from each of (n, 2) to the nearest of (m, 2)."""
    offset = to_m[:, None] - places_m[None]
    return np.hypot(*offset.transpose(2, 0, 1)).min(axis=1, initial=np.inf)


def _along(table: TableT) -> TableT:
    """The rows in the order along the row; of equals the first stays the first."""
    along: Array = table.along_m  # type: ignore[attr-defined]
    order = np.argsort(along, kind="stable")
    return type(table)(**{name: values[order] for name, values in table.arrays().items()})
