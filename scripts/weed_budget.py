"""Where the weeders' cameras lose kills: what would be won if only one of their faults were gone.

    python scripts/weed_budget.py [--eyes classical --eyes learned] [--pictures easy] [--fields 20]
        [--scenario load-1.0] [--policy edf] [--played]

Both cameras look at rendered strips that nothing was trained, fitted or chosen on. Every weed is put into one category;
then the tracks are handed to the rules as reports of a field, as they are and with one category after the other put
right, and a policy works on each. Differences are paired by field. ``--played`` also has the policy drive with the
cameras themselves, which the reports stand for.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, NamedTuple

import cv2
import gymnasium as gym
import numpy as np
import typer
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

import fieldgym  # noqa: F401
from fieldgym.agents import make_policy
from fieldgym.agents.rollout import batch_decisions, decisions
from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.field import Reports, WeedField
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
MODEL_DRAWS = 10
"""Times that the cameras' model reports of every field, each time anew."""
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
    kinds = np.concatenate([3 * seen.kind[:, 0] + seen.kind[:, 1] for _, seen, _ in found])
    most = np.concatenate([how.most_px for *_, how in found])
    usual = np.array([np.percentile(most[kinds == k], 75) if (kinds == k).any() else 1.0 for k in range(6)])
    return [_sorted_out(*one, usual) for one in found]


def _sorted_out(field: WeedField, seen: Seen, how: Shown, usual_px: NDArray[np.float64]) -> Strip:
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


def told(strip: Strip, right: Sequence[str] = (), false: bool = True, named: bool = False) -> WeedField:
    """A strip with its tracks, those of some categories put right, without false ones or with right names."""
    seen, rows, half_m = strip.seen, [], 0.5 * WeedingConfig().scenario.band_m
    for j, i in enumerate(strip.pair.tolist()):
        exact = strip.category[j] in right
        if i < 0 and not exact:
            continue
        place, aim = (seen.weed[j], seen.weed[j]) if exact else (seen.told[i], seen.aim[i])
        rows.append(
            (*place, *aim, *(seen.kind[j] if exact or named else seen.named[i]), 1.0 if i < 0 else seen.confidence[i])
        )
    rows += [(*seen.told[i], *seen.aim[i], *seen.named[i], seen.confidence[i]) for i in (strip.false if false else ())]
    table = np.array(rows, float).reshape(-1, 7)
    # What the odometry puts beside the band is not told of.
    table = table[np.abs(table[:, 1]) <= half_m]
    reports = replace(
        Reports.empty(len(table)),
        along_m=table[:, 0],
        across_m=table[:, 1],
        aim_along_m=table[:, 2],
        aim_across_m=table[:, 3],
        species=table[:, 4].astype(np.int64),
        stage=table[:, 5].astype(np.int64),
        confidence=table[:, 6],
    )
    return replace(strip.field, reports=reports)


class Played(NamedTuple):
    """Kill share and crop loss in percent (fields,), and of every field which weeds died."""

    killed: NDArray[np.float64]
    crop: NDArray[np.float64]
    dead: list[NDArray[np.bool_]]


def played(
    scenario: str, policy: str, fields: Sequence[WeedField], seed: int = 0, perception: str = "model", **settings: Any
) -> Played:
    """Let a policy work on what is reported of fields, by themselves or by the cameras' model."""
    env: Any = gym.make_vec(
        "fieldgym/LaserWeeding-v0",
        num_envs=len(fields),
        vectorization_mode="vector_entry_point",
        scenario=scenario,
        perception=perception,
        autoreset_mode=AutoresetMode.DISABLED,
        **settings,
    ).unwrapped
    observation, _ = env.reset(seed=seed, options={"fields": fields})
    killed, crop, dead = np.zeros(len(fields)), np.zeros(len(fields)), [np.zeros(0, bool)] * len(fields)
    core = env.core
    for decision in batch_decisions(env, make_policy(policy, env, seed=1), observation):
        for i in np.flatnonzero(decision.ending).tolist():
            card = decision.info["scorecard"]
            killed[i], crop[i] = 100.0 * card["net_rate"][i], card["crop_loss_percent"][i]
            died = core.state.plant_dose[i] >= core.state.plant_tolerance[i]
            dead[i] = died[: core.weeds_end][core.plant_exists[i, : core.weeds_end]]
    env.close()
    return Played(killed, crop, dead)


def driven(eyes: str, pictures: str, scenario: str, policy: str, fields: int) -> Played:
    """Let a policy drive over the same fields with the cameras themselves."""
    env: Any = gym.make(
        "fieldgym/LaserWeeding-v0", scenario=scenario, backend="analytic", perception="camera", eyes=eyes,
        pictures=pictures,
    )  # fmt: skip
    chosen = make_policy(policy, env, seed=1)
    killed, crop = np.zeros(fields), np.zeros(fields)
    for field in range(fields):
        observation, _ = env.reset(seed=FRESH_SEED + field)
        card = {}
        for decision in decisions(env, chosen, observation):
            card = decision.info["scorecard"]
        killed[field], crop[field] = 100.0 * card["net_rate"], card["crop_loss_percent"]
    env.close()
    return Played(killed, crop, [])


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


def by_kind(strips: Sequence[Strip]) -> Table:
    """Recall and aim by species and stage."""
    table = Table("kind", "weeds", "recall", "aim <= 2 mm", "error 50 % mm", "90 % mm")
    kind = np.concatenate([3 * s.seen.kind[:, 0] + s.seen.kind[:, 1] for s in strips])
    error = np.concatenate([s.error_m for s in strips])
    for k, name in enumerate(
        f"{s} {g}" for s in ("broadleaf", "grass") for g in ("cotyledon", "two-leaf", "four-leaf")
    ):
        own = error[kind == k]
        if len(own):
            half, most = np.nanpercentile(own, [50, 90])
            cells = f"{np.isfinite(own).mean():.2f}", f"{(own <= RIGHT_M).mean():.2f}"
            table.add_row(name, str(len(own)), *cells, f"{1e3 * half:.2f}", f"{1e3 * most:.2f}")
    return table


def budget(scenario: str, policy: str, strips: Sequence[Strip]) -> Table:
    """What is won if only one fault were gone."""
    table = Table("if only this were right", "weeds", "killed now", "kill share, %", "won, points", "crop loss, %")
    base = played(scenario, policy, [told(s) for s in strips])
    category = np.concatenate([s.category for s in strips])
    dead = np.concatenate(base.dead)

    def row(name: str, count: str, fields: Sequence[WeedField] | None, now: str = "") -> None:
        got = base if fields is None else played(scenario, policy, fields)
        won = got.killed - base.killed
        spread = won.std(ddof=1) / np.sqrt(len(won)) if len(won) > 1 else 0.0
        difference = "" if fields is None else f"{won.mean():+.1f} +- {spread:.1f}"
        table.add_row(name, count, now, f"{got.killed.mean():.1f}", difference, f"{got.crop.mean():.2f}")

    def counted(name: str) -> tuple[str, str]:
        own = category == name
        return f"{own.sum()} ({100.0 * own.mean():.1f} %)", f"{dead[own].mean():.2f}"

    row("as it is", str(len(category)), None, f"{dead.mean():.2f}")
    table.add_row(RIGHT, *counted(RIGHT))
    for name in CATEGORIES:
        if (category == name).any():
            count, now = counted(name)
            row(name, count, [told(s, (name,)) for s in strips], now)
    row("no false tracks", str(sum(len(s.false) for s in strips)), [told(s, false=False) for s in strips])
    row("right names", "", [told(s, named=True) for s in strips])
    groups = {
        "nothing missed but the hidden": [c for c in CATEGORIES if c.startswith("missed")],
        "every aim right": [c for c in CATEGORIES if c.startswith("aim")],
    }
    for name, group in groups.items():
        row(name, "", [told(s, group) for s in strips])
    row("all but the hidden", "", [told(s, CATEGORIES[1:], False, True) for s in strips])
    row("everything", "", [told(s, CATEGORIES, False, True) for s in strips])
    return table


def bootstrapped(differences: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Mean of differences (n,) and its 95 % interval over resampled fields."""
    rng = np.random.default_rng(0)
    means = differences[rng.integers(0, len(differences), (2000, len(differences)))].mean(axis=1)
    return float(differences.mean()), np.percentile(means, [2.5, 97.5])


def main(
    eyes: Annotated[list[str] | None, typer.Option(help="classical, learned; may be repeated.")] = None,
    pictures: Annotated[str, typer.Option(help="easy or field.")] = "easy",
    fields: int = 20,
    scenario: str = "load-1.0",
    policy: str = "edf",
    drive: Annotated[bool, typer.Option("--played", help="Also drive with the cameras themselves.")] = False,
) -> None:
    """Look, sort out, play."""
    console = Console(width=120)
    first: NDArray[np.float64] | None = None
    for name in eyes or ["classical", "learned"]:
        strips = look(name, pictures, scenario, fields)
        console.print(f"[bold]{name} eyes, {pictures} pictures, {scenario}, {policy}, {fields} fields[/bold]")
        console.print("  ".join(f"{key} {value:.3f}" for key, value in figures(strips).items()))
        console.print(by_kind(strips))
        console.print(budget(scenario, policy, strips))
        bare = [replace(strip.field, reports=None) for strip in strips]
        perfect = played(scenario, policy, bare, perception="perfect").killed
        console.print(f"perfect perception kills {perfect.mean():.1f} %")
        if drive:
            got = driven(name, pictures, scenario, policy, fields)
            first = got.killed if first is None else first
            gap, ends = bootstrapped(got.killed - first)
            error = got.killed.std(ddof=1) / np.sqrt(fields)
            console.print(
                f"the cameras kill {got.killed.mean():.1f} +- {error:.1f} %, crop loss {got.crop.mean():.2f} %; "
                f"{gap:+.1f} [{ends[0]:.1f}, {ends[1]:.1f}] points against the first eyes"
            )
            draws = [
                played(scenario, policy, bare, seed, eyes=name, pictures=pictures).killed for seed in range(MODEL_DRAWS)
            ]
            gap, ends = bootstrapped(np.mean(draws, axis=0) - got.killed)
            console.print(
                f"their fitted model kills {np.mean(draws):.1f} %: {gap:+.1f} [{ends[0]:.1f}, {ends[1]:.1f}] points"
            )


if __name__ == "__main__":
    typer.run(main)
