"""What the picker's camera loses: the part of ``sight_budget`` that knows heads."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from fieldgym.envs.pairing import nearest_pairs
from fieldgym.envs.safflower.batch import fixed_order
from fieldgym.envs.safflower.view import MATCH_RADIUS_M
from fieldgym.perception.blooms import BloomSettings, filament_mask
from fieldgym.scripts.sight_losses import RIGHT, Sights

HIDDEN, PARTLY = 0.1, 0.7
"""A tuft of which a smaller share shows is hidden; one of which less than this shows, partly."""
_WHOLE_M2, _SPREAD_M = 1.08e-3, 0.04785
"""Filaments of an average tuft from above, nothing over them, and its spread."""
OFF_M = 0.005
FALSE = "false: nothing there, or said twice"


class Heads(NamedTuple):
    """The heads about a stop, n of them.

    Attributes:
        number: (n,), in the world's arrays.
        place: (n, 3), world metres.
        share: (n,), of its filaments that the picture shows.
        touches: (n,), whether it touches another one's in the picture.
    """

    number: NDArray[np.int64]
    place: NDArray[np.float64]
    share: NDArray[np.float64]
    touches: NDArray[np.bool_]


class PickerSights(Sights):
    """Between the picker's camera and its rules."""

    categories = (
        f"hidden: less than {100 * HIDDEN:.0f} % of it shows",
        f"missed, {100 * HIDDEN:.0f}-{100 * PARTLY:.0f} % of it shows",
        "missed, touches another",
        "missed, alone",
        f"place off by more than {1e3 * OFF_M:.0f} mm",
        f"place off by 2-{1e3 * OFF_M:.0f} mm",
        "stage misread",
        FALSE,
    )
    given = categories[:1]

    def __init__(self, env: Any):
        """Remember what every stop of every field shows."""
        super().__init__(env)
        self._shown: dict[tuple[int, int], Heads] = {}

    def receive(self, row: int, *reports: Any) -> None:
        """See ``Sights``."""
        position, stage, size, head = reports
        core, stop = self.core, int(self.core.state.stop[row])
        if (self.field, stop) not in self._shown:
            self._shown[self.field, stop] = self._heads(row)
        heads = self._shown[self.field, stop]
        pairs = {
            int(heads.number[j]): i
            for i, j in nearest_pairs(np.linalg.norm(position[:, None] - heads.place[None], axis=-1), MATCH_RADIUS_M)
        }
        half, centre = 0.5 * core.config.scenario.window_m, core.tables.stop_pose[stop, 0]
        said = [(position[i], stage[i], size[i], head[i]) for i in range(len(position))]
        dropped, added = set(), []
        for j, number in enumerate(heads.number.tolist()):
            report = pairs.get(number)
            if report is None and abs(heads.place[j, 0] - centre) > half:
                continue
            name = self._category(heads, j, report, position, stage)
            self.counts[name] += 1
            if name in self.right:
                dropped |= set() if report is None else {report}
                exact = int(core.state.head_stage[row, number]), float(core.head_size_m[row, number])
                added.append((heads.place[j], *exact, number))
        false = set(range(len(said))) - set(pairs.values())
        self.counts[FALSE] += len(false)
        if FALSE in self.right:
            dropped |= false
        told = [one for i, one in enumerate(said) if i not in dropped] + added
        place = np.array([one[0] for one in told]).reshape(-1, 3)
        order = fixed_order(core.config, place[None], np.ones((1, len(place)), bool))[0][0]
        rest = (np.array([one[k] for one in told], kind) for k, kind in ((1, np.int64), (2, float), (3, np.int64)))
        self._receive(row, place[order], *(column[order] for column in rest))

    def _category(self, heads: Heads, j: int, report: int | None, position: Any, stage: Any) -> str:
        names = self.categories
        if report is None:
            if heads.share[j] < HIDDEN:
                return names[0]
            return names[1] if heads.share[j] < PARTLY else names[2] if heads.touches[j] else names[3]
        off_m = float(np.hypot(*(position[report] - heads.place[j])[:2]))
        if stage[report] != self.core.state.head_stage[0, heads.number[j]]:
            return names[6]
        return names[4] if off_m > OFF_M else names[5] if off_m > 0.002 else RIGHT

    def _heads(self, row: int) -> Heads:
        """Look at the stop once more, with names to the pixels."""
        core, scene = self.core, self.env.view._scene
        there = np.flatnonzero(core.head_exists[row])
        p, look = scene.parameters, scene.look()
        eye = np.array([scene._cart_x_m + p.camera_ahead_m, 0.0, p.motor_height_m + p.camera_above_motors_m])
        identity = scene.stage.seen(scene._eye, eye, eye - np.array([0.0, 0.0, 1.0]), (0.0, 1.0, 0.0)).identity
        identity = np.where(filament_mask(look.rgb, look.depth_m, BloomSettings())[0] > 0, identity, -1)
        pixel_m2 = (look.depth_m / look.camera.intrinsics[0, 0]) ** 2
        some = identity >= 0
        area = np.bincount(identity[some], weights=pixel_m2[some], minlength=len(there))[: len(there)]
        share = area / (_WHOLE_M2 * (core.head_size_m[row, there] / _SPREAD_M) ** 2)
        touches = np.zeros(len(there), bool)
        for j in np.flatnonzero(area).tolist():
            own = (identity == j).astype(np.uint8)
            around = cv2.dilate(own, np.ones((5, 5), np.uint8)) > own
            touches[j] = (identity[around] >= 0).any()
        blooms = core.state.head_stage[row, there] > 0
        places = core.state.head_position[row, there] + core.frame
        return Heads(there[blooms], places[blooms], share[blooms], touches[blooms])
