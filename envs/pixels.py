"""Pictures as observations: colours, depth, and where in them the slots' candidates are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..kernels.config_kinds import show
from .assembly import choice
from .core import View

OBSERVATIONS = ("features", "pixels", "both")
"""Candidates as numbers, as a picture, or both; the machine's numbers and the mask are in all of them."""
DEFAULT_ROWS = 96
_FEWEST_ROWS, _MOST_ROWS = 16, 1080
_MARK_SHARE = 24
"""A mark's radius is this part of the picture's height, at least two pixels."""


class Shown(NamedTuple):
    """What observations hold.

    Attributes:
        observation: one of ``OBSERVATIONS``.
        rows: height of the pictures.
        depth: whether there is a picture of the depth.
    """

    observation: str = OBSERVATIONS[0]
    rows: int = DEFAULT_ROWS
    depth: bool = False

    @classmethod
    def checked(cls, observation: Any, rows: Any, depth: Any, has_view: bool) -> Shown:
        """From an environment's keywords.

        Raises:
            ValueError: one is unknown or out of range, or the task has nothing to draw with.
        """
        choice("observation", observation, OBSERVATIONS)
        if isinstance(rows, bool) or not isinstance(rows, int | np.integer) or not _FEWEST_ROWS <= rows <= _MOST_ROWS:
            raise ValueError(f"pixel_rows = {show(rows)}: give a whole number in {_FEWEST_ROWS}..{_MOST_ROWS}")
        if not isinstance(depth, bool | np.bool_):
            raise ValueError(f"depth = {show(depth)}: give True or False")
        if observation == OBSERVATIONS[0]:
            if rows != DEFAULT_ROWS or depth:
                raise ValueError('pixel_rows and depth say how pictures are drawn: pass observation="pixels" too')
        elif not has_view:
            raise ValueError(f'observation = {show(observation)}: this task draws nothing, use "features"')
        return cls(str(observation), int(rows), bool(depth))

    @property
    def draws(self) -> bool:
        """Whether there are pictures."""
        return self.observation != OBSERVATIONS[0]


class Pixels:
    """Draws the observations of worlds, each by its own view.

    Attributes:
        spaces: of one world's pictures, by name: ``pixels`` (h, w, 3), ``slots`` (h, w, 1) and perhaps ``depth``
            (h, w, 1), all bytes. ``slots`` has discs about the candidates' reported places, of the value of their mark;
            0 is none, and an earlier slot lies over a later one. ``depth`` is 0 at the nearest and 255 at the farthest
            of the view's ``depth_range_m``.
    """

    def __init__(self, views: Sequence[View[Any]], shown: Shown):
        """Draw with these views."""
        self._views, self._shown = views, shown
        height, width = shown.rows, views[0].sight_width(shown.rows)
        channels = {"pixels": 3, "slots": 1} | ({"depth": 1} if shown.depth else {})
        self.spaces = {name: spaces.Box(0, 255, (height, width, n), np.uint8) for name, n in channels.items()}

    @property
    def marks(self) -> NDArray[np.int64]:
        """See ``View.slot_marks``."""
        return self._views[0].slot_marks()

    def space(self, features: spaces.Dict) -> spaces.Dict:
        """The space of observations, from that of the features."""
        named: dict[str, spaces.Space[Any]] = {**self._kept(features.spaces), **self.spaces}
        return spaces.Dict(named)

    def observe(self, features: dict[str, Any], rows: NDArray[np.bool_] | None = None) -> dict[str, Any]:
        """Observations with their pictures; of worlds that are not among ``rows`` (B,) they are black."""
        n, shown = len(self._views), self._shown
        drawn = {name: np.zeros((n, *(space.shape or ())), np.uint8) for name, space in self.spaces.items()}
        near_m, far_m = self._views[0].depth_range_m
        for row in range(n) if rows is None else np.flatnonzero(rows).tolist():
            sight = self._views[row].sight(shown.rows)
            drawn["pixels"][row] = sight.rgb
            _mark(drawn["slots"][row, :, :, 0], sight.place_px)
            if shown.depth:
                share = (sight.depth_m - np.float32(near_m)) / np.float32(far_m - near_m)
                drawn["depth"][row, :, :, 0] = np.rint(255.0 * np.clip(share, 0.0, 1.0))
        return self._kept(features) | drawn

    def _kept(self, features: dict[str, Any]) -> dict[str, Any]:
        whole = self._shown.observation == "both"
        return {name: part for name, part in features.items() if whole or name != "candidates"}


def _mark(slots: NDArray[np.uint8], place_px: NDArray[np.float64]) -> None:
    """Draw discs about places (m, 2) into a picture (h, w), the first on top."""
    import cv2

    height, width = slots.shape
    radius = max(2, height // _MARK_SHARE)
    for number in range(len(place_px), 0, -1):
        x, y = place_px[number - 1].tolist()
        if -radius <= x < width + radius and -radius <= y < height + radius:
            cv2.circle(slots, (round(x), round(y)), radius, number, -1)


def on_picture(points_m: NDArray[np.float64], intrinsics: Any, world_from_camera: Any) -> NDArray[np.float64]:
    """Columns and rows (n, 2) at which a camera shows world points (n, 3); what is no number stays none."""
    turn, place = world_from_camera[:3, :3], world_from_camera[:3, 3]
    seen = (points_m - place) @ turn
    with np.errstate(all="ignore"):
        return np.stack([intrinsics[i, i] * seen[:, i] / seen[:, 2] + intrinsics[i, 2] for i in (0, 1)], axis=-1)
