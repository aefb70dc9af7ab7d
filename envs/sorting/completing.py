"""What a stream that somebody wrote down lacks, and what of it does not fit the machine."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..core import Array
from ..field import FieldError
from .config import ProduceConfig, SortingConfig
from .drawing import FRUIT, CameraModel, centre_height_m
from .field import Items, ProduceField, Reports, Sensor

TableT = TypeVar("TableT", Items, Reports)

_SAME_M = 1e-3
"""Two items this near to each other are one that was written down twice."""


def completed(
    field: ProduceField, config: SortingConfig, camera: CameraModel, code: int, generator: np.random.Generator
) -> ProduceField:
    """The field with what only the task knows; the reports, if it has any, are those of the camera ``code``."""
    items = _sized(field.items, config.produce)
    usual = _ripeness(items.grade, config.produce)
    slips = config.belt.slip_sigma_m * generator.standard_normal((2, len(items)))
    items = items.given(ripeness=usual, slip_along_m=slips[0], slip_across_m=slips[1])
    items = items.given(skin=items.ripeness)
    reports = field.reports
    if reports is not None:
        reports = _sized(reports, config.produce).given(seen_s=reports.passing_s + camera.report_s)
    sensor = field.camera if field.camera is not None else Sensor.empty(1)
    if len(sensor) != 1:
        raise FieldError(f"camera has {len(sensor)} rows: give one, or none")
    seed = sensor.given(noise_seed=generator.integers(2**52)).noise_seed
    return ProduceField(items, reports, Sensor(seed, np.array([code])))


def window(config: SortingConfig, most_items: int) -> dict[str, tuple[float, float]]:
    """When items may pass the machine's middle, and where across the belt they may lie."""
    belt, scenario = config.belt, config.scenario
    longest = max(config.produce.tuber_length_m[1], config.produce.fruit_length_m[1])
    # Where a stream is dense, items wait for each other: none longer than all before it are.
    latest = max(scenario.time_limit_s, scenario.stream_s + (most_items * longest - belt.start_x_m) / belt.speed_m_s)
    return {
        "passing_s": (-belt.exit_x_m / belt.speed_m_s, latest),
        "across_m": (-0.5 * belt.width_m, 0.5 * belt.width_m),
    }


def check_fit(field: ProduceField, config: SortingConfig, most_items: int, most_reports: int) -> None:
    """Refuse what lies beside the belt or comes too late, what stands there twice, and what there is no room for.

    Args:
        field: complete.
        config: the task's numbers.
        most_items: room for items.
        most_reports: room for reports.

    Raises:
        FieldError: one line, with the row.
    """
    items, belt = field.items, config.belt
    items.keep_to("items", most_items, "raise load or stream_s of the scenario")
    limits = window(config, most_items)
    items.keep_within("items", "across_m", *limits["across_m"], "belt")
    items.keep_within("items", "passing_s", *limits["passing_s"], "episode")
    order = np.lexsort((items.across_m, items.passing_s))
    along, across = np.diff(items.passing_s[order]) * belt.speed_m_s, np.diff(items.across_m[order])
    twice = np.flatnonzero((along < _SAME_M) & (np.abs(across) < _SAME_M))
    if len(twice):
        one, other = sorted((int(order[twice[0]]), int(order[twice[0] + 1])))
        raise FieldError(f"lies where items {one + 1} does: leave one of them out", "items", other, "passing_s")
    if field.reports is not None:
        field.reports.keep_to("reports", most_reports, "raise load or stream_s of the scenario")
        beyond = field.reports.item >= len(items)
        field.reports.refuse("reports", beyond, "item", f"give 0 to {len(items) - 1}, the row of an item")


def _sized(table: TableT, produce: ProduceConfig) -> TableT:
    """A table with sizes, and the heights that follow from them."""
    sizes = np.array([_size(grade, produce) for grade in range(4)])[table.grade].reshape(-1, 3)
    table = table.given(length_m=sizes[:, 0], width=sizes[:, 1], thickness=sizes[:, 2])
    columns = table.length_m, table.width, table.thickness, table.yaw_rad, table.tilt_rad, table.azimuth_rad
    return table.given(up_m=np.array([centre_height_m(*shape) for shape in zip(*columns, strict=True)]))


def _size(grade: int, produce: ProduceConfig) -> tuple[float, float, float]:
    """Mean length, width and thickness of a grade."""
    if grade // 2 == FRUIT:
        (low, high), width = produce.fruit_length_m, float(np.mean(produce.fruit_width))
    else:
        (low, high), width = produce.tuber_length_m, float(np.mean(produce.tuber_width))
        limit = min(max(produce.ware_from_m, low), high)
        low, high = (limit, high) if grade == 0 else (low, limit)
    return 0.5 * (low + high), width, width * float(np.mean(produce.thickness))


def _ripeness(grade: NDArray[np.int64], produce: ProduceConfig) -> Array:
    """Mean ripeness of grades; tubers have none that counts."""
    return np.array([0.5, 0.5, 0.5 + 0.5 * produce.ripe_from, 0.5 * produce.ripe_from])[grade]
