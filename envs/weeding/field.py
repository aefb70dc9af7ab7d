"""A strip of field as a value: its weeds and crop plants with their luck, and what the cameras report of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np

from ..drives import DriveLuck
from ..field import Array, Camera, Field, Table, Toy, Whole, label, number
from .config import SPECIES, STAGES

_ALONG_M, _ACROSS_M = (-10.0, 510.0), (-2.0, 2.0)
_HEIGHT_M = -2.0, 2.0
_LARGEST = 1.0 - 2.0**-53
"""Uniform numbers are smaller than 1."""


@dataclass(frozen=True, eq=False)
class Weeds(Table):
    """Weeds in any order."""

    along_m: Array = number("m", *_ALONG_M, "along the row; the strip begins at 0")
    across_m: Array = number("m", *_ACROSS_M, "across, from the middle of the row")
    species: Whole = label(SPECIES, "broadleaf or grass", 0.0)
    stage: Whole = label(STAGES, "how far it has grown", 1.0)
    luck: Array = number("", 0.0, _LARGEST, "rank of what it can take among its kind, uniform", "uniform")
    look: Array = number("", 0.0, _LARGEST, "whatever only pictures show (turn, shade), uniform", "uniform")


@dataclass(frozen=True, eq=False)
class Crops(Table):
    """Crop plants of the working width in any order; those beyond the strip's ends can be seen but not lost."""

    along_m: Array = number("m", *_ALONG_M, "along the row")
    across_m: Array = number("m", *_ACROSS_M, "across, from the middle of the working width", 0.0)
    luck: Array = number("", 0.0, _LARGEST, "rank of what it can take, uniform", "uniform")


@dataclass(frozen=True, eq=False)
class Reports(Table):
    """The tracks that the statistical cameras make, in any order.

    A tool camera that looks after the move sees a plant at the aim where that is near to where it looks then.
    """

    along_m: Array = number("m", -20.0, 520.0, "where the machine believes a plant when it aims, along the row")
    across_m: Array = number("m", *_ACROSS_M, "the same across")
    aim_along_m: Array = number("m", -20.0, 520.0, "where the tool camera has the tool set", "task")
    aim_across_m: Array = number("m", -3.0, 3.0, "the same across", "task")
    species: Whole = label(SPECIES, "reported", 0.0)
    stage: Whole = label(STAGES, "reported", 1.0)
    crop_gap_m: Array = number("m", 0.0, 2000.0, "reported distance to the nearest crop plant", "task")
    behind: Whole = label(("nothing", "weed"), "what is behind it; for the count of blank shots alone", "task")
    confidence: Array = number("", 0.0, 1.0, "how sure the cameras are that it is a weed", 1.0)


@dataclass(frozen=True, eq=False)
class Ground(Table):
    """What the whole strip has, in one row."""

    look: Array = number("", 0.0, _LARGEST, "error of the odometry and looks of the soil, uniform", "uniform")


@dataclass(frozen=True, eq=False)
class Profile(Table):
    """Ground that is not level, by rows along the strip in ascending order; even between them."""

    along_m: Array = number("m", -20.0, 520.0, "along the row")
    left_m: Array = number("m", *_HEIGHT_M, "height under the left wheels' line")
    middle_m: Array = number("m", *_HEIGHT_M, "height under the crop row")
    right_m: Array = number("m", *_HEIGHT_M, "height under the right wheels' line")
    slip_m: Array = number("m", -50.0, 50.0, "way that the odometry has counted too much since the first row", 0.0)
    sway_m: Array = number("m", -0.5, 0.5, "the wheels' way beside the row, to the left", 0.0)


@dataclass(frozen=True, eq=False)
class WeedField(Field):
    """A strip of field with all of its luck.

    Attributes:
        weeds: what there is to kill.
        crops: the crop rows; the scenario's regular one where none is given.
        ground: of rendered pictures.
        reports: what the cameras will report; None where it is still to be drawn, or to be rendered.
        camera: whose reports they are; None where any statistical camera makes them.
        drives: luck of the machine's drives; None where none errs.
        profile: the ground's heights; drawn where the scenario's ground shakes and none is given.
    """

    task: ClassVar[str] = "weeding"
    main: ClassVar[str] = "weeds"

    weeds: Weeds
    crops: Crops | None = None
    ground: Ground | None = None
    reports: Reports | None = None
    camera: Camera | None = None
    drives: DriveLuck | None = None
    profile: Profile | None = None

    @classmethod
    def toy(cls, tool: Literal["laser", "hoe"] = "laser") -> tuple[Toy, ...]:
        """Strips of 0.3 m with so few weeds that everything can be tried; what is best depends on the tool."""
        alone, beside, abreast = (
            strip([(0.15, 0.05)]),
            strip([(0.15, 0.0)], crops=[(0.15, 0.004)], crop_luck=0.1),
            strip([(0.15, -0.15), (0.15, 0.0), (0.15, 0.15)]),
        )
        gentlest = "it stands alone and the gentlest mode kills it: work on it in that mode as it comes, then drive off"
        harm = "any work on it kills the crop plant beside it, which costs more than the weed is worth: leave it"
        pace = "three abreast pass too fast for all of them: take what there is time for, in the gentlest mode"
        if tool == "laser":
            return (
                Toy("one-weed", alone, _SMALL, 1.0, 0.8474489795918367, gentlest),
                Toy("crop-beside", beside, _SMALL, 1.0, -0.5, harm),
                Toy("haste", abreast, {**_SMALL, "scenario.offered_load": 7.0}, 2.0 / 3.0, 1.8632454923356543, pace),
            )
        return (
            Toy("one-weed", alone, _SMALL, 1.0, 0.6681675595827038, gentlest),
            Toy("crop-beside", beside, _SMALL, 1.0, -0.5, harm),
            Toy("haste", abreast, {**_SMALL, "scenario.offered_load": 6.0}, 1.0 / 3.0, 0.8705346814681263, pace),
        )


_SMALL: dict[str, Any] = {"scenario.strip_m": 0.3, "scenario.max_weeds": 8, "slots": 4, "cart.moment_s": 0.4}


def strip(
    weeds: Sequence[tuple[float, float]],
    crops: Sequence[tuple[float, float]] = (),
    *,
    species: str = SPECIES[0],
    stage: str = STAGES[1],
    luck: float | Sequence[float] = 0.5,
    crop_luck: float = 0.5,
) -> WeedField:
    """A field of weeds of one kind and crop plants at places (along, across), and exact reports of the weeds.

    Args:
        weeds: places.
        crops: places; no others stand there.
        species: of all weeds.
        stage: of all weeds.
        luck: of the weeds, one for all or one each; 0.5 is the average.
        crop_luck: of the crop plants.
    """
    n, m = len(weeds), len(crops)
    along, across = np.array(weeds, float).reshape(-1, 2).T
    crop_along, crop_across = np.array(crops, float).reshape(-1, 2).T
    kind = {"species": np.full(n, SPECIES.index(species)), "stage": np.full(n, STAGES.index(stage))}
    place = {"along_m": along, "across_m": across}
    bare = Reports.empty(n)
    return WeedField(
        weeds=Weeds(**place, **kind, luck=np.broadcast_to(np.asarray(luck, float), n), look=np.full(n, 0.5)),
        crops=Crops(crop_along, crop_across, np.full(m, crop_luck)),
        ground=Ground(np.array([0.5])),
        reports=replace(
            bare, **place, **kind, aim_along_m=along, aim_across_m=across, behind=np.ones(n), confidence=np.ones(n)
        ),
    )
