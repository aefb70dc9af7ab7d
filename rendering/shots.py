"""What people ask of a picture, and from where a scene answers."""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import ArrayLike

MACHINE = "machine"
"""The camera that every scene has: the whole machine at its work."""


class Shot(NamedTuple):
    """The picture for people that is asked for; of a size that is None the scene's own."""

    width: int | None = None
    height: int | None = None
    camera: str = MACHINE

    def sized(self, usual_px: tuple[int, int]) -> tuple[int, int]:
        """Width and height in pixels; what is given by half keeps the shape of the usual picture."""
        wide, high = usual_px
        width = self.width or (wide if self.height is None else round(self.height * wide / high))
        return width, self.height or round(width * high / wide)


class Viewpoint(NamedTuple):
    """From where people are shown a scene.

    Attributes:
        eye: (3,), metres.
        middle: (3,), what is in the middle of the picture.
        lit_about: (3,), the middle of what throws shadows.
        view_rad: how much is shown from top to bottom.
        up: (3,), direction of the picture's top.
    """

    eye: ArrayLike
    middle: ArrayLike
    lit_about: ArrayLike
    view_rad: float
    up: ArrayLike = (0.0, 0.0, 1.0)
