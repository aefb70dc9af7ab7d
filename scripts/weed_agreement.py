"""How well the fitted model of the weeders' cameras stands for the cameras: kills and losses, tier by tier.

    python scripts/weed_agreement.py [--eyes learned] [--pictures easy] [--fields 20] [--tier load-1.0 ...]

Both cameras look at rendered strips on level ground that nothing was trained, fitted or chosen on. What they tell of is
handed to the rules as reports, at every load whose fields these are, and a policy works on it; then the model reports
of the same fields, several times each, and the same policy works on that. Differences are paired by field, each with
its 95 % interval over resampled fields. Weeds are counted by category of the budget (``weed_budget.py``) too: what
shows of a weed is the pictures', whether it becomes a track and how far that is off is the model's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.perception import PerceptionModel
from fieldgym.envs.weeding.sighting import Cameras, draw_tracks
from fieldgym.envs.weeding.timing import G
from fieldgym.envs.weeding.tools.laser.calibration import Seen
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.env import laser_core
from fieldgym.kernels.seeds import EYES_SHOWN
from fieldgym.scripts.weed_budget import bootstrapped, played, told
from fieldgym.scripts.weed_looks import CATEGORIES, RIGHT, Shown, Strip, look_at, sorted_out, usual_px

SKIPPED = 100
"""Fields of the block that the budget's figures are of."""
SAME_FIELDS = {"load-1.0": ("load-0.7", "load-1.25", "load-1.6"), "load-1.0-even": ("load-1.6-even",)}
"""Tiers that show the fields of another one at other speeds."""
TIERS = ("load-1.0", "load-1.0-even", "dense", "patchy")
DRAWS = 10
"""Times that the model reports of every field, each time anew."""
FALSE = "false tracks, per weed"
NAMES = (RIGHT, *CATEGORIES, FALSE)


def reported(model: PerceptionModel, tier: str, strips: Sequence[Strip], draw: int) -> list[Seen]:
    """What the model reports of fields, in the shape of what cameras see."""
    config = replace(WeedingConfig(), scenario=SCENARIOS[tier])
    core, cameras = laser_core(config, None), Cameras.of(config.scenario, config.cart, model)
    plants = core.stack([strip.field for strip in strips]).plants
    uniforms, normals = cameras.random_numbers(plants.exists.shape[1])
    rng = np.random.default_rng(draw)
    uniform, normal = rng.random((len(strips), uniforms)), rng.normal(size=(len(strips), normals))
    exact, carried = (draw_tracks(cameras, plants, uniform, n) for n in (np.zeros_like(normal), normal))
    found = []
    for r, strip in enumerate(strips):
        # The odometry takes all tracks along, so that they stay in order, but for those at the band's ends.
        n = min(int(exact.count[r]), int(carried.count[r]))
        place, aim = exact.report[r, :n], exact.aim[r, :n]
        off = np.zeros((n, 2))
        off[:, G.along] = cameras.drift_m * normal[r, 0]
        named = np.column_stack([exact.species[r, :n], exact.stage[r, :n]]).astype(float)
        found.append(
            strip.seen._replace(
                place=place,
                told=place + off,
                aim=aim,
                found=np.ones(n),
                named=named,
                confidence=exact.confidence[r, :n],
                confirmed_m=np.zeros(n),
            )
        )
    return found


def shares(strips: Sequence[Strip]) -> NDArray[np.float64]:
    """Of every field (fields, 11): percent of its weeds in each category, and false tracks per hundred of them."""
    rows = []
    for strip in strips:
        counts = [strip.category.count(name) for name in NAMES[:-1]]
        rows.append(np.array([*counts, len(strip.false)]) * 100.0 / max(len(strip.category), 1))
    return np.array(rows)


def said(differences: NDArray[np.float64]) -> str:
    """Mean of differences (n,) and its interval, as text."""
    mean, (low, high) = bootstrapped(differences)
    return f"{mean:+.1f} [{low:.1f}, {high:.1f}]"


def compared(
    tier: str, model: PerceptionModel, strips: Sequence[Strip], how: Sequence[Shown], policy: str, **settings: Any
) -> tuple[list[tuple[str, NDArray[np.float64], NDArray[np.float64]]], NDArray[np.float64], NDArray[np.float64]]:
    """Kill shares (fields,) by cameras and model at every load of a tier's fields, and shares of categories by both."""
    usual = usual_px([strip.seen for strip in strips], how)
    draws = []
    for draw in range(DRAWS):
        seen = reported(model, tier, strips, draw)
        draws.append([sorted_out(s.field, one, h, usual) for s, one, h in zip(strips, seen, how, strict=True)])
    kills = []
    for load in (tier, *SAME_FIELDS.get(tier, ())):
        cameras = played(load, policy, [told(s) for s in strips], **settings).killed
        many = [
            played(load, policy, [told(s) for s in draw], seed, **settings).killed for seed, draw in enumerate(draws)
        ]
        kills.append((load, cameras, np.mean(many, axis=0)))
    return kills, shares(strips), np.mean([shares(draw) for draw in draws], axis=0)


def main(
    eyes: str = "learned",
    pictures: str = "easy",
    fields: int = 20,
    tier: Annotated[list[str] | None, typer.Option(help="On level ground; may be repeated.")] = None,
    policy: str = "edf",
    first_seed: Annotated[int, typer.Option(help="Of the fields.")] = EYES_SHOWN.first + SKIPPED,
) -> None:
    """Look, report, play both, print both."""
    console, model = Console(width=120), PerceptionModel.measured(eyes, pictures)
    kills = Table("tier", "cameras, %", "model, %", "model - cameras, points")
    losses = Table("of the weeds, %", *(f"{name}: cameras, model - cameras" for name in tier or TIERS))
    columns = []
    for name in tier or TIERS:
        strips, how = look_at(eyes, pictures, name, fields, first_seed)
        rows, seen, drawn = compared(name, model, strips, how, policy, eyes=eyes, pictures=pictures)
        for load, cameras, modelled in rows:
            kills.add_row(load, f"{cameras.mean():.1f}", f"{modelled.mean():.1f}", said(modelled - cameras))
        columns.append([f"{a.mean():.1f}, {said(b - a)}" for a, b in zip(seen.T, drawn.T, strict=True)])
    for row in zip(NAMES, *columns, strict=True):
        losses.add_row(*row)
    console.print(f"[bold]{eyes} eyes, {pictures} pictures, {policy}, {fields} fields a tier, {DRAWS} draws[/bold]")
    console.print(kills)
    console.print(losses)


if __name__ == "__main__":
    typer.run(main)
