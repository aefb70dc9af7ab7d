"""What a field does not say is filled in, and what does not fit the strip is refused by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..field import Array, Camera, FieldError, Flags, Table, TableT
from .batch import Batch, nearest_crop, places, stack, unstack
from .config import FieldTask, ScenarioConfig
from .drawing import draw_tracks, random_numbers, track_capacity
from .field import Crops, Ground, Reports, WeedField, Weeds
from .perception import PerceptionModel

REAL_M = 0.02
"""A track has a weed behind it when one stands this near to where it is shot at."""


def completed(
    config: FieldTask,
    perception: PerceptionModel | None,
    camera: Camera | None,
    field: WeedField,
    generator: np.random.Generator,
) -> WeedField:
    """A field with nothing missing that fits into the rules, everything sorted along the row.

    Reports that another camera made are drawn anew; a field for a camera that renders holds none.

    Args:
        config: the task's numbers.
        perception: the statistical cameras, None where pictures are rendered.
        camera: their sign in fields.
        field: every value in its column's range; only what the task fills in is missing.
        generator: draws what is drawn.

    Raises:
        FieldError: something lies outside the strip, is there twice, or there is too much of it.
    """
    scenario = config.scenario
    _check_weeds(scenario, field.weeds)
    ground = field.ground if field.ground is not None and len(field.ground) else Ground.empty(1).filled(generator)
    if len(ground) > 1:
        raise FieldError(f"{len(ground)} rows: the ground has one, leave the others out", "ground", 1)
    crops = _whole_crops(scenario, field.crops, generator)
    bare = WeedField(_along(field.weeds), _along(crops), ground)
    if perception is None:
        return bare
    assert camera is not None
    if field.reports is not None and (field.camera is None or field.camera.code.tolist() == camera.code.tolist()):
        return replace(bare, reports=_whole_reports(config, perception, bare, field.reports), camera=field.camera)
    *_, uniform, normal = random_numbers(scenario, perception)
    plants = stack(scenario, 0, [bare]).plants
    luck = generator.random((1, uniform)), generator.standard_normal((1, normal))
    return unstack(Batch(plants, draw_tracks(scenario, config.cart, perception, plants, *luck)), camera)[0]


def window(scenario: ScenarioConfig) -> dict[str, tuple[float, float]]:
    """Where weeds may stand, along and across."""
    return {"along_m": (0.0, scenario.strip_m), "across_m": (-0.5 * scenario.band_m, 0.5 * scenario.band_m)}


def _check_weeds(scenario: ScenarioConfig, weeds: Weeds) -> None:
    if len(weeds) > scenario.max_weeds:
        raise FieldError(
            f"the scenario has room for {scenario.max_weeds} weeds: raise scenario.max_weeds, or leave some out",
            "weeds",
            scenario.max_weeds,
        )
    for (name, (low, high)), words in zip(window(scenario).items(), ("strip", "band"), strict=True):
        values: Array = getattr(weeds, name)
        outside = (values < low) | (values > high)
        _refuse_where(outside, "weeds", weeds, name, f"outside the {words}, give {low:g} to {high:g} m")
    _refuse_where(_repeated(weeds), "weeds", weeds, "along_m", "another weed stands there, leave one out")


def _whole_crops(scenario: ScenarioConfig, crops: Crops | None, generator: np.random.Generator) -> Crops:
    """The crop row; without one the scenario's, every plant in its place."""
    room, pitch = scenario.crops, scenario.crop_pitch_m
    if crops is None:
        along = pitch * (np.arange(room, dtype=np.float64) - 0.5)
        return Crops(along, np.zeros(room), np.full(room, np.nan)).filled(generator)
    if len(crops) > room:
        raise FieldError(
            f"the scenario has room for {room} crop plants: lower scenario.crop_pitch_m, or leave some out",
            "crops",
            room,
        )
    low, high = -pitch, scenario.strip_m + 2.0 * pitch
    outside = (crops.along_m < low) | (crops.along_m > high)
    _refuse_where(outside, "crops", crops, "along_m", f"far from the strip, give {low:g} to {high:g} m")
    _refuse_where(_repeated(crops), "crops", crops, "along_m", "another crop plant stands there, leave one out")
    return crops


def _whole_reports(config: FieldTask, perception: PerceptionModel, bare: WeedField, reports: Reports) -> Reports:
    """Reports that aim where they say and know what is near."""
    scenario = config.scenario
    room, half = track_capacity(scenario, perception), 0.5 * scenario.band_m
    if len(reports) > room:
        raise FieldError(
            f"the scenario has room for {room} reports: raise scenario.max_weeds, or leave some out",
            "reports",
            room,
        )
    beside = np.abs(reports.across_m) > half
    _refuse_where(beside, "reports", reports, "across_m", f"outside the band, give {-half:g} to {half:g} m")
    aim_along = np.where(np.isnan(reports.aim_along_m), reports.along_m, reports.aim_along_m)
    aim_across = np.where(np.isnan(reports.aim_across_m), reports.across_m, reports.aim_across_m)
    crop = stack(scenario, 0, [bare]).plants.crop
    gap = nearest_crop(crop, places(reports)[None])[0]
    aim = np.column_stack([aim_along, aim_across])
    behind = np.where(reports.behind < 0, _nearest_m(places(bare.weeds), aim) < REAL_M, reports.behind)
    return _along(
        replace(
            reports,
            aim_along_m=aim_along,
            aim_across_m=aim_across,
            crop_gap_m=np.where(np.isnan(reports.crop_gap_m), gap, reports.crop_gap_m),
            behind=behind,
        )
    )


def _nearest_m(places_m: Array, to_m: Array) -> Array:
    """Distance (n,) from each of (n, 2) to the nearest of (m, 2)."""
    offset = to_m[:, None] - places_m[None]
    return np.hypot(*offset.transpose(2, 0, 1)).min(axis=1, initial=np.inf)


def _along(table: TableT) -> TableT:
    """The rows in the order along the row; of equals the first stays the first."""
    along: Array = table.along_m  # type: ignore[attr-defined]
    order = np.argsort(along, kind="stable")
    return type(table)(**{name: values[order] for name, values in table.arrays().items()})


def _repeated(table: Table) -> Flags:
    """Rows whose place was there before."""
    again = np.ones(len(table), bool)
    again[np.unique(places(table), axis=0, return_index=True)[1]] = False
    return again


def _refuse_where(wrong: Flags, kind: str, table: Table, column: str, advice: str) -> None:
    """Raise the error for the first row that is wrong."""
    if wrong.any():
        row = int(np.argmax(wrong))
        value, suffix = getattr(table, column)[row], table.columns()[column].suffix
        raise FieldError(f"{column} = {value:.10g}{suffix}: {advice}", kind, row, column)
