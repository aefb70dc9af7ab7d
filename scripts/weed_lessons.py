"""Rendered pictures of both weed cameras with the truth about every pixel: what ``train_weed_eyes.py`` learns from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.eyes import TOOL_SMALLER, smaller
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.env import laser_core
from fieldgym.envs.weeding.tools.laser.view import WeederView
from fieldgym.kernels.seeds import EYES_CHOSEN, LESSONS
from fieldgym.perception.frames import CameraPose, Frame
from fieldgym.perception.stems import KINDS, StemSettings
from fieldgym.perception.weeds import WeedSettings

FIRST_SEED, CHOICE_SEED = LESSONS.first, EYES_CHOSEN.first
"""Strips that networks learn from, and those on which thresholds are chosen and a finished network is looked at."""
TIERS = ("load-1.0", "dense", "load-1.0", "load-1.0-even")
"""Of the strips, in turn."""
FRONT_SEEN_PX, TOOL_SEEN_PX = 6, 16
"""A weed of which less shows in a picture is not asked for."""
_NEAR_M = 0.6
_TOLD_ALONG_M, _TOLD_M, _ANYWHERE = 0.011, 0.0015, 0.1
"""How far beside a weed the tool camera is sent: the odometry's error, that of the tracks, and how often it is sent
anywhere in the band."""
_UP = (1.0, 0.0, 0.0)


class Lesson(NamedTuple):
    """A picture and what it shows.

    Attributes:
        rgb: (h, w, 3).
        owner: (h, w) uint8, 0 ground and litter, else the plant that a pixel shows, numbered within the picture.
        stem: (n, 2), columns and rows of the stems that are asked for.
        kind: (n,), ``3 species + stage`` of a weed, 6 of a crop plant.
        size_px: (n,), pixels that show of each.
        camera: where the picture was taken from.
    """

    rgb: NDArray[np.uint8]
    owner: NDArray[np.uint8]
    stem: NDArray[np.float64]
    kind: NDArray[np.int64]
    size_px: NDArray[np.int64]
    camera: CameraPose

    @property
    def frame(self) -> Frame:
        """The picture as detectors take it."""
        return Frame(self.rgb, np.zeros((0, 0), np.float32), self.camera)


def lessons(
    camera: str, strips: int, pictures: int, first_seed: int = FIRST_SEED, kinds: str | Sequence[str] = "easy"
) -> Iterator[Lesson]:
    """So many pictures of each of so many strips.

    Args:
        camera: ``"front"`` or ``"tool"``.
        strips: so many.
        pictures: of each strip.
        first_seed: of the strips.
        kinds: of pictures, see ``FieldTask.pictures``; of several each tier's strips take turns.
    """
    views: dict[tuple[str, str], WeederView] = {}
    kinds = (kinds,) if isinstance(kinds, str) else tuple(kinds)
    for strip in range(strips):
        tier, kind = TIERS[strip % len(TIERS)], kinds[strip // len(TIERS) % len(kinds)]
        if (tier, kind) not in views:
            config = replace(WeedingConfig(), scenario=SCENARIOS[tier], pictures=kind)
            views[tier, kind] = WeederView(laser_core(config, None))
        view, rng = views[tier, kind], np.random.default_rng(first_seed + strip)
        view.core.reset_rows(np.zeros(1, np.int64), [rng])
        view.show_strip(view.camera_scene())
        yield from (_front if camera == "front" else _tool)(view, pictures, rng)


def _front(view: WeederView, pictures: int, rng: np.random.Generator) -> Iterator[Lesson]:
    scene, config = view.camera_scene(), view.core.config
    truth = _truth(view)
    for cart in rng.uniform(-config.cart.seen_ahead_m, config.scenario.strip_m - config.cart.unseen_m, pictures):
        scene.plant_around(float(cart))
        eye = np.array([cart + config.cart.camera_ahead_m, 0.0, scene.eye_m])
        target = eye - np.array([0.0, 0.0, 1.0])
        yield _lesson(scene, scene.front, eye, target, truth, FRONT_SEEN_PX, 1)


def _tool(view: WeederView, pictures: int, rng: np.random.Generator) -> Iterator[Lesson]:
    scene, config = view.camera_scene(), view.core.config
    truth, reach = _truth(view), config.aim
    weeds = len(truth.kind) - int((truth.kind == KINDS).sum())
    for _ in range(pictures):
        if rng.random() < _ANYWHERE or not weeds:
            told = rng.uniform([0.0, -0.5], [1.0, 0.5]) * [config.scenario.strip_m, config.scenario.band_m]
        else:
            told = truth.place[one_of(truth.kind, truth.kind < KINDS, rng)] + rng.normal(0.0, _TOLD_M, 2)
            told[0] += rng.uniform(-_TOLD_ALONG_M, _TOLD_ALONG_M)
        # The platform stands from the rear to the front of its window, and leans the rest of the way.
        eye = np.array([told[0] + rng.uniform(-0.06, 0.02), 0.0, reach.target_height_m + reach.gap_m])
        scene.plant_around(float(eye[0]))
        target = np.array([*told, reach.target_height_m])
        yield _lesson(scene, scene.tool, eye, target, truth, TOOL_SEEN_PX, TOOL_SMALLER)


def one_of(
    kind: NDArray[np.int64], chosen: NDArray[np.bool_], rng: np.random.Generator, share: Sequence[float] | None = None
) -> int:
    """Number of one of the chosen plants (n,), every kind that is among them as often as others, or by ``share``."""
    there = np.unique(kind[chosen])
    odds = np.ones(len(there)) if share is None else np.array(share, float)[there]
    return int(rng.choice(np.flatnonzero(chosen & (kind == rng.choice(there, p=odds / odds.sum())))))


class _Truth(NamedTuple):
    """Stems (n, 3) of a strip, weeds before crop plants, their places (n, 2) on the ground and kinds (n,)."""

    stem: NDArray[np.float64]
    place: NDArray[np.float64]
    kind: NDArray[np.int64]


def _truth(view: WeederView) -> _Truth:
    core, end = view.core, view.core.weeds_end
    exists, settings = core.plant_exists[0, :end], WeedSettings()
    species, stage = core.plant_species[0, :end][exists], core.state.plant_kind[0, :end][exists]
    weed, crop = core.state.plant[0, :end][exists], core.state.plant[0, end:]
    height = np.concatenate([np.array(settings.stem_m)[species, stage], np.full(len(crop), StemSettings.crop_m)])
    place = np.concatenate([weed, crop])
    kind = np.concatenate([3 * species + stage, np.full(len(crop), KINDS)]).astype(np.int64)
    return _Truth(np.column_stack([place, height]), place, kind)


def _lesson(scene: Any, camera: Any, eye: Any, target: Any, truth: _Truth, least_px: int, times: int) -> Lesson:
    look = scene.stage.seen(camera, eye, target, _UP, "plants", "soil", ground=scene.bare_ground(camera, eye))
    identity = look.identity
    seen = np.bincount(identity[identity >= 0].ravel(), minlength=len(truth.kind))
    near = np.hypot(*(truth.place - target[:2]).T) < _NEAR_M
    asked = near & ((seen >= least_px) | (truth.kind == KINDS))
    pixel = projected(truth.stem[asked], look.frame.camera)
    rgb, pose, numbers = look.frame.rgb, look.frame.camera, np.unique(identity[identity >= 0])
    owner = np.where(identity >= 0, np.searchsorted(numbers, identity) % 255 + 1, 0).astype(np.uint8)
    if times > 1:
        rgb, _, pose = smaller(look.frame, times)
        owner, pixel = owner[::times, ::times].copy(), (pixel - 0.5 * (times - 1)) / times
    return Lesson(rgb, owner, pixel, truth.kind[asked], seen[asked], pose)


def projected(places: NDArray[np.float64], camera: CameraPose) -> NDArray[np.float64]:
    """Columns and rows (n, 2) of places (n, 3) in a camera's picture."""
    camera_from_world = np.linalg.inv(camera.world_from_camera)
    before = (places @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]) @ camera.intrinsics.T
    return before[:, :2] / before[:, 2:]
