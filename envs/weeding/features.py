"""What policies are shown: one declaration of the observation's columns, for kernels, spaces and documentation.

A feature is a quantity divided by its scale, to be of order one, and held to the space: what would be larger than
``LIMIT`` is shown as ``LIMIT``.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled, fill
from ..columns import Says, numbered, table_of
from ..core import Array

LIMIT = 10.0
"""Largest size of a number that policies are shown."""
ALONG_SCALE_M = 0.3
ACROSS_SCALE_M = 0.2
LEAVES_SCALE_S = 4.0
TIME_SCALE_S = 0.5
SPEED_SCALE = 0.1
CROP_GAP_SCALE_M = 0.05
"""What the features are divided by, to be of order one."""
CROP_GAP_LIMIT = 4.0
"""Farther than this, in units of the scale, a crop plant is out of every tool's reach."""


class Machine(NamedTuple):
    """The arm and its cart; a place is divided by its own range, see ``timing.Arm.scale``."""

    place: Annotated[int, Says("m", "arm before the cart's middle / its range", 1.0, -LIMIT, LIMIT)]
    lean_along: Annotated[int, Says("m", "what the tool leans along the row / its range", 1.0, -LIMIT, LIMIT)]
    lean_across: Annotated[int, Says("m", "the tool's place across the row / its range", 1.0, -LIMIT, LIMIT)]
    speed: Annotated[int, Says("m/s", "speed of the cart", SPEED_SCALE, 0.0, LIMIT)]
    set_speed: Annotated[int, Says("m/s", "commanded speed of the cart", SPEED_SCALE, 0.0, LIMIT)]
    progress: Annotated[int, Says("", "the cart's position / length of the strip", 1.0, -LIMIT, LIMIT)]
    backlog: Annotated[int, Says("", "candidates / slots", 1.0, 0.0, 1.0)]


class PoweredMachine(NamedTuple):
    """``Machine`` where energy is scarce: what stands there, and what is left."""

    place: Annotated[int, Says("m", "arm before the cart's middle / its range", 1.0, -LIMIT, LIMIT)]
    lean_along: Annotated[int, Says("m", "what the tool leans along the row / its range", 1.0, -LIMIT, LIMIT)]
    lean_across: Annotated[int, Says("m", "the tool's place across the row / its range", 1.0, -LIMIT, LIMIT)]
    speed: Annotated[int, Says("m/s", "speed of the cart", SPEED_SCALE, 0.0, LIMIT)]
    set_speed: Annotated[int, Says("m/s", "commanded speed of the cart", SPEED_SCALE, 0.0, LIMIT)]
    progress: Annotated[int, Says("", "the cart's position / length of the strip", 1.0, -LIMIT, LIMIT)]
    backlog: Annotated[int, Says("", "candidates / slots", 1.0, 0.0, 1.0)]
    energy: Annotated[int, Says("", "energy left / what there was", 1.0, 0.0, 1.0)]


class Candidate(NamedTuple):
    """A track; all zero in an empty slot."""

    present: Annotated[int, Says("", "1 where the slot is taken", 1.0, 0.0, 1.0)]
    along: Annotated[int, Says("m", "report minus the cart's position along the row", ALONG_SCALE_M, -LIMIT, LIMIT)]
    across: Annotated[int, Says("m", "report from the middle of the row", ACROSS_SCALE_M, -LIMIT, LIMIT)]
    leaves: Annotated[int, Says("s", "time until it leaves the window", LEAVES_SCALE_S, 0.0, LIMIT)]
    move: Annotated[int, Says("s", "motion to get there, in the normal mode", TIME_SCALE_S, 0.0, LIMIT)]
    wait: Annotated[int, Says("s", "time until it is within the window then", TIME_SCALE_S, 0.0, LIMIT)]
    grass: Annotated[int, Says("", "1 where a grass is reported", 1.0, 0.0, 1.0)]
    cotyledon: Annotated[int, Says("", "1 where the cotyledon stage is reported", 1.0, 0.0, 1.0)]
    two_leaf: Annotated[int, Says("", "1 where the two-leaf stage is reported", 1.0, 0.0, 1.0)]
    four_leaf: Annotated[int, Says("", "1 where the four-leaf stage is reported", 1.0, 0.0, 1.0)]
    crop_gap: Annotated[
        int, Says("m", "reported distance to the nearest crop plant", CROP_GAP_SCALE_M, 0.0, CROP_GAP_LIMIT)
    ]
    confidence: Annotated[int, Says("", "how sure the cameras are that it is a weed", 1.0, 0.0, 1.0)]
    done: Annotated[
        int, Says("", "dose of own shots at the reported place / what kills half of its kind", 1.0, 0.0, LIMIT)
    ]


class Lasting(NamedTuple):
    """What is shown of a track wherever the machine is, kept from decision to decision; see ``Candidate``."""

    across: Annotated[int, Says("m", "report from the middle of the row", ACROSS_SCALE_M)]
    grass: Annotated[int, Says("", "1 where a grass is reported")]
    cotyledon: Annotated[int, Says("", "1 where the cotyledon stage is reported")]
    two_leaf: Annotated[int, Says("", "1 where the two-leaf stage is reported")]
    four_leaf: Annotated[int, Says("", "1 where the four-leaf stage is reported")]
    crop_gap: Annotated[int, Says("m", "reported distance to the nearest crop plant", CROP_GAP_SCALE_M)]
    confidence: Annotated[int, Says("", "how sure the cameras are that it is a weed")]
    done: Annotated[int, Says("", "dose of own shots at the reported place / what kills half of its kind")]


M, C, L = numbered(Machine), numbered(Candidate), numbered(Lasting)
ENERGY = numbered(PoweredMachine).energy
"""Place of the energy that is left, behind all of ``Machine``."""
assert PoweredMachine._fields == (*Machine._fields, "energy")

candidate_table = table_of(Candidate)
"""Candidates (..., K, F) of an observation, one column a name of ``Candidate``."""


@compiled
def show_track(
    feature: NDArray[np.float32], across_m: float, species: int, stage: int, crop_gap_m: float, confidence: float
) -> None:
    """Write what lasts of a track, see ``Lasting``, but for what was done."""
    feature[L.across] = min(max(across_m * (1.0 / ACROSS_SCALE_M), -LIMIT), LIMIT)
    feature[L.grass] = species
    fill(feature[L.cotyledon : L.four_leaf + 1], 0.0)
    feature[L.cotyledon + stage] = 1.0
    feature[L.confidence] = confidence
    feature[L.crop_gap] = min(crop_gap_m * (1.0 / CROP_GAP_SCALE_M), CROP_GAP_LIMIT)


@compiled
def show_tracks(
    features: NDArray[np.float32],
    across_m: Array,
    species: NDArray[np.int64],
    stage: NDArray[np.int64],
    crop_gap_m: Array,
    confidence: Array,
) -> None:
    """``show_track`` of tracks (n, F)."""
    for i in range(len(features)):
        show_track(features[i], across_m[i], species[i], stage[i], crop_gap_m[i], confidence[i])
