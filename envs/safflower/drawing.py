"""Draws fields of safflower: where the heads are, how they bloom, and what a camera would report of them.

Each world hands over one block of uniform and one of normal numbers from its own generator; everything else is array
arithmetic over the worlds, so a world's field does not depend on how many worlds are drawn beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc

from ...kernels.elementary import exp
from ...mechanisms import FiveBar
from ..core import Array
from ..dice import Block, draw_blocks, poisson_table
from .batch import Batch, Heads, Plants, Tracks, fixed_order, stop_centres, unstack
from .config import OPEN_STAGES, PerceptionModel, SafflowerConfig, ScenarioConfig
from .field import SPREAD_M, SafflowerField

_PRIMARY_HEADS = 5
_BATCH_DAYS = 4.5
"""Days between the flowering batches [published: each lasts 4 to 5 days]."""
_FRESH_DAYS, _OPEN_DAYS = 3.0, 6.0
"""Florets open within 3-4 days; filaments are dry and hard after day 6 [published]."""
_FRESH_SHARE = 0.6
"""Share of fresh heads among the open ones that are presented in pots [assumed]."""
SPREAD_SIGMA = 0.078
"""Relative deviation of the filament spread [published: 47.85 +- 3.73 mm]."""
SIZE_SHARE = 0.7
"""Correlation of a head's size with the logarithm of its mass [assumed]."""
_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
_PLAY = 0.5
"""How irregularly the heads of a plant are spread: 0 is a perfect spiral [assumed]."""
_REACH_RESERVE_M = 0.012
"""Room that the potted plants leave to the workspace's edge [assumed: pots are turned to fit]."""
_FALSE_RESERVE = 4.0


@lru_cache(maxsize=32)
def _count_table(scenario: ScenarioConfig) -> NDArray[np.floating]:
    """Cumulative probabilities of 0, 1, ... heads on a plant."""
    counts = np.arange(scenario.max_heads)
    if scenario.dispersion == 0.0:
        return counts / scenario.max_heads
    success = scenario.dispersion / (scenario.dispersion + scenario.mean_heads)
    return betainc(scenario.dispersion, counts + 1.0, success)


def false_table(perception: PerceptionModel, scenario: ScenarioConfig) -> Array:
    """Cumulative probabilities of 0, 1, ... false reports in a row."""
    return poisson_table(perception.false_per_stop * scenario.stops, _FALSE_RESERVE, 1)


@lru_cache(maxsize=8)
def reach_table(bar: FiveBar) -> tuple[Array, Array]:
    """Levels below the motors (ascending) and the half width that the arm reaches there, both in metres."""
    levels = np.arange(-0.60, 0.0, 0.001)
    widths = np.linspace(0.0, 0.5 * bar.base_m, 400)
    grid = np.stack(np.broadcast_arrays(0.5 * bar.base_m + widths, levels[:, None]), axis=-1)
    gap = ~bar.reachable(grid)
    first_gap = np.where(gap.any(axis=1), gap.argmax(axis=1), len(widths))
    return levels, np.where(first_gap > 0, widths[np.maximum(first_gap - 1, 0)], -1.0)


def draw_heads(config: SafflowerConfig, uniform: Array, normal: Array) -> tuple[Heads, Plants]:
    """Grow the plants of R worlds from their random blocks (R, .)."""
    scenario = config.scenario
    u, z = Block(uniform), Block(normal)
    plants, slots = scenario.plants, scenario.max_heads
    shape = (len(uniform), plants * slots)

    table = _count_table(scenario)
    count = np.searchsorted(table, u.take(plants), side="right")
    number = np.arange(slots)
    exists = number < count[..., None]
    along = scenario.pitch_m * (np.arange(plants) + (0.0 if scenario.potted else 0.5))
    low, high = scenario.plant_height_m
    height_u, height_z = u.take(plants), z.take(plants)
    height = low + (high - low) * height_u if scenario.potted else low + high * height_z
    crown = scenario.crown_m[0] + (scenario.crown_m[1] - scenario.crown_m[0]) * u.take(plants)
    lift = high - height if scenario.potted else np.zeros_like(height)
    base = np.zeros((*lift.shape, 3))
    base[..., 0], base[..., 2] = along, lift

    batch = np.minimum((number + _PRIMARY_HEADS - 1) // _PRIMARY_HEADS, 2)
    drop = np.asarray(scenario.head_drop_m)[batch] * u.take(plants, slots)
    up = np.maximum((lift + height)[..., None] - drop, 0.0)
    ahead_u, across_u, turn_u = u.take(plants, slots), u.take(plants, slots), u.take(plants)
    if scenario.potted:
        # Stems of a pot stand apart, left and right in turn, so that no flower hides another (the paper reports none
        # missed), and pots are turned so that the arm reaches every head.
        ahead = crown[..., None] * ((number + 0.25 + 0.5 * ahead_u) / np.maximum(count[..., None], 1) - 0.5)
        half = np.interp(up - scenario.motor_height_m, *reach_table(config.machine.picker.five_bar)) - _REACH_RESERVE_M
        side = 1.0 - 2.0 * (number % 2)
        across = side * (0.35 + 0.65 * across_u) * np.minimum(0.5 * crown[..., None], half)
    else:
        # Heads of a plant keep apart: golden-angle places with some play, the terminal head in the middle.
        share = (number + _PLAY * ahead_u) / np.maximum(count[..., None], 1)
        radius = 0.5 * crown[..., None] * np.sqrt(np.minimum(share, 1.0))
        angle = _GOLDEN_ANGLE * number + 2.0 * np.pi * (turn_u[..., None] + _PLAY * _PLAY * across_u)
        ahead, across = radius * np.cos(angle), radius * np.sin(angle)
    position = np.stack([along[:, None] + ahead, across, up], axis=-1)

    if scenario.potted:
        stage = np.where(u.take(plants, slots) < _FRESH_SHARE, 1, 2)
    else:
        day = scenario.visit_day[0] + (scenario.visit_day[1] - scenario.visit_day[0]) * u.take(1)
        age = day[..., None] - _BATCH_DAYS * batch - z.take(plants)[..., None] - z.take(plants, slots)
        stage = (age > 0.0).astype(np.int64) + (age > _FRESH_DAYS) + (age > _OPEN_DAYS)
    size_z, mass_z = z.take(plants, slots), z.take(plants, slots)
    size = SPREAD_M * (1.0 + SPREAD_SIGMA * size_z)
    spread = config.head_mass_spread
    mix = SIZE_SHARE * size_z + np.sqrt(1.0 - SIZE_SHARE**2) * mass_z
    mass = config.head_mass_g * exp(spread * mix - 0.5 * spread**2)
    is_open = exists & ((stage == OPEN_STAGES[0]) | (stage == OPEN_STAGES[1]))
    occluded = u.take(plants, slots) < scenario.occluded
    return (
        Heads(
            position=np.where(exists[..., None], position, 0.0).reshape(*shape, 3),
            exists=exists.reshape(shape),
            stage=np.where(exists, stage, 0).reshape(shape),
            mass_g=np.where(is_open, mass, 0.0).reshape(shape),
            size_m=size.reshape(shape),
            occluded=(exists & occluded).reshape(shape),
            cut_luck=z.take(*shape[1:]),
            drop_luck=z.take(*shape[1:]),
            plant=np.arange(plants * slots)[None].repeat(len(uniform), axis=0) // slots,
        ),
        Plants(base, height, crown, np.full(len(uniform), plants)),
    )


def draw_tracks(
    config: SafflowerConfig, perception: PerceptionModel, heads: Heads, uniform: Array, normal: Array
) -> Tracks:
    """What the statistical camera reports of R worlds, from random blocks (R, .) of its own."""
    scenario = config.scenario
    u, z = Block(uniform), Block(normal)
    heads_n = heads.exists.shape[1]
    recall = np.asarray(perception.recall)[heads.occluded.astype(np.int64), heads.stage]
    seen = heads.exists & (u.take(heads_n) < recall)
    position = heads.position + np.asarray(perception.bias_m) + np.asarray(perception.sigma_m) * z.take(heads_n, 3)
    limits = np.cumsum(np.asarray(perception.stage_confusion), axis=1)[:, :-1]
    stage_u = u.take(heads_n)
    stage = sum((stage_u > limits[:, column][heads.stage]).astype(np.int64) for column in range(limits.shape[1]))
    size = heads.size_m * (1.0 + perception.size_sigma * z.take(heads_n))

    table = false_table(perception, scenario)
    ghosts = len(table)
    ghost_seen = np.arange(ghosts) < np.searchsorted(table, u.take(1)[:, 0], side="right")[:, None]
    centres = stop_centres(scenario)
    span = scenario.stops * scenario.window_m
    ghost_along = centres[0] - 0.5 * scenario.window_m + span * u.take(ghosts)
    ghost_across = 0.12 * (2.0 * u.take(ghosts) - 1.0)
    top = scenario.motor_height_m + config.machine.clear_level_m
    ghost_up = top - 0.04 - 0.10 * u.take(ghosts)
    ghost_stage = 1 + (u.take(ghosts) > 0.5).astype(np.int64)

    position = np.concatenate([position, np.stack([ghost_along, ghost_across, ghost_up], axis=-1)], axis=1)
    seen = np.concatenate([seen, ghost_seen], axis=1)
    stage = np.concatenate([stage, ghost_stage], axis=1)
    size = np.concatenate([size, np.full(ghost_stage.shape, SPREAD_M)], axis=1)
    order, first = fixed_order(config, position, seen)
    kept = order[:, : scenario.max_tracks]
    place = kept + seen.shape[1] * np.arange(len(seen))[:, None]
    return Tracks(
        position=position.reshape(-1, 3).take(place, axis=0),
        stage=stage.take(place),
        size_m=size.take(place),
        head=np.minimum(kept, heads_n),
        first=np.minimum(first, kept.shape[1]),
    )


def random_numbers(config: SafflowerConfig, perception: PerceptionModel) -> tuple[int, int, int, int]:
    """Lengths of a world's blocks: uniform and normal numbers for the field, then for the camera."""
    plants, heads = config.scenario.plants, config.scenario.plants * config.scenario.max_heads
    ghosts = len(false_table(perception, config.scenario))
    return 4 * plants + 5 * heads + 1, 2 * plants + 5 * heads, 2 * heads + 1 + 4 * ghosts, 4 * heads


def draw_batch(
    config: SafflowerConfig, perception: PerceptionModel | None, generators: Sequence[np.random.Generator]
) -> Batch:
    """A field for each generator, with the reports of a statistical camera where there is one."""
    lengths = random_numbers(config, perception or PerceptionModel.perfect())
    uniform, normal, camera_uniform, camera_normal = draw_blocks(generators, lengths)
    heads, plants = draw_heads(config, uniform, normal)
    if perception is None:
        return Batch(heads, plants, None)
    return Batch(heads, plants, draw_tracks(config, perception, heads, camera_uniform, camera_normal))


def draw(
    config: SafflowerConfig, generator: np.random.Generator, perception: PerceptionModel | None = None
) -> SafflowerField:
    """One field; without a statistical camera it holds no reports."""
    return unstack(draw_batch(config, perception, [generator]), perception)[0]
