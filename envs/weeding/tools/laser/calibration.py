"""Fits the statistical perception of the weeders to rendered pictures.

Drives the front camera over strips whose seeds no benchmark uses, joins its tracks with the true plants, and sends the
tool camera to every track with the odometry's error. The tiers ``load-*`` show the same fields at other speeds, so they
share one measurement.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from .....kernels.seeds import CAMERAS
from ....core import Array
from ....pairing import nearest_pairs
from ...config import SCENARIOS
from ...gaps import LOOKED_AT, crop_gaps, weed_gaps
from ...perception import Q
from ...sighting import neighbourhood
from ...view import DELAY_S, DRIFT_SHARE, SAME_M, FrontCamera
from .config import WeedingConfig
from .env import laser_core
from .view import WeederView

STRIPS = {"load-1.0": 8, "load-1.0-even": 3, "dense": 9}
FIRST_SEED = CAMERAS.first
MATCH_M = 0.015
"""A track belongs to a weed when it ends within this distance of it; nearest pairs first, one to one."""
PART_M, CANOPY_M = 0.040, 0.060
"""A false track this near to a weed is a part of it; this near to a crop plant, it is at its leaves."""
CROP_AS_WEED_M = 0.020
"""A false track this near to a crop plant's stem would cost the crop plant."""
REACH_M = (0.009, 0.017, 0.028), (0.012, 0.019, 0.030)
"""The longest leaf of a broadleaf, and half a grass's longest blade: it lies to one side."""
CROP_GAP_M, WEED_GAP_M, CROWDED_M = (0.012, 0.024, 0.034, 0.044), (-0.022, -0.013, -0.005, 0.006), (0.044, -0.008)
"""Distances less the reach that part classes, each of about as many weeds, the last of all others."""
KEPT = 128
"""Sightings kept of each class."""


class Strips(NamedTuple):
    """What was measured on the strips of one tier.

    Attributes:
        weeds: (n, 4), species, stage, distance to the nearest crop plant and to the nearest weed, both less
            ``REACH_M``.
        sightings: (n, 8), see ``PerceptionModel``; NaN where the weed did not become a track.
        after_m: (n,), way from entering the view to confirmation, NaN as before.
        false: per class of false tracks, their sightings.
        crops: crop plants.
        area_m2: treated area.
        drift_share: what the odometry errs by, of the way; what the eyes teach it is taken off.
        counts: pictures, true weeds, plants and hits in single pictures, crop plants taken for weeds.
    """

    weeds: np.ndarray
    sightings: np.ndarray
    after_m: np.ndarray
    false: list[list[tuple[float, ...]]]
    crops: int
    area_m2: float
    drift_share: Array
    counts: dict[str, int]


class Seen(NamedTuple):
    """True plants of one strip, and what the cameras made of them.

    Attributes:
        weed: (n, 2) true places, sorted along.
        kind: (n, 2), species and stage.
        crop: (m, 2) true places.
        place: (t, 2), where tracks ended.
        told: (t, 2), where the odometry then sends the tool.
        aim: (t, 2), where the tool camera corrects it to.
        found: (t,), whether it found a plant.
        named: (t, 2), species and stage.
        confidence: (t,), how sure the pictures were.
        confirmed_m: (t,), cart positions.
    """

    weed: np.ndarray
    kind: np.ndarray
    crop: np.ndarray
    place: np.ndarray
    told: np.ndarray
    aim: np.ndarray
    found: np.ndarray
    named: np.ndarray
    confidence: np.ndarray
    confirmed_m: np.ndarray


def measure(tier: str, strips: int, eyes: str = "classical", pictures: str = "easy") -> Strips:
    """Drive over the strips of a tier with such eyes, past such pictures; see ``FieldTask``."""
    config = replace(WeedingConfig(), scenario=SCENARIOS[tier], eyes=eyes, pictures=pictures)
    core = laser_core(config, None)
    view = WeederView(core)
    counts: dict[str, int] = dict.fromkeys(("pictures", "truth", "plants", "hits", "crop_as_weed"), 0)
    all_seen = []
    for strip in range(strips):
        core.reset_rows(np.zeros(1, np.int64), [np.random.default_rng(FIRST_SEED + strip)])
        all_seen.append(look(config, core, view, FIRST_SEED + strip, counts))
    view.close()
    return join(config, all_seen, counts)


def look(config: WeedingConfig, core: Any, view: WeederView, seed: int, counts: dict[str, int]) -> Seen:
    """Drive over the present strip of ``core``, then send the tool camera to every track."""
    scene = view.camera_scene()
    view.show_strip(scene)
    # The tool camera is sent where the odometry believes the plant is; its error is one value a strip.
    drift = DRIFT_SHARE * np.sqrt(3.0) * np.random.default_rng(seed).uniform(-1.0, 1.0)
    front = FrontCamera(scene, -config.cart.start_m, drift, view.eyes)
    end = core.weeds_end
    exists = core.plant_exists[0, :end]
    weed, crop = core.state.plant[0, :end][exists], core.state.plant[0, end:].copy()
    kind = np.column_stack([core.plant_species[0, :end][exists], core.state.plant_kind[0, :end][exists]])
    drive(config, front, weed, counts)
    tracks = [t for t in front.tracker.tracks if np.isfinite(t.confirmed_m) and not t.is_crop and not t.is_doubtful]
    tracks = [t for t in tracks if abs(t.place[1]) <= 0.5 * config.scenario.band_m]
    place = np.array([t.place for t in tracks]).reshape(-1, 2)
    told, aim, found = np.empty_like(place), np.empty_like(place), np.zeros(len(place))
    for i in np.argsort(place[:, 0], kind="stable"):
        told[i] = front.place(place[i], 0.0, config.cart.unseen_m)
        seen = view.tool_aim(told[i], front.off_m)
        aim[i], found[i] = (told[i], 0.0) if seen is None else (seen, 1.0)
        if seen is not None:
            front.heed(0.0, config.cart.unseen_m, told[i], seen)
    return Seen(
        weed,
        kind,
        crop,
        place,
        told,
        aim,
        found,
        np.array([(t.votes.sum(axis=1).argmax(), t.votes.sum(axis=0).argmax()) for t in tracks], float).reshape(-1, 2),
        np.array([t.confidence for t in tracks]),
        np.array([t.confirmed_m for t in tracks]),
    )


def join(config: WeedingConfig, all_seen: list[Seen], counts: dict[str, int]) -> Strips:
    """Join tracks and weeds; what is left over of the tracks is false."""
    scenario = config.scenario
    weeds, sightings, after = [], [], []
    false: list[list[tuple[float, ...]]] = [[], [], []]
    crops = 0
    for s in all_seen:
        # A track belongs to the weed that it shows, or to the one that the tool would be used on.
        pairs = {b: a for a, b in match(s.place, s.weed, s.aim)}
        reach_m = np.array(REACH_M)[s.kind[:, 0], s.kind[:, 1]]
        gaps = crop_gaps(s.crop, s.weed) - reach_m, weed_gaps(s.weed, reach_m, LOOKED_AT)
        weeds.append(np.column_stack([s.kind, *gaps]))
        for j in range(len(s.weed)):
            i = pairs.get(j)
            sightings.append((np.nan,) * len(Q) if i is None else sighting(s, i, s.weed[j]))
            entered = s.weed[j, 0] - config.cart.seen_ahead_m
            after.append(np.nan if i is None else s.confirmed_m[i] - entered)
        for i in set(range(len(s.place))) - set(pairs.values()):
            if same_plant(i, pairs.values(), s.told, s.aim):
                continue
            to_weed, to_crop = (np.hypot(*(p - s.aim[i]).T) for p in (s.weed, s.crop))
            kind = 0 if to_weed.min() < PART_M else 1 if to_crop.min() < CANOPY_M else 2
            owner = (s.weed[to_weed.argmin()], s.crop[to_crop.argmin()], s.place[i])[kind]
            false[kind].append(sighting(s, i, owner))
            counts["crop_as_weed"] += int(to_crop.min() < CROP_AS_WEED_M)
        crops += int(np.count_nonzero((s.crop[:, 0] >= 0.0) & (s.crop[:, 0] <= scenario.strip_m)))
    area = len(all_seen) * scenario.strip_m * scenario.band_m
    drift = np.concatenate([s.told[:, 0] - s.place[:, 0] for s in all_seen]) / config.cart.unseen_m
    return Strips(np.concatenate(weeds), np.array(sightings), np.array(after), false, crops, area, drift, counts)


def sighting(seen: Seen, i: int, owner: np.ndarray) -> tuple[float, ...]:
    """One row of ``PerceptionModel.sightings``: track ``i`` relative to a plant's place (2,)."""
    return (*(seen.place[i] - owner), *(seen.aim[i] - owner), seen.found[i], *seen.named[i], seen.confidence[i])


def drive(config: WeedingConfig, front: FrontCamera, weed: np.ndarray, counts: dict[str, int]) -> None:
    """Drive the front camera over a strip, and count what single pictures show."""
    cart = config.cart
    while front.next_m <= config.scenario.strip_m - cart.unseen_m:
        at = front.next_m
        front.drive(at)
        assert front.last is not None
        seen = front.last[1]
        middle, half = at + cart.camera_ahead_m, 0.5 * cart.camera_view_m - 0.03
        truth = weed[np.abs(weed[:, 0] - middle) < half]
        inside = ~seen.crop & (np.abs(seen.position[:, 0] - middle) < half)
        inside &= (np.abs(seen.position[:, 1]) <= 0.5 * config.scenario.band_m) & (seen.position[:, 0] >= 0.0)
        plants = seen.position[inside]
        hits = len(match(plants, truth))
        for name, more in (("pictures", 1), ("truth", len(truth)), ("plants", len(plants)), ("hits", hits)):
            counts[name] += more


def match(places: np.ndarray, truth: np.ndarray, aims: np.ndarray | None = None) -> list[tuple[int, int]]:
    """Pairs (place, truth) of which the place, or its aim, is within ``MATCH_M``; nearest first, one to one."""
    gap = np.hypot(*(places[:, None] - truth[None]).transpose(2, 0, 1))
    if aims is not None:
        gap = np.minimum(gap, np.hypot(*(aims[:, None] - truth[None]).transpose(2, 0, 1)))
    return nearest_pairs(gap, MATCH_M)


def same_plant(i: int, others: Any, told: np.ndarray, aim: np.ndarray) -> bool:
    """Whether a false track is dropped with a true one: the first shot at either treats both."""
    main = np.array(sorted(others), int)
    ahead, behind = np.hypot(*(told[i] - aim[main]).T), np.hypot(*(told[main] - aim[i]).T)
    return bool(len(main)) and bool(min(ahead.min(), behind.min()) <= SAME_M)


def fit(parts: list[Strips], calibrated: bool = False) -> dict[str, Any]:
    """The statistical model's numbers from the strips of all tiers.

    The odometry's error is assumed, but where it is ``calibrated`` by the tool camera: then it is what that has left.
    """
    weeds, rows = (np.concatenate([getattr(p, name) for p in parts]) for name in ("weeds", "sightings"))
    species, stage, found = weeds[:, 0].astype(int), weeds[:, 1].astype(int), np.isfinite(rows[:, 0])
    kind = 3 * species + stage
    at_crop, at_weed = np.searchsorted(CROP_GAP_M, weeds[:, 2]), np.searchsorted(WEED_GAP_M, weeds[:, 3])
    # What stands alone is hardly ever missed, whatever it is: how kinds differ among others says nothing of that.
    crowded = (at_crop < len(CROP_GAP_M)) | (at_weed < len(WEED_GAP_M))
    odds = factors((kind + 6 * crowded, at_crop, at_weed), (12, len(CROP_GAP_M) + 1, len(WEED_GAP_M) + 1), found)
    recall = (odds[0] / (1.0 + odds[0])).reshape(2, 2, 3)
    table = 6 * np.array([neighbourhood(CROWDED_M, *gaps_m) for gaps_m in weeds[:, 2:4].tolist()]) + kind
    totals = [sum(len(p.false[c]) for p in parts) for c in range(3)]
    per = len(weeds), sum(p.crops for p in parts), sum(p.area_m2 for p in parts)
    after = np.concatenate([p.after_m for p in parts])
    left = float(np.sqrt(np.mean(np.concatenate([p.drift_share for p in parts]) ** 2)))
    return {
        "recall": recall.round(4).tolist(),
        "crop_gap_m": list(CROP_GAP_M),
        "odds_near_crop": [round(float(v), 5) for v in odds[1]],
        "weed_gap_m": list(WEED_GAP_M),
        "odds_near_weed": [round(float(v), 5) for v in odds[2]],
        "crowded_m": list(CROWDED_M),
        "sightings": [kept(rows[found & (table == c)]) for c in range(18)],
        "false_rates": [round(float(t / n), 4) for t, n in zip(totals, per, strict=True)],
        "false_sightings": [
            kept(np.array([row for p in parts for row in p.false[c]]).reshape(-1, len(Q))) for c in range(3)
        ],
        "drift_share": round(left, 5) if calibrated else DRIFT_SHARE,
        "delay_s": DELAY_S,
        "frames_m": round(float(np.nanmedian(after)), 3),
        "reach_m": [list(row) for row in REACH_M],
    }


def factors(bins: tuple[np.ndarray, ...], sizes: tuple[int, ...], found: np.ndarray) -> list[np.ndarray]:
    """Factors whose product predicts the odds of ``found``: each bin's predicted sum equals its true one.

    A logistic regression on the bins by Newton's method, half a success and half a failure at even odds added to each
    bin; the last bins of all axes but the first have the factor 1.
    """
    starts = np.cumsum([0, *sizes])
    free = np.ones(starts[-1], bool)
    free[starts[2:] - 1] = False
    design = np.zeros((len(found) + 2 * starts[-1], starts[-1]))
    for axis, bin_ in enumerate(bins):
        design[np.arange(len(found)), starts[axis] + bin_] = 1.0
    design[len(found) :] = np.repeat(np.eye(starts[-1]), 2, axis=0)
    hits = np.concatenate([found.astype(float), np.tile([1.0, 0.0], starts[-1])])
    weight = np.concatenate([np.ones(len(found)), np.full(2 * starts[-1], 0.5)])
    design, logs = design[:, free], np.zeros(np.count_nonzero(free))
    for _ in range(30):
        chance = 1.0 / (1.0 + np.exp(-design @ logs))
        curvature = (design * (weight * chance * (1.0 - chance))[:, None]).T @ design
        logs += np.linalg.solve(curvature, design.T @ (weight * (hits - chance)))
    every = np.zeros(starts[-1])
    every[free] = logs
    return [np.exp(every[low:high]) for low, high in pairwise(starts)]


def kept(rows: np.ndarray) -> list[list[float]]:
    """At most ``KEPT`` of the rows (n, 8), evenly over the order of their final errors; a row of zeros for none.

    Every so many-th of the ordered rows keeps the distribution of the errors better than rows by chance.
    """
    if not len(rows):
        return [[0.0] * len(Q)]
    order = np.argsort(np.hypot(rows[:, 2], rows[:, 3]), kind="stable")
    n = min(KEPT, len(rows))
    chosen = rows[order[((np.arange(n) + 0.5) * len(rows) / n).astype(np.int64)]]
    return [[round(v, 4) for v in row] for row in chosen.tolist()]


def summary(strips: Strips) -> dict[str, Any]:
    """Figures of a tier for people."""
    c, found = strips.counts, np.isfinite(strips.sightings[:, 0])
    rows, false = strips.sightings[found], [len(f) for f in strips.false]
    front, tool = np.hypot(rows[:, 0], rows[:, 1]), np.hypot(rows[:, 2], rows[:, 3])
    species, stage = strips.weeds[found, 0], strips.weeds[found, 1]
    alone = strips.weeds[:, 2] >= CROWDED_M[0]
    values = {
        "frame_precision": c["hits"] / max(c["plants"], 1),
        "frame_recall": c["hits"] / max(c["truth"], 1),
        "track_precision": found.sum() / max(found.sum() + sum(false), 1),
        "track_recall": found.mean(),
        "track_recall_off_crop": found[alone].mean(),
        "false_at_weeds": false[0],
        "false_at_crop": false[1],
        "false_elsewhere": false[2],
        "false_per_m": sum(false) / (strips.area_m2 / 0.4),
        "crop_as_weed": c["crop_as_weed"] / strips.crops,
        "front_error_mm_50_90": [round(1e3 * v, 2) for v in np.percentile(front, [50, 90])],
        "tool_found": rows[:, 4].mean(),
        "tool_error_mm_50_90": [round(1e3 * v, 2) for v in np.percentile(tool, [50, 90])],
        "tool_error_over_4_mm": (tool > 0.004).mean(),
        "species_named": (rows[:, 5] == species).mean(),
        "stage_named": (rows[:, 6] == stage).mean(),
        "confirmed_after_m": np.nanmedian(strips.after_m),
    }
    rounded = {k: v if isinstance(v, list) else round(float(v), 3) for k, v in values.items()}
    return {"pictures": c["pictures"], "weeds": len(found), "crop_plants": strips.crops, **rounded}
