"""A row of safflower as a value: its plants, its heads with their luck, and what the camera reports of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ..drives import DriveLuck
from ..field import Array, Camera, Field, Flags, Table, Toy, Whole, flag, label, number, whole
from .config import STAGES

ALONG_M, ACROSS_M, UP_M = (-3000.0, 3000.0), (-0.55, 0.55), (0.0, 4.0)
"""What a place may be; across the row the posts of the frame are 1.1 m apart."""
SPREAD_M = 0.04785
"""Filament spread of a head [published: 47.85 +- 3.73 mm]."""


@dataclass(frozen=True, eq=False)
class Plants(Table):
    """Plants in the order of the row; they matter to pictures alone."""

    along_m: Array = number("m", *ALONG_M, "where the stem leaves the ground, along the row")
    across_m: Array = number("m", *ACROSS_M, "across, from the middle of the row", 0.0)
    up_m: Array = number("m", *UP_M, "height of the block that its pot stands on", 0.0)
    height_m: Array = number("m", 0.0, 4.0, "of the plant", "task")
    crown_m: Array = number("m", 0.0, 1.0, "width of the crown", "task")


@dataclass(frozen=True, eq=False)
class Heads(Table):
    """Heads in any order."""

    along_m: Array = number("m", *ALONG_M, "centre of the filament tuft along the row; the first stop begins near 0")
    across_m: Array = number("m", *ACROSS_M, "across, from the middle of the row")
    up_m: Array = number("m", *UP_M, "above the ground")
    stage: Whole = label(STAGES, "how far it has bloomed; fresh and late heads are open")
    mass_g: Array = number("g", 0.0, 200.0, "useful filaments; only open heads bear any", "task")
    size_m: Array = number("m", 0.005, 0.2, "filament spread", SPREAD_M)
    occluded: Flags = flag("whether leaves hang over it", 0.0)
    cut_luck: Array = number("", -10.0, 10.0, "luck of its cut, standard normal", "normal")
    drop_luck: Array = number("", -10.0, 10.0, "luck of its collection, standard normal", "normal")
    plant: Whole = whole(0, 499, "plant that it stands on, from 0; by default the nearest", "task")
    slot: Whole = whole(0, 19_999, "place in the rules' arrays, which add grams up in this order", "task")


@dataclass(frozen=True, eq=False)
class Reports(Table):
    """What the statistical camera reports, in any order: policies are shown stop by stop, lane by lane."""

    along_m: Array = number("m", *ALONG_M, "reported place along the row")
    across_m: Array = number("m", -2.0, 2.0, "across, from the middle of the row")
    up_m: Array = number("m", -2.0, 6.0, "above the ground")
    stage: Whole = label(STAGES, "reported stage")
    size_m: Array = number("m", -1.0, 1.0, "reported filament spread", SPREAD_M)
    head: Whole = whole(0, 19_999, "head behind it, as row of the heads from 0; none where nothing is there", "task")


@dataclass(frozen=True, eq=False)
class Stands(Table):
    """How the cart stands at each stop on ground that is no plane, a row a stop."""

    heave_m: Array = number("m", -1.0, 1.0, "how much higher the frame stands than the ground under the row", 0.0)
    pitch_rad: Array = number("rad", -0.5, 0.5, "nose down", 0.0)
    roll_rad: Array = number("rad", -0.5, 0.5, "left side up", 0.0)


@dataclass(frozen=True, eq=False)
class Closings(Table):
    """When heads wilt, a row a head in their order."""

    closes_s: Array = number("s", 0.0, 1e6, "when its filaments have wilted, from the beginning of the episode")
    told_s: Array = number("s", 0.0, 1e6, "when the statistical camera reads that to be", "task")


@dataclass(frozen=True, eq=False)
class SafflowerField(Field):
    """A row of safflower with all of its luck.

    Attributes:
        heads: what there is to pick.
        plants: what bears it; synthesised from the heads where there are none.
        reports: what a camera will report; None where it is still to be drawn, or to be rendered.
        camera: whose reports they are; None where any statistical camera makes them.
        drives: luck of the machine's drives; None where none errs.
        stands: how the cart stands at its stops; drawn where the scenario's ground is rough and none are given.
        closings: when heads wilt; drawn where the scenario lets them and none are given.
    """

    task: ClassVar[str] = "safflower"
    main: ClassVar[str] = "heads"
    places: ClassVar[tuple[str, ...]] = ("along_m", "across_m", "up_m")

    heads: Heads
    plants: Plants | None = None
    reports: Reports | None = None
    camera: Camera | None = None
    drives: DriveLuck | None = None
    stands: Stands | None = None
    closings: Closings | None = None

    @classmethod
    def toy(cls) -> tuple[Toy, ...]:
        """Two pots with so few heads, all of average luck and reported as they are, that one sees what is best."""
        small = {"scenario.plants": 2, "scenario.max_heads": 2, "slots": 4}
        one = _toy([(0.0, 0.0, 0.80)], ["fresh"], [0.4])
        none = _toy([(0.0, 0.25, 0.80), (0.1, 0.0, 0.80)], ["fresh", "bud"], [0.4, 0.0])
        two = _toy([(-0.15, 0.0, 0.85), (0.15, 0.05, 0.80)], ["late", "fresh"], [0.2, 0.6])
        haste = {**small, "scenario.time_limit_s": 10.0}
        return (
            Toy(
                "one-head",
                one,
                small,
                0.9673137313533018,
                0.2128197141184426,
                "three strokes and three seconds of suction pay for their time; then the machine drives on and leaves",
            ),
            Toy("nothing", none, small, 0.0, -0.0345, "one head is out of reach, the other a bud: drive on and leave"),
            Toy(
                "haste",
                two,
                haste,
                0.7254852985149762,
                0.42397501878768207,
                "any pick outlasts the time limit: take the heavier head, thoroughly",
            ),
        )


def _toy(place: Sequence[tuple[float, float, float]], stage: Sequence[str], mass_g: Sequence[float]) -> SafflowerField:
    """Heads of average size and luck at world places, and exact reports of them."""
    along, across, up = np.array(place).T
    n, stages = len(place), [STAGES.index(name) for name in stage]
    where = {
        "along_m": along,
        "across_m": across,
        "up_m": up,
        "stage": np.array(stages),
        "size_m": np.full(n, SPREAD_M),
    }
    luck = {"cut_luck": np.zeros(n), "drop_luck": np.zeros(n)}
    heads = replace(Heads.empty(n), **where, **luck, mass_g=np.array(mass_g))
    return SafflowerField(heads, reports=Reports(**where, head=np.arange(n)))
