"""What the weeders' cameras make of rendered fields: tracks joined with weeds, weeds in categories, statistics."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.field import WeedField
from fieldgym.envs.weeding.gaps import LOOKED_AT, crop_gaps, weed_gaps
from fieldgym.envs.weeding.tools.laser import calibration
from fieldgym.envs.weeding.tools.laser.calibration import Seen, match, same_plant
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.env import laser_core
from fieldgym.envs.weeding.tools.laser.view import WeederView
from fieldgym.envs.weeding.view import FRAME_EVERY_M
from fieldgym.kernels.seeds import EYES_SHOWN

FRESH_SEED = EYES_SHOWN.first
HIDDEN_PX, SHOWN = 10, 0.35
"""A weed of which less ever shows is hidden; one that shows less than this share of its kind's usual size, partly."""
RIGHT_M, OFF_M = 0.002, 0.004
CROP_BINS_M, WEED_BINS_M = (0.030, 0.045, 0.060, 0.080), (0.008, 0.012, 0.025, 0.050)
"""Distances to the nearest crop plant and to the nearest other weed that part the rows of tables."""
CONFIDENCE_BINS = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
RIGHT = "right: aim within 2 mm"
CATEGORIES = (
    "hidden: never 10 pixels of it",
    "missed, partly hidden",
    "missed, touches a crop plant",
    "missed, touches a weed",
    "missed, alone",
    "aim off 2-4 mm",
    "aim off > 4 mm, touches a crop plant",
    "aim off > 4 mm, touches a weed",
    "aim off > 4 mm, alone",
)


class Strip(NamedTuple):
    """What the cameras made of one field.

    Attributes:
        field: its plants.
        seen: tracks and truth.
        pair: (n,), the track of each weed, -1 for none.
        false: tracks of no further weed.
        category: (n,), of each weed.
        error_m: (n,), of the aim, NaN without a track.
    """

    field: WeedField
    seen: Seen
    pair: NDArray[np.int64]
    false: list[int]
    category: list[str]
    error_m: NDArray[np.float64]


class Shown(NamedTuple):
    """How the weeds (n,) of a strip show in the front camera's pictures.

    Attributes:
        most_px: pixels in the picture that shows most of each.
        crop: share of the pictures in which it touches a crop plant.
        weed: the same for another weed.
    """

    most_px: NDArray[np.int64]
    crop: NDArray[np.float64]
    weed: NDArray[np.float64]


def shown(view: WeederView, weeds: int) -> Shown:
    """Look at the whole strip in the front camera's own steps, with names to the pixels."""
    scene, config = view.camera_scene(), view.core.config
    most, pictures = np.zeros(weeds, np.int64), np.zeros(weeds)
    touch = np.zeros((2, weeds))
    cart = config.cart
    at_m = max(-cart.start_m, 0.0) - cart.seen_ahead_m
    while at_m <= config.scenario.strip_m - cart.unseen_m:
        scene.plant_around(at_m)
        eye = np.array([at_m + cart.camera_ahead_m, 0.0, scene.eye_m])
        down = eye - np.array([0.0, 0.0, 1.0])
        identity = scene.stage.seen(scene.front, eye, down, (1.0, 0.0, 0.0), "plants", "soil").identity
        pixels = np.bincount(identity[(identity >= 0) & (identity < weeds)], minlength=weeds)
        most = np.maximum(most, pixels)
        for j in np.flatnonzero(pixels).tolist():
            y, x = np.nonzero(identity == j)
            window = np.s_[max(y.min() - 2, 0) : y.max() + 3, max(x.min() - 2, 0) : x.max() + 3]
            near = cv2.dilate((identity[window] == j).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
            others = identity[window][near]
            pictures[j] += 1
            touch[0, j] += (others >= weeds).any()
            touch[1, j] += ((others >= 0) & (others < weeds) & (others != j)).any()
        at_m += FRAME_EVERY_M
    return Shown(most, *(touch / np.maximum(pictures, 1)))


def look(eyes: str, pictures: str, scenario: str, fields: int, first_seed: int = FRESH_SEED) -> list[Strip]:
    """Look at so many fields."""
    return look_at(eyes, pictures, scenario, fields, first_seed)[0]


def look_at(
    eyes: str, pictures: str, scenario: str, fields: int, first_seed: int = FRESH_SEED
) -> tuple[list[Strip], list[Shown]]:
    """Look at so many fields, and at how their weeds show."""
    config = replace(WeedingConfig(), scenario=SCENARIOS[scenario], eyes=eyes, pictures=pictures)
    core = laser_core(config, None)
    view = WeederView(core)
    found: list[tuple[WeedField, Seen, Shown]] = []
    for field in range(fields):
        one = core.draw_field(np.random.default_rng(first_seed + field))
        core.load(np.zeros(1, np.int64), core.stack([one]))
        counts: dict[str, int] = Counter()
        seen = calibration.look(config, core, view, first_seed + field, counts)
        found.append((one, seen, shown(view, len(seen.weed))))
    view.close()
    shows = [how for *_, how in found]
    usual = usual_px([seen for _, seen, _ in found], shows)
    return [sorted_out(*one, usual) for one in found], shows


def usual_px(seen: Sequence[Seen], shows: Sequence[Shown]) -> NDArray[np.float64]:
    """Pixels (6,) that a weed of each kind has where most of it shows."""
    kinds = np.concatenate([3 * one.kind[:, 0] + one.kind[:, 1] for one in seen])
    most = np.concatenate([how.most_px for how in shows])
    return np.array([np.percentile(most[kinds == k], 75) if (kinds == k).any() else 1.0 for k in range(6)])


def sorted_out(field: WeedField, seen: Seen, how: Shown, usual_px: NDArray[np.float64]) -> Strip:
    """Tracks joined with weeds, and every weed in its category."""
    pairs = {b: a for a, b in match(seen.place, seen.weed, seen.aim)}
    pair = np.array([pairs.get(j, -1) for j in range(len(seen.weed))])
    false = [
        i for i in sorted(set(range(len(seen.place))) - set(pairs.values()))
        if not same_plant(i, pairs.values(), seen.told, seen.aim)
    ]  # fmt: skip
    error = np.full(len(pair), np.nan)
    error[pair >= 0] = np.hypot(*(seen.aim[pair[pair >= 0]] - seen.weed[pair >= 0]).T)
    share = how.most_px / usual_px[3 * seen.kind[:, 0] + seen.kind[:, 1]]
    category = []
    for j in range(len(pair)):
        touches = "touches a crop plant" if how.crop[j] >= 0.5 else "touches a weed" if how.weed[j] >= 0.5 else "alone"
        if pair[j] < 0:
            missed = "missed, partly hidden" if share[j] < SHOWN else f"missed, {touches}"
            category.append(CATEGORIES[0] if how.most_px[j] < HIDDEN_PX else missed)
        elif error[j] <= RIGHT_M:
            category.append(RIGHT)
        else:
            category.append("aim off 2-4 mm" if error[j] <= OFF_M else f"aim off > 4 mm, {touches}")
    return Strip(field, seen, pair, false, category, error)


def figures(strips: Sequence[Strip]) -> dict[str, float]:
    """Tracks against weeds."""
    weeds, tracked = sum(len(s.pair) for s in strips), sum(int((s.pair >= 0).sum()) for s in strips)
    false = sum(len(s.false) for s in strips)
    error = np.concatenate([s.error_m[s.pair >= 0] for s in strips])
    named = np.concatenate(
        [(s.seen.named[s.pair[s.pair >= 0]] == s.seen.kind[s.pair >= 0]).all(axis=1) for s in strips]
    )
    return {
        "weeds": weeds,
        "track recall": tracked / weeds,
        "track precision": tracked / max(tracked + false, 1),
        "aim within 2 mm, of all weeds": float((error <= RIGHT_M).sum()) / weeds,
        "aim error, half of them, mm": 1e3 * float(np.percentile(error, 50)),
        "aim error, 90 %, mm": 1e3 * float(np.percentile(error, 90)),
        "named right": float(named.mean()),
    }


class _Rows(NamedTuple):
    """All weeds and tracks of strips in one row each: classes of both, errors (n,) of weeds, which tracks are true."""

    weed: NDArray[np.int64]
    track: NDArray[np.int64]
    error_m: NDArray[np.float64]
    true: NDArray[np.bool_]


def tracks_of(strip: Strip) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Tracks (t,) of a strip that stand for themselves, and which of them are a weed of their own."""
    own = strip.pair[strip.pair >= 0]
    return np.concatenate([own, np.array(strip.false, np.int64)]), np.arange(len(own) + len(strip.false)) < len(own)


def _table(name: str, rows: Sequence[str], classes: _Rows) -> Table:
    """Recall, precision and aim, class by class."""
    table = Table(name, "weeds", "recall", "tracks", "precision", "aim <= 2 mm", "error 50 % mm", "90 % mm")
    for k, row in enumerate(rows):
        error, true = classes.error_m[classes.weed == k], classes.true[classes.track == k]
        if not len(error):
            continue
        half, most = np.nanpercentile(error, [50, 90]) if np.isfinite(error).any() else (np.nan, np.nan)
        recall, right = np.isfinite(error).mean(), (error <= RIGHT_M).mean()
        precision = f"{true.mean():.2f}" if len(true) else ""
        aim = f"{right:.2f}", f"{1e3 * half:.2f}", f"{1e3 * most:.2f}"
        table.add_row(row, str(len(error)), f"{recall:.2f}", str(len(true)), precision, *aim)
    return table


def by_kind(strips: Sequence[Strip]) -> Table:
    """Recall and aim by species and stage, precision by those that are told."""
    rows = [
        _Rows(3 * s.seen.kind[:, 0] + s.seen.kind[:, 1], (s.seen.named[t] @ [3, 1]).astype(np.int64), s.error_m, true)
        for s in strips for t, true in [tracks_of(s)]
    ]  # fmt: skip
    names = [f"{s} {g}" for s in ("broadleaf", "grass") for g in ("cotyledon", "two-leaf", "four-leaf")]
    return _table("kind", names, _Rows(*(np.concatenate(parts) for parts in zip(*rows, strict=True))))


def by_gap(strips: Sequence[Strip], to: str) -> Table:
    """The same by the distance to the nearest ``"crop"`` plant or other ``"weed"``, of tracks from where they aim."""
    bins, rows = (CROP_BINS_M, []) if to == "crop" else (WEED_BINS_M, [])
    for s in strips:
        chosen, true = tracks_of(s)
        if to == "crop":
            gaps, told_m = crop_gaps(s.seen.crop, s.seen.weed), crop_gaps(s.seen.crop, s.seen.aim[chosen])
        else:
            gaps = weed_gaps(s.seen.weed, np.zeros(len(s.seen.weed)), LOOKED_AT)
            away = np.hypot(*(s.seen.aim[chosen][:, None] - s.seen.weed[None]).transpose(2, 0, 1))
            # A weed's own track tells of no other weed.
            away[np.flatnonzero(true), np.flatnonzero(s.pair >= 0)] = np.inf
            told_m = away.min(axis=1, initial=np.inf)
        rows.append(_Rows(np.searchsorted(bins, gaps), np.searchsorted(bins, told_m), s.error_m, true))
    ends = [f"{1e3 * low:.0f}" for low in bins]
    names = [f"< {ends[0]}", *(f"{a}-{b}" for a, b in pairwise(ends)), f"> {ends[-1]}"]
    return _table(f"mm to a {to}", names, _Rows(*(np.concatenate(parts) for parts in zip(*rows, strict=True))))


def by_confidence(strips: Sequence[Strip]) -> Table:
    """How often a track is a weed of its own, by what the cameras say of how sure they are."""
    table = Table("confidence", "tracks", "mean", "a weed of their own", "standard error")
    chosen = [tracks_of(s) for s in strips]
    sure = np.concatenate([s.seen.confidence[t] for s, (t, _) in zip(strips, chosen, strict=True)])
    true = np.concatenate([t for _, t in chosen])
    place = np.searchsorted(CONFIDENCE_BINS, sure)
    ends = (0.0, *CONFIDENCE_BINS, 1.0)
    for k in range(len(CONFIDENCE_BINS) + 1):
        own = true[place == k]
        if len(own):
            share = own.mean()
            error = np.sqrt(share * (1.0 - share) / len(own))
            cells = f"{sure[place == k].mean():.2f}", f"{share:.2f}", f"{error:.2f}"
            table.add_row(f"{ends[k]:.1f}-{ends[k + 1]:.1f}", str(len(own)), *cells)
    return table
