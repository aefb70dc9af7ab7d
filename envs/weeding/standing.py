"""One strip's ground as pictures need it: how high plants stand, and where a shaken frame's cameras really are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core import Array
from ..shaking import Shape, U, at_line, carried, frame_at, heights_at


class Standing(NamedTuple):
    """The ground of a world whose frame shakes, see ``shaking``.

    Pictures paint bare ground as a plane that hides what is below it: everything is lifted until nothing is.
    """

    surface: Array
    shape: Shape

    @property
    def lift_m(self) -> float:
        """By how much places are higher in pictures than in the rules."""
        return -float(self.surface[:, U.left : U.right + 1].min())

    def heights_m(self, places_m: Array) -> Array:
        """Heights (n,) of the ground at places (n, 2)."""
        return heights_at(self.surface, self.shape, np.ascontiguousarray(places_m, np.float64)) + self.lift_m

    def put(self, cart_m: float, point_m: Array) -> Array:
        """Where a point (3,) of the frame really is that would be at ``point_m`` in the world if it stood level."""
        frame = frame_at(self.surface, self.shape, cart_m)
        ahead, beside, high = float(point_m[0]) - cart_m, float(point_m[1]), float(point_m[2])
        x, y, z = carried(frame, self.shape.pivot_m, cart_m, ahead, beside, high)
        return np.array([x, y, z + self.lift_m])

    def slipped_m(self, from_m: float, to_m: float) -> float:
        """Way that slipping wheels have the odometry count too much between two places of the cart."""
        return at_line(self.surface, self.shape, U.slip, to_m) - at_line(self.surface, self.shape, U.slip, from_m)
