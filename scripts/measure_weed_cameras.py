"""Measure the weeder's cameras on rendered pictures and fit the statistical perception to them.

Drives the front camera over strips whose seeds no benchmark uses, joins its tracks with the true plants, then sends the
tool camera to every track with the odometry's error, and writes the fit to ``assets/perception/weeding.json``. The
tiers ``load-*`` show the same fields at other speeds, so they share one measurement.

Run: ``python scripts/measure_weed_cameras.py [--write]``.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fieldgym.envs.weeding.config import SCENARIOS, PerceptionModel, WeedingConfig
from fieldgym.envs.weeding.env import laser_core
from fieldgym.envs.weeding.scenario import nearest_crop
from fieldgym.envs.weeding.view import DELAY_S, DRIFT_SHARE, FRAME_EVERY_M, FrontCamera, WeederView

STRIPS = {"load-1.0": 3, "load-1.0-even": 3, "dense": 5}
FIT_TIER = "load-1.0"
FIRST_SEED = 900_000
MATCH_M = 0.012
NEAR_CROP_M = 0.045
LOCKED_M = 0.008
OUTPUT = Path(__file__).resolve().parent.parent / "assets" / "perception" / "weeding.json"


def measure(tier: str, strips: int) -> dict[str, Any]:
    """All matches of a tier as flat arrays, and its counts."""
    config = replace(WeedingConfig(), scenario=SCENARIOS[tier])
    core = laser_core(config, None)
    view = WeederView(core)
    rows: list[tuple[float, ...]] = []
    frames, false, crops, crop_as_weed, area = 0, 0, 0, 0, 0.0
    frame_hits = frame_seen = frame_truth = 0
    for strip in range(strips):
        core.reset_rows(np.zeros(1, np.int64), [np.random.default_rng(FIRST_SEED + strip)])
        scene = view.camera_scene()
        view.show_strip(scene)
        front = FrontCamera(scene, -config.cart.start_m, 0.0)
        end = core.weeds_end
        exists = core.plant_exists[0, :end]
        weed, crop = core.plant[0, :end][exists], core.plant[0, end:]
        stage, species = core.plant_kind[0, :end][exists], core.plant_species[0, :end][exists]
        stop = config.scenario.strip_m - config.cart.unseen_m
        while front.next_m <= stop:
            at = front.next_m
            front.drive(at)
            frames += 1
            assert front.last is not None
            seen = front.last[1]
            middle, half = at + config.cart.camera_ahead_m, 0.5 * config.cart.camera_view_m - 0.03
            truth = weed[np.abs(weed[:, 0] - middle) < half]
            inside = ~seen.crop & (np.abs(seen.position[:, 0] - middle) < half)
            inside &= (np.abs(seen.position[:, 1]) <= 0.5 * config.scenario.band_m) & (seen.position[:, 0] >= 0.0)
            blobs = seen.position[inside]
            frame_truth, frame_seen = frame_truth + len(truth), frame_seen + len(blobs)
            frame_hits += len(match(blobs, truth))
        tracks = [t for t in front.tracker.tracks if np.isfinite(t.confirmed_m) and not t.is_crop]
        place = np.array([t.place for t in tracks]).reshape(-1, 2)
        keep = (np.abs(place[:, 1]) <= 0.5 * config.scenario.band_m) & (place[:, 0] >= 0.0)
        keep &= place[:, 0] <= config.scenario.strip_m
        tracks, place = [t for t, k in zip(tracks, keep, strict=True) if k], place[keep]
        pairs = dict((b, a) for a, b in match(place, weed))
        near = nearest_crop(config.scenario, crop[None], weed[None])[0]
        generator = np.random.default_rng(FIRST_SEED + strip)
        for j in range(len(weed)):
            i = pairs.get(j)
            row = [species[j], stage[j], near[j], float(i is not None)]
            if i is None:
                rows.append((*row, *[np.nan] * 7))
                continue
            track = tracks[i]
            error = track.place - weed[j]
            drifted = track.place + np.array([config.cart.unseen_m * DRIFT_SHARE * generator.standard_normal(), 0.0])
            aim = view.tool_aim(drifted)
            tool = (np.nan, np.nan) if aim is None else tuple(aim - weed[j])
            named = track.votes.sum(axis=1).argmax(), track.votes.sum(axis=0).argmax()
            entered = weed[j, 0] - config.cart.seen_ahead_m
            rows.append((*row, *error, *tool, *named, track.confirmed_m - entered))
        others = set(range(len(tracks))) - set(pairs.values())
        for i in others:
            gap = np.hypot(*(crop - place[i]).T).min()
            if gap < 0.02:
                crop_as_weed += 1
            else:
                false += 1
        crops += int(np.count_nonzero((crop[:, 0] >= 0.0) & (crop[:, 0] <= config.scenario.strip_m)))
        area += config.scenario.strip_m * config.scenario.band_m
    view.close()
    return {
        "rows": np.array(rows, float),
        "frames": frames,
        "false_per_m2": false / area,
        "crop_as_weed": crop_as_weed / max(crops, 1),
        "frame_precision": frame_hits / max(frame_seen, 1),
        "frame_recall": frame_hits / max(frame_truth, 1),
        "track_precision": float(np.array(rows)[:, 3].sum())
        / max(float(np.array(rows)[:, 3].sum()) + false + crop_as_weed, 1.0),
    }


def match(places: np.ndarray, truth: np.ndarray) -> list[tuple[int, int]]:
    """Pairs (place, truth) within ``MATCH_M``, nearest first, one to one."""
    if not len(places) or not len(truth):
        return []
    gap = np.hypot(*(places[:, None] - truth[None]).transpose(2, 0, 1))
    pairs, used_a, used_b = [], set(), set()
    for flat in np.argsort(gap, axis=None):
        a, b = divmod(int(flat), len(truth))
        if gap[a, b] > MATCH_M:
            break
        if a not in used_a and b not in used_b:
            pairs.append((a, b))
            used_a.add(a)
            used_b.add(b)
    return pairs


def fit(result: dict[str, Any]) -> dict[str, Any]:
    """The statistical model's numbers; every share is smoothed by one success and one failure."""
    rows = result["rows"]
    species, stage, near, found = rows[:, 0].astype(int), rows[:, 1].astype(int), rows[:, 2], rows[:, 3] > 0
    free = near >= NEAR_CROP_M
    recall = [
        [
            round(float((found[p].sum() + 1) / (p.sum() + 2)), 3)
            for g in range(3)
            for p in [free & (species == s) & (stage == g)]
        ]
        for s in (0, 1)
    ]
    expected = np.array(recall)[species, stage]
    close = ~free
    near_share = float(found[close].sum() / max(expected[close].sum(), 1e-9)) if close.any() else 1.0
    error, tool = rows[found][:, 4:6], rows[found][:, 6:8]
    # A correction to another plant, or to a corner of a large one, is none: the model then keeps the report.
    seen = np.hypot(tool[:, 0], tool[:, 1]) < LOCKED_M
    named_species, named_stage = rows[found][:, 8].astype(int), rows[found][:, 9].astype(int)

    def confusion(true: np.ndarray, named: np.ndarray, n: int) -> list[list[float]]:
        table = np.array([[np.count_nonzero((true == i) & (named == j)) + 0.2 for j in range(n)] for i in range(n)])
        share = (table / table.sum(axis=1, keepdims=True)).round(3)
        share[:, -1] = 1.0 - share[:, :-1].sum(axis=1)
        return [[round(float(v), 3) for v in row] for row in share]

    return {
        "recall": recall,
        "recall_near_crop": round(min(near_share, 1.0), 3),
        "near_crop_m": NEAR_CROP_M,
        "false_per_m2": round(result["false_per_m2"], 3),
        "crop_as_weed": round(result["crop_as_weed"], 4),
        "front_bias_m": [round(float(v), 5) for v in error.mean(axis=0)],
        "front_sigma_m": [round(float(v), 5) for v in error.std(axis=0)],
        "drift_share": DRIFT_SHARE,
        "slip_share": 0.0,
        "tool_recall": round(float(seen.mean()), 3),
        "tool_sigma_m": [round(float(v), 5) for v in np.sqrt((tool[seen] ** 2).mean(axis=0))],
        "species_confusion": confusion(species[found], named_species, 2),
        "stage_confusion": confusion(stage[found], named_stage, 3),
        "delay_s": DELAY_S,
        "frames_m": round(float(np.median(rows[found][:, 10])), 3),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write the fit to the package's assets")
    chosen = parser.parse_args(arguments)
    measured: dict[str, Any] = {}
    model: dict[str, object] = {}
    for tier, strips in STRIPS.items():
        result = measure(tier, strips)
        model = fit(result)
        found = result["rows"][:, 3]
        measured[tier] = {
            "frames": result["frames"],
            "weeds": len(found),
            "frame_precision": round(result["frame_precision"], 3),
            "frame_recall": round(result["frame_recall"], 3),
            "track_precision": round(result["track_precision"], 3),
            "track_recall": round(float(found.mean()), 3),
            **model,
        }
        print(tier, json.dumps(measured[tier]), flush=True)
    PerceptionModel(**{name: measured[FIT_TIER][name] for name in model})
    if chosen.write:
        content = {
            "comment": f"scripts/measure_weed_cameras.py; a picture every {FRAME_EVERY_M} m; drift and delay assumed",
            "model": {name: measured[FIT_TIER][name] for name in model},
            "measured": measured,
        }
        draft = OUTPUT.with_suffix(".new")
        draft.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        draft.replace(OUTPUT)
        print(f"wrote {OUTPUT}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
