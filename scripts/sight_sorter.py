"""What the sorter's camera loses: the part of ``sight_budget`` that knows produce."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldgym.envs.sorting.columns import ITEM, REPORT
from fieldgym.envs.sorting.drawing import FRUIT
from fieldgym.envs.sorting.reports import wrapped
from fieldgym.scripts.sight_losses import RIGHT, Sights

_OFF_M, _TILT_RAD, _YAW_RAD = 0.0005, np.radians(3.0), np.radians(3.0)


class SorterSights(Sights):
    """Between the sorter's camera and its rules. It misses nothing: every item is reported."""

    categories = (
        "fruit whose skin has the other grade's colour",
        "fruit misread against its skin's colour",
        "tuber misread",
        f"place off by more than {1e3 * _OFF_M:.1f} mm",
        f"tuber, tilt or long axis off by more than {np.degrees(_TILT_RAD):.0f} degrees",
        f"fruit, tilt off by more than {np.degrees(_TILT_RAD):.0f} degrees",
        "false: nothing there",
    )
    given = categories[:1]

    def __init__(self, env: Any):
        """Remember pictures: they show every item, whatever has been gripped."""
        super().__init__(env)
        seen: dict[tuple[int, int], Any] = {}
        take = env.view.take

        def taken(number: int) -> Any:
            if (self.field, number) not in seen:
                seen[self.field, number] = take(number)
            return seen[self.field, number]

        env.view.take = taken

    def receive(self, row: int, *reports: Any) -> None:
        """See ``Sights``."""
        (told,), kept = reports, []
        for report in told.copy():
            items, number = self.core.items[row], int(report[REPORT.item])
            name = self._category(items[number], report) if number < len(items) - 1 else self.categories[6]
            self.counts[name] += 1
            if name in self.right:
                if name == self.categories[6]:
                    continue
                _put_right(items[number], report, name in self.categories[:3])
            kept.append(report)
        if kept:
            self._receive(row, np.array(kept))

    def _category(self, item: NDArray[np.float64], report: NDArray[np.float64]) -> str:
        names, grade = self.categories, int(item[ITEM.grade])
        fruit = grade // 2 == FRUIT
        if int(report[REPORT.grade]) != grade:
            ripe = item[ITEM.skin] >= self.core.config.produce.ripe_from
            other = fruit and ripe != (grade == 2)
            return names[0] if other else names[1] if fruit else names[2]
        speed = self.core.config.belt.speed_m_s
        off = speed * (report[REPORT.passing_s] - item[ITEM.passing_s]), report[REPORT.across_m] - item[ITEM.across_m]
        if np.hypot(*off) > _OFF_M:
            return names[3]
        lean = [
            one[kind.tilt_rad] * np.array([np.cos(one[kind.azimuth_rad]), np.sin(one[kind.azimuth_rad])])
            for one, kind in ((item, ITEM), (report, REPORT))
        ]
        tilted = np.linalg.norm(lean[1] - lean[0]) > _TILT_RAD
        turned = abs(float(wrapped(report[REPORT.yaw_rad] - item[ITEM.yaw_rad]))) > _YAW_RAD
        if fruit:
            return names[5] if tilted else RIGHT
        return names[4] if tilted or turned else RIGHT


def _put_right(item: NDArray[np.float64], report: NDArray[np.float64], grade: bool) -> None:
    """Write what an item is into its report: its grade, or where and how it lies."""
    if grade:
        report[REPORT.grade] = item[ITEM.grade]
        return
    for name in (
        "passing_s",
        "across_m",
        "up_m",
        "yaw_rad",
        "tilt_rad",
        "azimuth_rad",
        "length_m",
        "width",
        "thickness",
    ):
        report[getattr(REPORT, name)] = item[getattr(ITEM, name)]
