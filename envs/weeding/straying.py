"""What ground, wheels and odometry do to tracks from the front camera to the tool; see ``shaking``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...kernels import compiled
from ..core import Array
from ..shaking import Shape, U, at_line, believed
from .config import FieldTask
from .field import Profile
from .ground import shape_of, surface_of

NOWHERE_M = 3.0
"""A tool camera that sees nothing "sees" it this far beside the row: beyond any gate."""
WHOLE_M = 0.03
"""Plants farther than this from the picture's edges are in the picture as a whole, most of them."""
LOOKS = 6
"""Pictures that show a plant, evenly from its coming into view until it leaves it."""
_LEVEL = Shape(0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0)


class Carrying(NamedTuple):
    """How R worlds carry tracks from the front camera to the tool.

    Attributes:
        surface: (R, S, 7), the grounds; no rows where frames stand level or everything is seen as it is.
        shape: see ``Shape``.
        drift_m: (R,), what the odometry errs by from the camera's view to the tool beyond what the ground says.
        told: whether the ground says all of it; else the cameras' statistics add theirs.
        ahead_m: camera before the tool's middle.
        eye_m: its height.
        half_view_m: half the length of ground in which it takes plants as a whole.
        unseen_m: way from the camera's last picture of a plant to the tool.
        after: whether the tool camera looks after the move.
        camera: whether a tool that has one uses it.
    """

    surface: Array
    shape: Shape
    drift_m: Array
    told: bool
    ahead_m: float
    eye_m: float
    half_view_m: float
    unseen_m: float
    after: bool
    camera: bool

    @classmethod
    def level(cls, worlds: int) -> Carrying:
        """Over planes, with what the cameras' statistics say of the odometry."""
        nothing = np.zeros((worlds, 0, len(U)))
        return cls(nothing, _LEVEL, np.zeros(worlds), False, 0.0, 1.0, 0.0, 0.0, False, True)

    @classmethod
    def of(cls, config: FieldTask, profiles: Sequence[Profile], looks: Array, all_seen: bool) -> Carrying:
        """Over grounds, none where they are planes, of strips with these lucks (R,).

        Where everything is seen as it is, only the tool is put wrong.
        """
        ground, cart, worlds = config.scenario.ground, config.cart, len(looks)
        carrying = cls.level(worlds)._replace(after=bool(ground.uneven), camera=bool(ground.tool_camera))
        if all_seen:
            return carrying
        if ground.drift_share is not None:
            # The profile says it, with the slip.
            carrying = carrying._replace(told=True)
        if not profiles:
            return carrying
        return carrying._replace(
            surface=surface_of(config, profiles),
            shape=shape_of(config),
            ahead_m=float(cart.camera_ahead_m),
            eye_m=float(config.eye_m),
            half_view_m=0.5 * cart.camera_view_m - WHOLE_M,
            unseen_m=float(cart.unseen_m),
        )


@compiled
def strayed(carrying: Carrying, r: int, along_m: float, across_m: float) -> tuple[float, float]:
    """How far along and across from a plant of a world the front camera and slipping wheels put its track."""
    surface, shape, half = carrying.surface[r], carrying.shape, carrying.half_view_m
    x, y = 0.0, 0.0
    for look in range(LOOKS):
        cart = along_m - carrying.ahead_m + half * ((2.0 * look + 1.0) / LOOKS - 1.0)
        seen = believed(surface, shape, cart, carrying.ahead_m, carrying.eye_m, along_m, across_m)
        x += seen[0] / LOOKS
        y += seen[1] / LOOKS
    slipped = at_line(surface, shape, U.slip, along_m) - at_line(surface, shape, U.slip, along_m - carrying.unseen_m)
    return x - along_m + slipped, y - across_m
