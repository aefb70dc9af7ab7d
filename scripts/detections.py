"""What the detectors make of a number of pictures, whoever draws them: what is found, what is false, how far off."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fieldgym.envs.safflower import calibration as safflower
from fieldgym.envs.sorting import calibration as sorting
from fieldgym.envs.transplanting import calibration as transplanting
from fieldgym.envs.transplanting.config import SCENARIOS as TRAYS
from fieldgym.envs.weeding.config import SCENARIOS as FIELDS
from fieldgym.envs.weeding.straying import WHOLE_M
from fieldgym.envs.weeding.tools.laser import calibration as weeding
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.env import laser_core
from fieldgym.envs.weeding.tools.laser.view import WeederView
from fieldgym.perception.trays import TraySettings
from fieldgym.perception.weeds import detect

_TOLD_SIGMA_M = 0.005
"""How far the tool camera is sent beside a weed: the odometry's error over the way from the front camera."""


class Found(NamedTuple):
    """What a detector made of pictures.

    Attributes:
        pictures: that were looked at.
        truth: things that were there.
        found: of them.
        false: reports of what was not there, or of another kind.
        error_mm: mean distance across of a report from what it is of; NaN for what has no place.
    """

    pictures: int
    truth: int
    found: int
    false: int
    error_mm: float


def blooms(pictures: int) -> Found:
    """Heads at the stops of rows."""
    tally = safflower.count("row", pictures)
    across = np.linalg.norm(np.array(tally.errors)[:, :2], axis=1)
    return Found(tally.stops, int(tally.present.sum()), len(across), tally.false, 1e3 * float(across.mean()))


def weeds(pictures: int) -> Found:
    """Weeds in pictures of the front camera along a strip, those in the middle of each."""
    view = _strip("load-1.25")
    config, scene, weed = view.core.config, view.camera_scene(), _weeds(view)
    half_m, band_m = 0.5 * config.cart.camera_view_m - WHOLE_M, config.scenario.band_m
    truth, false, errors = 0, 0, []
    for middle in np.linspace(0.0, config.scenario.strip_m, pictures).tolist():
        seen = detect(scene.look_front(middle - config.cart.camera_ahead_m))
        inside = ~seen.crop & (np.abs(seen.position[:, 0] - middle) < half_m)
        place = seen.position[inside & (np.abs(seen.position[:, 1]) <= 0.5 * band_m) & (seen.position[:, 0] >= 0.0)]
        there = weed[np.abs(weed[:, 0] - middle) < half_m]
        pairs = weeding.match(place, there)
        truth, false = truth + len(there), false + len(place) - len(pairs)
        errors += [float(np.hypot(*(place[i] - there[j]))) for i, j in pairs]
    return Found(pictures, truth, len(errors), false, 1e3 * float(np.mean(errors)))


def aims(pictures: int) -> Found:
    """Weeds, one a picture of the tool camera, which is sent some millimetres beside them."""
    view = _strip("load-1.25")
    weed = _weeds(view)
    weed = weed[np.linspace(0, len(weed) - 1, pictures).astype(int)]
    told = weed + np.random.default_rng(0).normal(0.0, _TOLD_SIGMA_M, weed.shape)
    aimed = [(view.tool_aim(there, _TOLD_SIGMA_M), truth) for there, truth in zip(told, weed, strict=True)]
    error_m = np.array([np.hypot(*(aim - truth)) for aim, truth in aimed if aim is not None])
    near = error_m[error_m <= weeding.MATCH_M]
    return Found(pictures, len(weed), len(near), len(error_m) - len(near), 1e3 * float(near.mean()))


def produce(pictures: int) -> Found:
    """Items on the belt, on streams of every scenario."""
    fit = sorting.measure(pictures)
    told = fit["measured"]
    missed = sum(told["missed_by_grade"])
    return Found(pictures, fit["items"], fit["items"] - missed, told["false"], told["mean_horizontal_error_mm"])


def cells(pictures: int) -> Found:
    """Cells of tray rows, half of the pictures a side; found is what is called by its kind."""
    work = TRAYS["replug"]
    pair = work.source.rows * work.source.columns, work.target.rows * work.target.columns
    sides = transplanting.collect_pair(*pair, -(-pictures // 2), transplanting.MEASURE_SEED)
    samples = [sample for seen in sides.values() for sample in seen]
    counts = transplanting.confusion(samples, TraySettings())
    right = int(np.trace(counts))
    return Found(len(samples), int(counts.sum()), right, int(counts.sum()) - right, float("nan"))


DETECTORS: dict[str, Callable[[int], Found]] = {
    "blooms, row": blooms,
    "weeds by the front camera, load-1.25": weeds,
    "weeds by the tool camera, load-1.25": aims,
    "produce, all scenarios": produce,
    "cells of tray rows, replug": cells,
}


def _strip(tier: str) -> WeederView:
    """A strip that no benchmark uses, before the cameras."""
    config = WeedingConfig(scenario=FIELDS[tier], eyes="classical", pictures="easy")
    core = laser_core(config, None)
    core.reset_rows(np.zeros(1, np.int64), [np.random.default_rng(weeding.FIRST_SEED)])
    view = WeederView(core)
    view.show_strip(view.camera_scene())
    return view


def _weeds(view: WeederView) -> np.ndarray:
    """Places (n, 2) of the strip's weeds."""
    core = view.core
    return core.state.plant[0, : core.weeds_end][core.plant_exists[0, : core.weeds_end]]
