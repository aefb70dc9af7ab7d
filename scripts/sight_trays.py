"""What the transplanter's cameras lose: the part of ``sight_budget`` that knows cells."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldgym.envs.transplanting.config import EMPTY, HEALTHY, POOR
from fieldgym.envs.transplanting.scene import HEALTHY_SIZES, looks_of
from fieldgym.scripts.sight_losses import RIGHT, Sights


class TraySights(Sights):
    """Between the row cameras and the transplanter's rules."""

    categories = (
        "poor, as green and as large as the smallest healthy ones",
        "poor, smaller, called healthy",
        "poor, yellow, called healthy",
        "healthy, called poor",
        "seedling, called empty",
        "empty, called a seedling",
    )
    given = categories[:1]

    def receive(self, row: int, *reports: Any) -> None:
        """See ``Sights``."""
        state, told = self.core.state, []
        sides = (
            (state.source_cells, self.core.source_looks, state.source_row),
            (state.target_cells, self.core.target_looks, state.target_row),
        )
        for due, report, (cells, looks, presented) in zip(state.look_due[row].tolist(), reports, sides, strict=True):
            mended = np.array(report)
            if due:
                truth = cells[row, int(presented[row])]
                for i, name in enumerate(self._categories(truth, report, looks[row, int(presented[row])])):
                    self.counts[name] += 1
                    if name in self.right:
                        mended[i] = truth[i]
            told.append(mended)
        self._receive(row, *told)

    def _categories(self, truth: NDArray[np.int8], report: NDArray[np.int8], look: NDArray[np.float64]) -> list[str]:
        names = self.categories
        size, yellow = looks_of(truth, look)
        found = []
        for i in range(len(truth)):
            true, told = int(truth[i]), int(report[i])
            if true == told:
                found.append(RIGHT)
            elif true == EMPTY:
                found.append(names[5])
            elif told == EMPTY:
                found.append(names[4])
            elif true == HEALTHY:
                found.append(names[3])
            elif true == POOR:
                small = size[i] < min(HEALTHY_SIZES)
                found.append(names[2] if yellow[i] else names[1] if small else names[0])
            else:
                found.append(RIGHT)
        return found
