"""Numbers of the laser weeder: machine, process, perception and scenario tiers.

Every number says where it comes from: [published] printed by a source, [identified] found so that a published
result comes out or fitted to rendered images, [assumed] a free choice. "The paper" is Wang et al., Kinematics and
statics analysis of a novel 4-DOF parallel mechanism for laser weeding robot (3UPS-RPU).
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from importlib.resources import files
from math import exp, inf, log
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core import Array
from .tools.laser.aim import LaserReach

DOSES = ("low", "normal", "high")
STAGES = ("cotyledon", "two-leaf", "four-leaf")
SPECIES = ("broadleaf", "grass")


def _require(owner: object, low: float, *names: str, high: float = inf) -> None:
    for name in names:
        value = getattr(owner, name)
        if not low <= value <= high:
            raise ValueError(f"{type(owner).__name__}.{name} = {value}: allowed range [{low}, {high}]")


def _shares(owner: object, name: str, count: int) -> None:
    values = getattr(owner, name)
    if len(values) != count or min(values) < 0.0 or abs(sum(values) - 1.0) > 1e-9:
        raise ValueError(f"{type(owner).__name__}.{name} = {values}: give {count} shares >= 0 that add up to 1")


@dataclass(frozen=True)
class ProcessConfig:
    """Burning one weed: the beam, the doses, and what plants can take."""

    power_w: float = 200.0
    """Optical power on the plant [assumed; CO2 class, so that the published doses take 0.15-1 s]."""
    dose_j: tuple[float, float, float] = (30.0, 75.0, 200.0)
    """Energy of the dose levels low, normal, high [assumed; they bracket the published 54 J and its stage factors]."""
    correct_s: float = 0.05
    """Tool camera image, correction of the aim and its small motion, before every shot [assumed]."""
    spot_radius_m: float = 0.003
    """1/e2 radius of the Gaussian spot [assumed: 6 mm, the widest published spot]."""
    ed95_j: float = 54.0
    """Dose that kills 95 % of two-leaf broadleaves when centred [published: Marx et al. 2012, CO2 laser]."""
    slope: float = 4.0
    """Steepness of the logistic in ln(dose) [assumed]."""
    stage_factor: tuple[float, float, float] = (0.4, 1.0, 3.0)
    """Dose at cotyledon, two-leaf and four-leaf stage relative to two-leaf [assumed; published trends]."""
    grass_factor: float = 1.75
    """Dose of grasses relative to broadleaves [assumed, between 1.5 and 2; monocots need more: published]."""
    meristem_m: tuple[float, float, float] = (0.0025, 0.0030, 0.0040)
    """Radius of the vulnerable middle (growing point and leaf bases) by stage; it widens the overlap [assumed]."""
    crop_ed50_j: float = 20.0
    """Dose on a crop plant's growing point that kills half of them [assumed: a two-leaf broadleaf takes 26 J]."""
    crop_slope: float = 4.0
    """Steepness for crop plants [assumed]."""
    crop_heart_m: float = 0.006
    """Radius of a crop plant's growing point [assumed]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name, count in (("dose_j", len(DOSES)), ("stage_factor", len(STAGES)), ("meristem_m", len(STAGES))):
            values = getattr(self, name)
            if len(values) != count or min(values) <= 0.0:
                raise ValueError(f"{name} = {values}: give {count} values > 0")
        _require(self, 1e-6, "power_w", "spot_radius_m", "ed95_j", "slope", "grass_factor", "crop_ed50_j")
        _require(self, 1e-6, "crop_slope", "crop_heart_m")
        _require(self, 0.0, "correct_s")

    @property
    def ed50_j(self) -> float:
        """Dose that kills half of the two-leaf broadleaves: the logistic's 95 % point taken back to 50 %."""
        return self.ed95_j * exp(-log(0.95 / 0.05) / self.slope)


class SightingTable(NamedTuple):
    """Sightings of all classes, one under the other: ``rows`` (n, 7), where each class begins, how many it holds."""

    rows: Array
    first: NDArray[np.int64]
    holds: NDArray[np.int64]


@dataclass(frozen=True)
class PerceptionModel:
    """What front camera, tracks and tool camera report, as a statistical model.

    Errors are not described by a law but drawn from those that were measured: a *sighting* is a row of seven numbers,
    the place at which the front camera's track ends and the one that the tool camera corrects it to, both relative to
    the plant (along, across, metres), whether the tool camera found a plant at all (1 or 0), and the reported species
    and stage. So errors keep their long tails, and a bad track keeps its bad correction.

    Fitted by ``scripts/measure_weed_cameras.py`` to rendered images; ``perfect`` is the truth.
    """

    recall: tuple[tuple[float, float, float], tuple[float, float, float]]
    """Probability that a weed becomes a track, by species (broadleaf, grass) and stage, where it stands alone."""
    crop_gap_m: tuple[float, ...]
    """Ascending distances to the nearest crop plant that part the factors of ``odds_near_crop``."""
    odds_near_crop: tuple[float, ...]
    """Factors on the odds of becoming a track, from under the crop plant's leaves outwards."""
    weed_gap_m: tuple[float, ...]
    """The same for the distance to the nearest other weed: plants that touch may be taken for one."""
    odds_near_weed: tuple[float, ...]
    crowded_m: tuple[float, float]
    """A weed is at a crop plant, or beside another weed, when these are nearer than that."""
    sightings: tuple[tuple[tuple[float, ...], ...], ...]
    """Of tracked weeds in 18 classes, index ``6 neighbourhood + 3 species + stage``: alone, by a weed, at a crop."""
    false_rates: tuple[float, float, float]
    """Tracks that are no further weed: per weed (a part of it), per crop plant, and elsewhere per square metre."""
    false_sightings: tuple[tuple[tuple[float, ...], ...], ...]
    """Their sightings in three classes, relative to the weed, to the crop plant, to themselves."""
    drift_share: float
    """Standard deviation of the odometry's error per distance driven, one value a strip."""
    delay_s: float
    """From the frame that confirms a track to its use."""
    frames_m: float = 0.0
    """Distance that the cart drives between a weed's entering the view and its confirmation."""

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
        kinds = tuple(((*exact, float(s), float(g)),) for s in range(len(SPECIES)) for g in range(len(STAGES)))
        nothing = ((*exact, 0.0, 0.0),)
        return cls(
            recall=(ones, ones),
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
    @lru_cache(maxsize=1)
    def measured(cls) -> PerceptionModel:
        """The fit to rendered images that ships with the package [identified]."""
        text = files(__name__.rsplit(".", 3)[0]).joinpath("assets/perception/weeding.json").read_text("utf-8")
        return cls.from_json(json.loads(text)["model"])

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> PerceptionModel:
        """The model behind its parsed JSON: lists become tuples."""
        return cls(**{name: _frozen(value) for name, value in data.items()})


def _table(classes: tuple[tuple[tuple[float, ...], ...], ...]) -> SightingTable:
    count = np.array([len(rows) for rows in classes])
    if count.min() < 1:
        raise ValueError(f"sightings of {count.tolist()} rows: every class needs one at least")
    return SightingTable(np.array([row for rows in classes for row in rows]), count.cumsum() - count, count)


def _frozen(value: Any) -> Any:
    return tuple(_frozen(part) for part in value) if isinstance(value, list) else value


@dataclass(frozen=True)
class ScenarioConfig:
    """One kind of field and the cart's speed over it. Lengths in metres."""

    density_per_m2: float
    """Mean density of weeds [published range: up to 190 per m2]."""
    offered_load: float
    """Seconds of work that grow into the window each second at the constant speed: density x width x speed x service.
    Policies separate near and above 1 [derived]."""
    clumped: float = 0.75
    """Share of the weeds that grow in Thomas clusters; the others are a Poisson background [assumed]."""
    cluster_size: float = 6.0
    """Mean number of weeds of a cluster [assumed]."""
    cluster_sigma_m: float = 0.05
    """Standard deviation of a weed's distance from its cluster's centre, per axis [assumed]."""
    strip_m: float = 8.0
    """Length of the strip that is one episode [assumed]."""
    band_m: float = 0.40
    """Width of the treated band, one crop row in its middle [assumed]."""
    row_m: float = 0.40
    """Distance of the crop rows [published range 0.3-0.5]."""
    crop: str = "beet"
    """``"beet"`` (a rosette) or ``"maize"`` (an upright grass): looks only."""
    crop_pitch_m: float = 0.16
    """Distance of the crop plants in a row [assumed]."""
    crop_jitter_m: tuple[float, float] = (0.015, 0.008)
    """Standard deviation of their places along and across the row [published range 10-20 mm along; assumed across]."""
    grass_share: float = 0.30
    """Share of grasses among the weeds [assumed]."""
    stage_shares: tuple[float, float, float] = (0.40, 0.45, 0.15)
    """Shares of cotyledon, two-leaf and four-leaf weeds [assumed: an early pass]."""
    max_weeds: int = 320
    """Most weeds of a strip; draws beyond are cut off."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        _require(self, 1e-3, "density_per_m2", "offered_load", "strip_m", "band_m", "row_m", "crop_pitch_m")
        _require(self, 1e-3, "cluster_size")
        _require(self, 0.0, "clumped", "grass_share", high=1.0)
        _require(self, 0.0, "cluster_sigma_m")
        _require(self, 1, "max_weeds")
        _shares(self, "stage_shares", len(STAGES))
        if self.crop not in ("beet", "maize"):
            raise ValueError(f"crop = {self.crop!r}: choose 'beet' or 'maize'")
        expected = self.density_per_m2 * self.strip_m * self.band_m
        if self.max_weeds < expected:
            raise ValueError(
                f"max_weeds = {self.max_weeds}: the strip holds {expected:.0f} weeds on average, give more"
            )

    @property
    def crops(self) -> int:
        """Crop plants that can stand in the treated band or reach into it; one beyond each end."""
        return int(self.strip_m / self.crop_pitch_m) + 3


def _tier(load: float, density: float = 40.0, clumped: float = 0.75, **changes: float) -> ScenarioConfig:
    return ScenarioConfig(density_per_m2=density, offered_load=load, clumped=clumped, **changes)  # type: ignore[arg-type]


SCENARIOS: dict[str, ScenarioConfig] = {
    "load-0.7": _tier(0.7),
    "load-1.0": _tier(1.0),
    "load-1.25": _tier(1.25),
    "load-1.6": _tier(1.6),
    "load-1.0-even": _tier(1.0, clumped=0.0),
    "load-1.6-even": _tier(1.6, clumped=0.0),
    "dense": _tier(1.0, density=100.0, strip_m=1.6),
}
"""Tiers by offered load at 40 weeds per m2 (an ordinary infestation), clumped unless they say ``even``; ``dense`` has
100 per m2 on a shorter strip, driven as slowly as its load of 1.0 asks."""


@dataclass(frozen=True)
class CartConfig:
    """How the cart drives, and how its cameras are mounted."""

    start_m: float = 0.45
    """The strip begins this far in front of the platform's middle; the front camera has seen it already [assumed]."""
    camera_ahead_m: float = 0.85
    """Front camera in front of the platform's middle [assumed]."""
    camera_view_m: float = 0.40
    """Length of ground that the front camera sees [assumed; its height follows]."""
    notch_m_s: float = 0.02
    """Step by which the speed variant changes the commanded speed [assumed]."""
    speed_range_m_s: tuple[float, float] = (0.03, 0.27)
    """Speeds that the speed variant may command; at the upper end the highest dose is just possible [assumed]."""
    acceleration_m_s2: float = 0.3
    """Of the cart when the commanded speed changes [assumed]."""
    moment_s: float = 0.10
    """What waiting a moment takes at least [assumed]."""
    illegal_s: float = 0.25
    """What an action that is not possible costs at least [assumed]."""
    early_s: float = 0.40
    """A candidate may be chosen this long before it enters the window; the beam waits for it [assumed]."""
    time_factor: float = 2.5
    """The episode is cut off after this many times the scenario's own driving time."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        _require(self, 1e-3, "notch_m_s", "acceleration_m_s2", "moment_s", "illegal_s", "time_factor")
        _require(self, 0.0, "start_m", "camera_ahead_m", "camera_view_m", "early_s")
        low, high = self.speed_range_m_s
        if not 0.0 < low < high:
            raise ValueError(f"speed_range_m_s = {self.speed_range_m_s}: give 0 < slowest < fastest")

    @property
    def seen_ahead_m(self) -> float:
        """A weed is in the front camera's view from this far in front of the platform's middle on."""
        return self.camera_ahead_m + 0.5 * self.camera_view_m

    @property
    def unseen_m(self) -> float:
        """Where a weed leaves the front camera's view; from here on the odometry carries it."""
        return self.camera_ahead_m - 0.5 * self.camera_view_m


@dataclass(frozen=True)
class RewardWeights:
    """Value of the named reward terms, in killed weeds."""

    killed: float = 1.0
    crop: float = -5.0
    """For every crop plant that dies [assumed]."""
    seconds: float = -0.05
    """About a tenth of what a second of work earns at load 1 [assumed]."""
    joules: float = -0.0005
    """A normal dose costs 4 % of a weed [assumed]."""


@dataclass(frozen=True)
class FieldTask:
    """Everything that defines a weeding task but for its tool; tools add their reach and their process."""

    scenario: ScenarioConfig = SCENARIOS["load-1.25"]
    cart: CartConfig = field(default_factory=CartConfig)
    weights: RewardWeights = field(default_factory=RewardWeights)
    slots: int = 16
    """Candidates that a policy is shown at once."""
    speed_control: bool = False
    """Whether the action includes the cart's speed."""
    nominal_move_s: float = 0.26
    """Mean move between two weeds, for the offered load alone [identified: fixed order at load 1]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        _require(self, 1, "slots", high=64)
        _require(self, 0.0, "nominal_move_s")
        if 0.5 * self.scenario.band_m > self.half_width_m + 1e-9:
            raise ValueError(f"band_m = {self.scenario.band_m}: the tool reaches {self.half_width_m} m to either side")
        if self.cart.unseen_m < self.front_m:
            raise ValueError(f"the front camera's view must end before the window begins ({self.front_m} m)")

    @property
    def front_m(self) -> float:
        """The window begins this far in front of the machine's middle; it ends as far behind it."""
        raise NotImplementedError

    @property
    def half_width_m(self) -> float:
        """Reach to either side."""
        raise NotImplementedError

    def label_work_s(self, species: int, stage: int) -> float:
        """Seconds on a weed of a kind in the mode that it calls for."""
        raise NotImplementedError

    @property
    def service_s(self) -> float:
        """Expected seconds for one weed: the move, and the work that its kind calls for."""
        scenario = self.scenario
        grass = scenario.grass_share
        work_s = 0.0
        for species, share in enumerate((1.0 - grass, grass)):
            for stage, part in enumerate(scenario.stage_shares):
                work_s += share * part * self.label_work_s(species, stage)
        return self.nominal_move_s + work_s

    @property
    def speed_m_s(self) -> float:
        """Constant speed of the scenario: what its offered load asks for, in whole millimetres a second."""
        scenario = self.scenario
        return round(scenario.offered_load / (scenario.density_per_m2 * scenario.band_m * self.service_s), 3)

    @property
    def time_limit_s(self) -> float:
        """Simulated seconds after which an episode is cut off."""
        way = self.scenario.strip_m + self.cart.start_m + self.front_m
        return self.cart.time_factor * way / self.speed_m_s


@dataclass(frozen=True)
class WeedingConfig(FieldTask):
    """Everything that defines a weeding task with the laser."""

    reach: LaserReach = field(default_factory=LaserReach)
    process: ProcessConfig = field(default_factory=ProcessConfig)

    @property
    def front_m(self) -> float:
        """The window begins this far in front of the machine's middle; it ends as far behind it."""
        return self.reach.front_m

    @property
    def half_width_m(self) -> float:
        """Reach to either side."""
        return self.reach.half_width_m

    def label_work_s(self, species: int, stage: int) -> float:
        """Seconds of the correction and of the dose that a kind calls for."""
        from .tools.laser.process import label_dose

        process = self.process
        return process.correct_s + process.dose_j[label_dose(process, species, stage)] / process.power_w
