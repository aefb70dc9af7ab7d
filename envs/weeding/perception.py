"""What the weeders' cameras report, as a statistical model: how often a plant becomes a track, and how far it errs."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels.config import Config, from_mapping, num
from ...simulation.assets import asset_text
from ..columns import Says, numbered
from ..core import Array
from .config import SPECIES, STAGES

TOOL_GATE_M = 0.022
"""The tool camera corrects to a plant within this distance of where it was told to look."""

Sightings = tuple[tuple[tuple[float, ...], ...], ...]
"""Classes of sightings, each sighting a row of eight numbers, see ``Sighting``."""
ByKind = tuple[tuple[float, float, float], tuple[float, float, float]]
"""A number for each species and stage."""
_NO_REACH: ByKind = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Sighting(NamedTuple):
    """A sighting as a row of numbers; places are relative to the plant."""

    along: Annotated[int, Says("m", "where the front camera's track ends, along the row")]
    across: Annotated[int, Says("m", "the same across")]
    aim_along: Annotated[int, Says("m", "where the tool camera corrects it to, along the row")]
    aim_across: Annotated[int, Says("m", "the same across")]
    found: Annotated[int, Says("", "1 where the tool camera found a plant at all")]
    species: Annotated[int, Says("", "reported index into ``SPECIES``")]
    stage: Annotated[int, Says("", "reported index into ``STAGES``")]
    confidence: Annotated[int, Says("", "how sure the front camera's pictures are that it is a weed, 0 to 1")]


Q = numbered(Sighting)


class SightingTable(NamedTuple):
    """Sightings of all classes, one under the other: ``rows`` (n, 8), where each class begins, how many it holds."""

    rows: Array
    first: NDArray[np.int64]
    holds: NDArray[np.int64]


@dataclass(frozen=True)
class PerceptionModel(Config):
    """What front camera, tracks and tool camera report, as a statistical model.

    Errors are not described by a law but drawn from those that were measured: a *sighting* is a row of eight numbers
    (see ``Sighting``): the place at which the front camera's track ends, the one that the tool camera corrects it to,
    whether that found a plant at all, the reported species and stage, and how sure the pictures were. So errors keep
    their long tails, and a bad track keeps its bad correction and its doubts.

    Fitted by ``scripts/measure_camera.py`` to rendered images; ``perfect`` is the truth.
    """

    recall: tuple[ByKind, ByKind] = num(..., 0.0, 1.0, "")
    """Probability that a weed becomes a track, by species (broadleaf, grass) and stage: where it stands alone, beyond
    all of ``crop_gap_m`` and ``weed_gap_m``, and, before their factors, where it does not."""
    crop_gap_m: tuple[float, ...] = num(..., -1.0, 1.0, "m")
    """Ascending distances to the nearest crop plant, less ``reach_m``, that part the factors of ``odds_near_crop``."""
    odds_near_crop: tuple[float, ...] = num(..., 0.0, 1e6, "")
    """Factors on the odds of becoming a track, from under the crop plant's leaves outwards."""
    weed_gap_m: tuple[float, ...] = num(..., -1.0, 1.0, "m")
    """The same for the distance to the nearest other weed, less the reach of both: plants that touch may be taken for
    one."""
    odds_near_weed: tuple[float, ...] = num(..., 0.0, 1e6, "")
    """See ``odds_near_crop``."""
    crowded_m: tuple[float, float] = num(..., -1.0, 1.0, "m")
    """A weed is at a crop plant, or beside another weed, when these are nearer than that, less reaches as before."""
    sightings: Sightings = num(..., -1.0, 2.0, "")
    """Of tracked weeds in 18 classes, index ``6 neighbourhood + 3 species + stage``: alone, by a weed, at a crop."""
    false_rates: tuple[float, float, float] = num(..., 0.0, 100.0, "")
    """Tracks that are no further weed: per weed (a part of it), per crop plant, and elsewhere per square metre."""
    false_sightings: Sightings = num(..., -1.0, 2.0, "")
    """Their sightings in three classes, relative to the weed, to the crop plant, to themselves."""
    drift_share: float = num(..., 0.0, 0.5, "")
    """Standard deviation of the odometry's error per distance driven, one value a strip."""
    delay_s: float = num(..., 0.0, 10.0, "s")
    """From the frame that confirms a track to its use."""
    frames_m: float = num(0.0, 0.0, 10.0, "m")
    """Distance that the cart drives between a weed's entering the view and its confirmation."""
    reach_m: ByKind = num(_NO_REACH, 0.0, 1.0, "m")
    """How far from its stem a weed's leaves reach, by species and stage: what is nearer than that touches them."""

    def check(self) -> None:
        """Hold the tables to their shapes."""
        for gaps, odds in (("crop_gap_m", "odds_near_crop"), ("weed_gap_m", "odds_near_weed")):
            values = getattr(self, gaps)
            if list(values) != sorted(values):
                self.refuse(gaps, "give ascending distances")
            if len(getattr(self, odds)) != len(values) + 1:
                self.refuse(odds, f"give {len(values) + 1} factors, one more than {gaps} has distances")
        for name, classes in (("sightings", 3 * len(SPECIES) * len(STAGES)), ("false_sightings", 3)):
            table: Sightings = getattr(self, name)
            if len(table) != classes or not all(table):
                self.refuse(name, f"give {classes} classes, every class with a sighting at least")
            rows = [row for rows in table for row in rows]
            if any(len(row) == Q.confidence for row in rows):
                self.refuse(
                    name, "rows of 7 do not tell the confidence: measure anew, scripts/measure_camera.py weeding"
                )
            if any(
                len(row) != len(Q) or min(row[Q.found :]) < 0.0 or max(*row[Q.found : Q.stage], row[Q.confidence]) > 1.0
                for row in rows
            ):
                self.refuse(
                    name, f"give rows of {len(Q)}: four offsets in metres, found 0 or 1, species, stage, confidence"
                )

    @cached_property
    def sighting_table(self) -> SightingTable:
        """``sightings`` as arrays."""
        return _table(self.sightings)

    @cached_property
    def false_table(self) -> SightingTable:
        """``false_sightings`` as arrays."""
        return _table(self.false_sightings)

    @classmethod
    @lru_cache(maxsize=1)
    def perfect(cls) -> PerceptionModel:
        """Every weed, exactly where and what it is, at once."""
        ones, exact = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0, 0.0, 1.0)
        kinds = tuple(((*exact, float(s), float(g), 1.0),) for s in range(len(SPECIES)) for g in range(len(STAGES)))
        nothing = ((*exact, 0.0, 0.0, 1.0),)
        return cls(
            recall=((ones, ones), (ones, ones)),
            crop_gap_m=(),
            odds_near_crop=(1.0,),
            weed_gap_m=(),
            odds_near_weed=(1.0,),
            crowded_m=(0.0, 0.0),
            sightings=kinds + kinds + kinds,
            false_rates=(0.0, 0.0, 0.0),
            false_sightings=(nothing, nothing, nothing),
            drift_share=0.0,
            delay_s=0.0,
        )

    @classmethod
    @lru_cache(maxsize=4)
    def measured(cls, eyes: str, pictures: str) -> PerceptionModel:
        """The fit to rendered images that ships with the package [identified], see ``FieldTask.eyes``.

        Raises:
            ValueError: nobody has fitted one to these eyes and pictures.
        """
        try:
            text = asset_text(f"perception/{fit_name(eyes, pictures)}")
        except FileNotFoundError:
            raise ValueError(
                f"perception = 'model' has no fit to eyes = {eyes!r} and pictures = {pictures!r}: choose 'camera' or "
                "'perfect', or make one with scripts/measure_camera.py weeding --write"
            ) from None
        return cls.from_json(json.loads(text)["model"])

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> PerceptionModel:
        """The model behind its parsed JSON."""
        return from_mapping(cls, data)


def fit_name(eyes: str, pictures: str) -> str:
    """File of the fit of these eyes to these pictures."""
    return ".".join(["weeding", *(part for part in (eyes, pictures) if part not in ("classical", "easy")), "json"])


@lru_cache(maxsize=4)
def uncorrected(model: PerceptionModel) -> PerceptionModel:
    """The model of the same cameras where none looks from beside the tool: it works where the tracks say."""

    def blind(classes: Sightings) -> Sightings:
        return tuple(tuple((*row[: Q.found], 0.0, *row[Q.found + 1 :]) for row in rows) for rows in classes)

    return replace(model, sightings=blind(model.sightings), false_sightings=blind(model.false_sightings))


def _table(classes: Sightings) -> SightingTable:
    count = np.array([len(rows) for rows in classes])
    return SightingTable(np.array([row for rows in classes for row in rows]), count.cumsum() - count, count)
