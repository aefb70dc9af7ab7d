"""What a field does not say is filled in, and what does not fit the machine is refused by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...kernels.elementary import exp
from ..field import ABSENT, Camera, Flags, Whole, repeated
from .batch import Batch, places, stack, stop_centres, unstack
from .config import OPEN_STAGES, PerceptionModel, SafflowerConfig, ScenarioConfig
from .drawing import SIZE_SHARE, SPREAD_SIGMA
from .field import SPREAD_M, Heads, Plants, Reports, SafflowerField
from .sighting import Sight, draw_tracks

MOST_SIGMAS = 3.0
"""Sizes farther from the mean say no more of a head's mass."""
_LEAST_HEIGHT_M = 0.1


def completed(
    config: SafflowerConfig,
    sight: Sight | None,
    perception: PerceptionModel | None,
    field: SafflowerField,
    generator: np.random.Generator,
) -> SafflowerField:
    """A field with nothing missing that fits into the rules.

    Reports that another camera made are drawn anew; a field for a camera that renders holds none.

    Args:
        config: the task's numbers.
        sight: what reports are drawn from, None where pictures are rendered.
        perception: the statistical camera, None where pictures are rendered.
        field: every value in its column's range; only what the task fills in is missing.
        generator: draws reports where there are none.

    Raises:
        FieldError: something lies outside the row, is there twice, or there is too much of it.
    """
    plants = _whole_plants(config, field)
    heads = _whole_heads(config, field.heads, plants)
    _fits(config, heads, len(plants), field.reports)
    field = replace(field, heads=heads, plants=plants)
    if sight is None or perception is None:
        return replace(field, reports=None, camera=None)
    own = Camera.of(perception)
    if field.reports is not None and (field.camera is None or field.camera.code.tolist() == own.code.tolist()):
        return field
    bare = stack(config, [replace(field, reports=None)])
    uniform, normal = sight.random_numbers(bare.heads.exists.shape[1])
    tracks = draw_tracks(sight, bare.heads, generator.random((1, uniform)), generator.standard_normal((1, normal)))
    reports = unstack(Batch(bare.heads, bare.plants, tracks), perception)[0].reports
    assert reports is not None
    # In a batch heads stand in the order of their slots; the last entry stands for the head -1: none.
    row = np.append(np.argsort(heads.slot), ABSENT)
    return replace(field, reports=replace(reports, head=row[reports.head]), camera=own)


def _whole_plants(config: SafflowerConfig, field: SafflowerField) -> Plants:
    """The plants, synthesised where there are none; height and crown as their heads need them."""
    scenario, plants = config.scenario, field.plants
    if plants is not None:
        plants.keep_to("plants", scenario.plants, "raise scenario.plants")
    if plants is None or len(plants) == 0:
        along = scenario.pitch_m * (np.arange(scenario.plants) + (0.0 if scenario.potted else 0.5))
        bare = Plants.empty(len(along))
        plants = replace(bare, along_m=along, across_m=np.zeros(len(along)), up_m=np.full(len(along), np.nan))
    on, heads = _nearest(field.heads, plants), field.heads
    usual = scenario.plant_height_m[1 if scenario.potted else 0]
    top, width = np.full(len(plants), usual), np.full(len(plants), scenario.crown_m[0])
    for plant in range(len(plants)):
        up, along = heads.up_m[on == plant], heads.along_m[on == plant]
        if len(up):
            top[plant] = up.max()
            width[plant] = np.clip(2.0 * np.abs(along - plants.along_m[plant]).max(), *scenario.crown_m)
    # Pots stand on blocks where their plants are too short for the height of the heads.
    lift = np.maximum(top - scenario.plant_height_m[1], 0.0) if scenario.potted else np.zeros(len(plants))
    plants = plants.given(up_m=lift, crown_m=width)
    return plants.given(height_m=np.maximum(top - plants.up_m, _LEAST_HEIGHT_M))


def _nearest(heads: Heads, plants: Plants) -> Whole:
    """The plant of each head: its own, else the nearest along the row."""
    nearest = np.abs(heads.along_m[:, None] - plants.along_m).argmin(axis=1)
    return np.where(heads.plant < 0, nearest, heads.plant)


def _whole_heads(config: SafflowerConfig, heads: Heads, plants: Plants) -> Heads:
    """Heads with a plant, a slot and a mass, which goes with the size as it does where fields are drawn."""
    sigmas = np.clip((heads.size_m / SPREAD_M - 1.0) / SPREAD_SIGMA, -MOST_SIGMAS, MOST_SIGMAS)
    usual = config.head_mass_g * exp(config.head_mass_spread * SIZE_SHARE * sigmas)
    slot = heads.slot.copy()
    free = np.setdiff1d(np.arange(len(heads) + len(slot)), slot)
    slot[heads.slot < 0] = free[: np.count_nonzero(heads.slot < 0)]
    return replace(heads.given(mass_g=np.where(_open(heads), usual, 0.0)), plant=_nearest(heads, plants), slot=slot)


def _open(heads: Heads) -> Flags:
    return np.isin(heads.stage, OPEN_STAGES)


def row_limits_m(scenario: ScenarioConfig) -> tuple[float, float]:
    """Where along the row heads may be: half a crown beyond the outer stops' windows."""
    centres, margin = stop_centres(scenario), 0.5 * (scenario.window_m + scenario.crown_m[1])
    return float(centres[0] - margin), float(centres[-1] + margin)


def _fits(config: SafflowerConfig, heads: Heads, plants: int, reports: Reports | None) -> None:
    scenario = config.scenario
    slots = scenario.plants * scenario.max_heads
    heads.keep_to("heads", slots, "raise scenario.max_heads or scenario.plants")
    heads.keep_within("heads", "along_m", *row_limits_m(scenario), "row")
    laden = ~_open(heads) & (heads.mass_g > 0.0)
    heads.refuse("heads", laden, "mass_g", "only open heads bear filaments, give 0 g")
    heads.refuse("heads", heads.plant >= plants, "plant", f"give 0 to {plants - 1}")
    heads.refuse("heads", heads.slot >= slots, "slot", f"give 0 to {slots - 1}, or leave it out")
    heads.refuse("heads", repeated(heads.slot[:, None]), "slot", "another head has it, leave it out")
    heads.refuse("heads", repeated(places(heads)), "along_m", "another head stands there, leave one out")
    if reports is not None:
        reports.keep_to("reports", scenario.max_tracks, "raise scenario.max_tracks")
        beyond = reports.head >= len(heads)
        reports.refuse("reports", beyond, "head", f"there are {len(heads)} heads, counted from 0")
