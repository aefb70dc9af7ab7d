"""When the filaments of heads wilt, and what a camera tells of that.

The times are those of the field, and are drawn from numbers of their own: what else is drawn is the same whether heads
wilt or not. A batch has them as (R, N, 2): when each head has wilted, and what the statistical camera reads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..core import Array, Rows
from ..field import FieldError
from .config import OPEN_STAGES, STAGES, SafflowerConfig
from .features import C
from .field import Closings, SafflowerField
from .state import D, Worlds

_JUMPS = 3
"""So far ahead of a field's own numbers; those of its stands lie two jumps ahead, those of its drives one."""


def mean_closing_s(config: SafflowerConfig) -> Array:
    """When heads of each stage wilt on average (4,); 0 for those that are not open, infinite where none wilts."""
    first, last = config.scenario.wilting.closes_s
    mean = np.zeros(len(STAGES))
    mean[list(OPEN_STAGES)] = [0.5 * (first + last), 0.75 * first + 0.25 * last] if last > 0.0 else np.inf
    return mean


def last_closing_s(config: SafflowerConfig) -> Array:
    """When the last heads of each stage wilt (4,); all of them from the same time on, evenly."""
    first, last = config.scenario.wilting.closes_s
    ends = np.full(len(STAGES), float(last))
    ends[OPEN_STAGES[1]] = 0.5 * (first + last)
    return ends


def draw_closings(
    config: SafflowerConfig, generators: Sequence[np.random.Generator], stage: NDArray[np.int64]
) -> Array | None:
    """When heads of these stages (R, N) wilt and are read to wilt, (R, N, 2); None where nothing is to be shown.

    Nothing is taken from the generators.
    """
    scenario = config.scenario
    if not scenario.demanding:
        return None
    closings = np.empty((*stage.shape, 2))
    first, last = scenario.wilting.closes_s
    late = np.where(stage == OPEN_STAGES[1], 0.5, 1.0)
    for row, generator in enumerate(generators):
        ahead = np.random.Generator(generator.bit_generator.jumped(_JUMPS))  # type: ignore[attr-defined]
        closings[row, :, 0] = ahead.random(stage.shape[1])
        closings[row, :, 1] = ahead.standard_normal(stage.shape[1])
    closings[..., 0] = first + late * (last - first) * closings[..., 0] if last > 0.0 else np.inf
    closings[..., 1] = np.maximum(closings[..., 0] + scenario.wilting.read_sigma_s * closings[..., 1], 0.0)
    closings[~np.isin(stage, OPEN_STAGES)] = 0.0
    return closings


def put_closings(
    config: SafflowerConfig, worlds: Worlds, rows: Rows, closings: Array, reported: bool, exact: bool
) -> None:
    """Put the closings (R, N, 2) of heads into the worlds ``rows``, whose heads and reports lie there already.

    Args:
        config: the task's numbers.
        worlds: is written.
        rows: of the worlds.
        closings: see ``draw_closings``.
        reported: whether there are reports already.
        exact: whether what is reported is true.
    """
    worlds.head_closes_s[rows, :-1], worlds.head_closes_s[rows, -1] = closings[..., 0], 0.0
    worlds.track_told[rows] = 0.0
    if not reported:
        return
    for row, own in zip(rows, closings, strict=True):
        head = worlds.track_head[row]
        told = np.append(own[:, 0 if exact else 1], 0.0)[head]
        show_closings(config, worlds, row, slice(0, len(head) - 1), told[:-1])


def show_closings(config: SafflowerConfig, worlds: Worlds, row: int, tracks: slice, told: Array | None) -> None:
    """Write what policies are shown of reports of a world: when they wilt, and in which row they stand.

    Args:
        config: the task's numbers.
        worlds: is written.
        row: the world.
        tracks: which reports.
        told: (n,), what was read of the heads behind them, 0 for none; None for the means of their stages alone.
    """
    stage = worlds.track_feature[row, tracks, C.bud : C.bud + len(STAGES)].argmax(axis=1)
    mean = mean_closing_s(config)[stage]
    present = worlds.track_feature[row, tracks, C.present] > 0.0
    if told is not None:
        # What is no head, or is taken for another stage, is thought to be of its stage's mean.
        mean = np.where((told > 0.0) & (mean > 0.0), told, mean)
    worlds.track_told[row, tracks, D.closes] = np.where(present, mean, 0.0)
    scenario = config.scenario
    across = worlds.track_target[row, tracks, 1] - 0.5 * config.machine.picker.five_bar.base_m
    number = across / scenario.row_gap_m + 0.5 * (scenario.rows - 1) if scenario.rows > 1 else 0.0 * across
    place = np.clip(np.rint(number), 0, scenario.rows - 1) / max(scenario.rows - 1, 1)
    worlds.track_told[row, tracks, D.row] = np.where(present, place, 0.0)


def closings_of(fields: Sequence[SafflowerField], slots: int) -> Array | None:
    """The batch (R, N, 2) of fields in which nothing is missing; None where nothing wilts."""
    if any(one.closings is None for one in fields):
        return None
    closings = np.zeros((len(fields), slots, 2))
    for row, one in enumerate(fields):
        assert one.closings is not None
        closings[row, one.heads.slot] = np.column_stack([one.closings.closes_s, one.closings.told_s])
    return closings


def with_closings(fields: Sequence[SafflowerField], closings: Array | None) -> list[SafflowerField]:
    """The fields of a batch with their closings."""
    if closings is None:
        return list(fields)
    pairs = zip(fields, closings, strict=True)
    return [replace(one, closings=Closings(*own[one.heads.slot].T)) for one, own in pairs]


def whole_closings(config: SafflowerConfig, field: SafflowerField, generator: np.random.Generator) -> Closings | None:
    """The closings of a whole field that was given; drawn where it says nothing, none where nothing wilts.

    Raises:
        FieldError: they are not one a head.
    """
    drawn = draw_closings(config, [generator], field.heads.stage[None])
    if drawn is None:
        return None
    given = field.closings
    if given is None or not len(given):
        return Closings(*drawn[0].T)
    if len(given) != len(field.heads):
        raise FieldError(f"{len(given)} rows: this row has {len(field.heads)} heads, give a row each", "closings", 0)
    return given.given(told_s=given.closes_s)
