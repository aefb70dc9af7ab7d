"""The package's pictures beside those of PyBullet's software renderer: how fast both are, and how equal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike

from fieldgym.perception.frames import Camera, Frame
from fieldgym.rendering.cameras import fall_of_rays, view_of
from fieldgym.rendering.instances import Instances
from fieldgym.rendering.renderer import GroundLook, Look, Renderer, level_colour
from fieldgym.scripts.speed_lines import best_of
from fieldgym.scripts.takes import Take, View
from fieldgym.simulation.stage import Stage
from fieldgym.simulation.tiny import TinyWorld


class Likeness(NamedTuple):
    """How equal two looks at the same scene are; what lies on an edge between two things is left out of the first two.

    Attributes:
        identities: share of pixels that show the same thing.
        depth_m: median difference of depth where both show something.
        depth_99_m: its 99th percentile.
        colours: share of all pixels that have the same colour.
    """

    identities: float
    depth_m: float
    depth_99_m: float
    colours: float


def numbered(things: Instances) -> Instances:
    """The same, each under a number of its own."""
    return things._replace(identity=np.arange(len(things.mesh), dtype=np.int32))


def visible(library: Any, view: View) -> Instances:
    """What may show in a view: the rest only costs PyBullet time."""
    things, meshes = view.things, library.meshes
    scale = np.sqrt(np.square(things.turn).sum(axis=1).max(axis=1))
    middle = np.einsum("nij,nj->ni", things.turn, meshes.centre[things.mesh]) + things.shift
    eye, target, up = (np.asarray(point, np.float64) for point in (view.eye, view.target, view.up))
    return things.where(view.camera.sees(middle, meshes.radius[things.mesh] * scale, eye, target, up))


def times_s(take: Take, repeat: int, repeat_tiny: int) -> tuple[float, float]:
    """CPU seconds of a take as the package takes it, and as PyBullet draws what can show of it."""
    library, view = take.stage.library, take.view
    own_s = best_of(take.draw, repeat)
    # What throws shadows may stand beside the view.
    with TinyWorld(library, view.things if take.people else visible(library, view)) as world:
        return own_s, best_of(lambda: world.look(*view.whence, shadow=take.people), repeat_tiny)


def both(take: Take) -> tuple[Look, Look]:
    """A take by the package and by PyBullet, one sample a pixel, with drawn ground, each thing under its number."""
    things = numbered(take.view.things)
    own = Renderer(take.stage.library).look(things, *take.view.whence)
    with TinyWorld(take.stage.library, things) as world:
        return own, world.look(*take.view.whence)


def likeness(own: Look, other: Look) -> Likeness:
    """How equal two looks are.

    Raises:
        ValueError: fewer than a fifth of the pixels lie off edges.
    """
    shown = own.identity.astype(np.float32)
    off = cv2.dilate(shown, np.ones((3, 3))) == cv2.erode(shown, np.ones((3, 3)))
    if off.mean() < 0.2:
        raise ValueError(f"{off.mean():.0%} of the picture lie off edges: it says nothing, give one of larger things")
    solid = off & (own.identity >= 0) & (other.identity >= 0)
    error = np.abs(own.frame.depth_m - other.frame.depth_m)[solid]
    return Likeness(
        float((own.identity == other.identity)[off].mean()),
        float(np.median(error)),
        float(np.percentile(error, 99)),
        float((own.frame.rgb == other.frame.rgb).all(axis=-1).mean()),
    )


@contextmanager
def by_tiny() -> Iterator[None]:
    """While the block runs, PyBullet draws what the cameras of all stages see; ground is painted on its pictures."""

    def look(
        stage: Stage,
        camera: Camera,
        eye: ArrayLike,
        target: ArrayLike,
        up: ArrayLike,
        *groups: str,
        ground: GroundLook | None = None,
    ) -> Frame:
        seen = visible(stage.library, View(camera, eye, target, up, stage.things(*groups)))
        with TinyWorld(stage.library, seen) as world:
            frame = world.look(camera, eye, target, up).frame
        return frame if ground is None else painted(frame, ground, view_of(camera, eye, target, up))

    own: Callable[..., Any] = Stage.look
    Stage.look = look  # type: ignore[method-assign, assignment]
    try:
        yield
    finally:
        Stage.look = own  # type: ignore[method-assign]


def painted(frame: Frame, ground: GroundLook, view: Any) -> Frame:
    """Ground, shade and noise over a frame that shows none: what the renderer's own kernel does, by NumPy."""
    height, width, _ = frame.rgb.shape
    corner, across, down = fall_of_rays(view)
    column, row = np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)
    fall = (corner + across * column)[None, :] + (down * row)[:, None]
    level = frame.depth_m * fall >= np.float32(frame.camera.world_from_camera[2, 3])
    rgb = np.where(level[..., None], level_colour(ground.colour), frame.rgb).astype(np.float32)
    rgb[:, : ground.shaded] *= np.float32(ground.shade)
    noise = np.random.default_rng(ground.seed).standard_normal((height, width), np.float32)
    rgb += (noise * np.float32(ground.noise))[..., None]
    return frame._replace(rgb=np.clip(np.rint(rgb), 0.0, 255.0).astype(np.uint8))
