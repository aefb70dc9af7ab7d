"""Measure the weeder's cameras on rendered pictures and fit the statistical perception to them.

Drives the front camera over strips whose seeds no benchmark uses, joins its tracks with the true plants, sends the tool
camera to every track with the odometry's error, and writes the fit to ``assets/perception/weeding.json``. The tiers
``load-*`` show the same fields at other speeds, so they share one measurement. With ``--compare`` it then plays whole
episodes on other seeds with the cameras, with the fit and with perfect perception, side by side.

Run: ``python scripts/measure_weed_cameras.py [--write] [--compare SEEDS [--policy edf ...]]``.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from fieldgym.agents import make_policy
from fieldgym.envs.weeding.config import SCENARIOS, PerceptionModel, WeedingConfig
from fieldgym.envs.weeding.env import laser_core
from fieldgym.envs.weeding.scenario import is_crowded, nearest_crop, nearest_weed
from fieldgym.envs.weeding.view import DELAY_S, DRIFT_SHARE, FRAME_EVERY_M, SAME_M, FrontCamera, WeederView

STRIPS = {"load-1.0": 8, "load-1.0-even": 3, "dense": 9}
FIRST_SEED, FIRST_COMPARED = 900_000, 950_000
MATCH_M = 0.015
"""A track belongs to a weed when it ends within this distance of it; nearest pairs first, one to one."""
PART_M, CANOPY_M = 0.040, 0.060
"""A false track this near to a weed is a part of it; this near to a crop plant, it is at its leaves."""
CROP_AS_WEED_M = 0.020
"""A false track this near to a crop plant's stem would cost the crop plant."""
CROP_GAP_M, WEED_GAP_M, CROWDED_M = (0.030, 0.045, 0.060), (0.012, 0.025, 0.050), (0.060, 0.030)
KEPT = 48
"""Sightings kept of each class."""
OUTPUT = Path(__file__).resolve().parent.parent / "assets" / "perception" / "weeding.json"


class Strips(NamedTuple):
    """What was measured on the strips of one tier.

    Attributes:
        weeds: (n, 4), species, stage, distance to the nearest crop plant and to the nearest weed.
        sightings: (n, 7), see ``PerceptionModel``; NaN where the weed did not become a track.
        after_m: (n,), way from entering the view to confirmation, NaN as before.
        false: per class of false tracks, their sightings.
        crops: crop plants.
        area_m2: treated area.
        counts: pictures, true weeds, plants and hits in single pictures, crop plants taken for weeds.
    """

    weeds: np.ndarray
    sightings: np.ndarray
    after_m: np.ndarray
    false: list[list[tuple[float, ...]]]
    crops: int
    area_m2: float
    counts: dict[str, int]


def measure(tier: str, strips: int) -> Strips:
    """Drive over the strips of a tier."""
    config = replace(WeedingConfig(), scenario=SCENARIOS[tier])
    core = laser_core(config, None)
    view = WeederView(core, config)
    weeds, sightings, after = [], [], []
    false: list[list[tuple[float, ...]]] = [[], [], []]
    crops, area = 0, 0.0
    counts: dict[str, int] = dict.fromkeys(("pictures", "truth", "plants", "hits", "crop_as_weed"), 0)
    for strip in range(strips):
        core.reset_rows(np.zeros(1, np.int64), [np.random.default_rng(FIRST_SEED + strip)])
        scene = view.camera_scene()
        view.show_strip(scene)
        front = FrontCamera(scene, -config.cart.start_m, 0.0)
        end = core.weeds_end
        exists = core.plant_exists[0, :end]
        weed, crop = core.state.plant[0, :end][exists], core.state.plant[0, end:]
        stage, species = core.state.plant_kind[0, :end][exists], core.plant_species[0, :end][exists]
        drive(config, front, weed, counts)
        tracks = [t for t in front.tracker.tracks if np.isfinite(t.confirmed_m) and not t.is_crop and not t.is_doubtful]
        tracks = [t for t in tracks if abs(t.place[1]) <= 0.5 * config.scenario.band_m]
        place = np.array([t.place for t in tracks]).reshape(-1, 2)
        # The tool camera is sent where the odometry believes the plant is; its error is one value a strip.
        drift = DRIFT_SHARE * np.sqrt(3.0) * np.random.default_rng(FIRST_SEED + strip).uniform(-1.0, 1.0)
        told = place + np.array([config.cart.unseen_m * drift, 0.0])
        seen = [view.tool_aim(t) for t in told]
        aim = np.array([t if a is None else a for t, a in zip(told, seen, strict=True)]).reshape(-1, 2)
        named = [(t.votes.sum(axis=1).argmax(), t.votes.sum(axis=0).argmax()) for t in tracks]

        def sighting(
            i: int, owner: np.ndarray, place: Any = place, aim: Any = aim, seen: Any = seen, named: Any = named
        ):
            return (*(place[i] - owner), *(aim[i] - owner), float(seen[i] is not None), *map(float, named[i]))

        pairs = {b: a for a, b in match(place, weed)}
        weeds.append(np.column_stack([species, stage, nearest_crop(config.scenario, crop[None], weed[None])[0]]))
        weeds[-1] = np.column_stack([weeds[-1], nearest_weed(weed[None])[0]])
        for j in range(len(weed)):
            i = pairs.get(j)
            sightings.append((np.nan,) * 7 if i is None else sighting(i, weed[j]))
            entered = weed[j, 0] - config.cart.seen_ahead_m
            after.append(np.nan if i is None else tracks[i].confirmed_m - entered)
        for i in set(range(len(tracks))) - set(pairs.values()):
            if same_plant(i, pairs.values(), told, aim):
                continue
            to_weed, to_crop = (np.hypot(*(p - place[i]).T) for p in (weed, crop))
            kind = 0 if to_weed.min() < PART_M else 1 if to_crop.min() < CANOPY_M else 2
            owner = (weed[to_weed.argmin()], crop[to_crop.argmin()], place[i])[kind]
            false[kind].append(sighting(i, owner))
            counts["crop_as_weed"] += int(np.hypot(*(crop - aim[i]).T).min() < CROP_AS_WEED_M)
        crops += int(np.count_nonzero((crop[:, 0] >= 0.0) & (crop[:, 0] <= config.scenario.strip_m)))
        area += config.scenario.strip_m * config.scenario.band_m
    view.close()
    return Strips(np.concatenate(weeds), np.array(sightings), np.array(after), false, crops, area, counts)


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


def same_plant(i: int, others: Any, told: np.ndarray, aim: np.ndarray) -> bool:
    """Whether a false track is dropped with a true one: the first shot at either treats both."""
    main = np.array(sorted(others), int)
    ahead, behind = np.hypot(*(told[i] - aim[main]).T), np.hypot(*(told[main] - aim[i]).T)
    return bool(len(main)) and bool(min(ahead.min(), behind.min()) <= SAME_M)


def fit(parts: list[Strips]) -> dict[str, Any]:
    """The statistical model's numbers from the strips of all tiers."""
    weeds, rows = (np.concatenate([getattr(p, name) for p in parts]) for name in ("weeds", "sightings"))
    species, stage, found = weeds[:, 0].astype(int), weeds[:, 1].astype(int), np.isfinite(rows[:, 0])
    kind = 3 * species + stage
    bins = kind, np.searchsorted(CROP_GAP_M, weeds[:, 2]), np.searchsorted(WEED_GAP_M, weeds[:, 3])
    chance = factors(bins, (6, len(CROP_GAP_M) + 1, len(WEED_GAP_M) + 1), found)
    shape = replace(PerceptionModel.perfect(), crowded_m=CROWDED_M)
    table = 6 * is_crowded(shape, weeds[:, 2], weeds[:, 3]) + kind
    generator = np.random.default_rng(0)
    totals = [sum(len(p.false[c]) for p in parts) for c in range(3)]
    per = len(weeds), sum(p.crops for p in parts), sum(p.area_m2 for p in parts)
    after = np.concatenate([p.after_m for p in parts])
    return {
        "recall": [[round(float(v), 3) for v in chance[0][3 * s : 3 * s + 3]] for s in (0, 1)],
        "crop_gap_m": list(CROP_GAP_M),
        "recall_near_crop": [round(float(v), 3) for v in chance[1]],
        "weed_gap_m": list(WEED_GAP_M),
        "recall_near_weed": [round(float(v), 3) for v in chance[2]],
        "crowded_m": list(CROWDED_M),
        "sightings": [kept(rows[found & (table == c)], generator) for c in range(12)],
        "false_rates": [round(float(t / n), 4) for t, n in zip(totals, per, strict=True)],
        "false_sightings": [
            kept(np.array([row for p in parts for row in p.false[c]]).reshape(-1, 7), generator) for c in range(3)
        ],
        "drift_share": DRIFT_SHARE,
        "delay_s": DELAY_S,
        "frames_m": round(float(np.nanmedian(after)), 3),
    }


def factors(bins: tuple[np.ndarray, ...], sizes: tuple[int, ...], found: np.ndarray) -> list[np.ndarray]:
    """Factors whose product predicts ``found``: each bin's predicted sum equals its true one.

    Iterative scaling, one success and one failure added to each bin; the outermost bins of all but the first are 1.
    """
    chance = [np.ones(n) for n in sizes]
    chance[0][:] = found.mean()
    for _ in range(200):
        for axis, bin_ in enumerate(bins):
            product = np.prod([c[b] for c, b in zip(chance, bins, strict=True)], axis=0)
            hits = np.bincount(bin_, found, sizes[axis]) + 1.0
            expected = np.bincount(bin_, np.minimum(product, 1.0), sizes[axis]) + 1.0 / max(found.mean(), 1e-9)
            chance[axis] = chance[axis] * hits / expected
            if axis:
                chance[0], chance[axis] = chance[0] * chance[axis][-1], chance[axis] / chance[axis][-1]
    return [np.minimum(c, 1.0) for c in chance]


def kept(rows: np.ndarray, generator: np.random.Generator) -> list[list[float]]:
    """At most ``KEPT`` of the rows (n, 7), tenths of millimetres, in a fixed order; one row of zeros for none."""
    if not len(rows):
        return [[0.0] * 7]
    chosen = rows[np.sort(generator.permutation(len(rows))[:KEPT])]
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


def play(scenario: str, policy: str, perception: str, seed: int) -> dict[str, float]:
    """The scorecard of one episode."""
    env: Any = gym.make("fieldgym/LaserWeeding-v0", backend="analytic", perception=perception, scenario=scenario)
    rule = make_policy(policy, env, seed=1)
    observation, info = env.reset(seed=seed)
    over = False
    while not over:
        action = rule.act({name: values[None] for name, values in observation.items()})
        observation, _, end, cut, info = env.step(int(np.asarray(action).reshape(-1)[0]))
        over = end or cut
    env.close()
    return info["scorecard"]


def compare(scenario: str, policies: Sequence[str], seeds: int) -> None:
    """Print net rates and what goes with them, paired by seed, for cameras, fit and perfect perception."""
    fields = "net_rate", "crop_loss_percent", "tracks", "shots", "blank_shots", "cycle_time_s"
    for policy in policies:
        cards = {
            p: [play(scenario, policy, p, FIRST_COMPARED + s) for s in range(seeds)]
            for p in ("camera", "model", "perfect")
        }
        for name, rows in cards.items():
            means = {f: round(float(np.mean([row[f] for row in rows])), 4) for f in fields}
            print(f"{scenario} {policy:16s} {name:8s} {json.dumps(means)}", flush=True)
        difference = np.array(
            [m["net_rate"] - c["net_rate"] for m, c in zip(cards["model"], cards["camera"], strict=True)]
        )
        error = difference.std(ddof=1) / np.sqrt(seeds) if seeds > 1 else np.nan
        print(f"{scenario} {policy:16s} model - camera {difference.mean():+.4f} +- {error:.4f} (1 s.e., {seeds} seeds)")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="measure, and write the fit to the package's assets")
    parser.add_argument("--compare", type=int, default=0, metavar="SEEDS", help="play this many episodes of each kind")
    parser.add_argument("--policy", nargs="+", default=["edf", "receding-horizon"])
    parser.add_argument("--scenario", default="load-1.0", choices=sorted(SCENARIOS))
    chosen = parser.parse_args(arguments)
    if chosen.write or not chosen.compare:
        parts = {tier: measure(tier, strips) for tier, strips in STRIPS.items()}
        for tier, strips in parts.items():
            print(tier, json.dumps(summary(strips)), flush=True)
        model = fit(list(parts.values()))
        PerceptionModel.from_json(model)
        if chosen.write:
            write(model, {tier: summary(strips) for tier, strips in parts.items()})
    if chosen.compare:
        compare(chosen.scenario, chosen.policy, chosen.compare)
    return 0


def write(model: dict[str, Any], measured: dict[str, Any]) -> None:
    """Write the fit, one sighting a line at most."""
    comment = f"scripts/measure_weed_cameras.py; a picture every {FRAME_EVERY_M} m; drift and delay assumed"
    fields = ",\n".join(f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in model.items())
    text = f'{{\n "comment": {json.dumps(comment)},\n "model": {{\n{fields}\n }},\n'
    text += f' "measured": {json.dumps(measured, indent=1)}\n}}\n'
    json.loads(text)
    draft = OUTPUT.with_suffix(".new")
    draft.write_text(text, encoding="utf-8")
    draft.replace(OUTPUT)
    print(f"wrote {OUTPUT}")


if __name__ == "__main__":
    sys.exit(main())
