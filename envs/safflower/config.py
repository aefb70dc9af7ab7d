"""Numbers of the safflower picker: machine, process, perception and scenario tiers.

Every number says where it comes from: [published] printed by a source, [identified] found so that a published
result comes out, [assumed] a free choice. "The paper" is Guo et al. 2022, Eng. Agric. 42(1) e20210129.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...kernels.config import Config, choice, flag, nested, num
from ...simulation.assets import asset_text
from ...simulation.picker_model import MOTOR_HEIGHT_M, PickerParameters
from ..drives import DriveErrors, LinearDrive, RotaryDrive
from ..rough_config import RoughGround
from .bag_config import Bag, Wilting

EFFORTS = ("quick", "normal", "thorough")
STAGES = ("bud", "fresh", "late", "dry")
OPEN_STAGES = (1, 2)
_FITS = ("pots", "row-sparse", "row", "row-dense", "bag")
_MOST_HEADS, _MOST_STOPS = 20_000, 2_000
_ROUNDING = 1e-3
"""Rows of a confusion matrix that was rounded add up to 1 within this."""

GAPS_M = (0.016, 0.020, 0.024, 0.028, 0.034)
"""Where classes of the gap to the nearest higher head end, seen from above. Tufts are 24 mm wide to either side: beyond
the last nothing hides anything."""

ByStage = tuple[float, float, float, float]
ByGap = tuple[float, float, float, float, float]
_FREE: ByGap = (1.0, 1.0, 1.0, 1.0, 1.0)
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class MachineConfig(Config):
    """The cart and its arm: the machine itself and how it is used."""

    picker: PickerParameters = nested(PickerParameters)
    """Geometry, rates and motors; the scenario sets its ``motor_height_m``."""
    clear_level_m: float = num(-0.28, -2.0, 0.0, "m")
    """Level of every traverse in the arm's plane, the widest part of the workspace [assumed]."""
    settle_s: float = num(0.5, 0.0, 600.0, "s")
    """Wait after the cart has moved, until plants and frame stand still [assumed]."""

    def check(self) -> None:
        """The traverse lies within reach."""
        bar = self.picker.five_bar
        if not bar.reachable([0.5 * bar.base_m, self.clear_level_m]):
            self.refuse("clear_level_m", "outside the arm's workspace, give a level in m that the tool reaches")


@dataclass(frozen=True)
class ProcessConfig(Config):
    """Cutting and sucking one head, by effort (quick, normal, thorough)."""

    strokes: tuple[int, int, int] = num((1, 2, 3), 0, 50, "")
    """Shear strokes over the head, by effort [assumed]."""
    suction_s: Triple = num((1.0, 2.0, 3.0), 0.0, 600.0, "s")
    """Suction after the last stroke, by effort [assumed]."""
    shear_speed: float = num(0.030, 1e-3, 5.0, "m/s")
    """Reciprocating shear speed [published: the paper, test conditions]."""
    stroke_m: float = num(0.04785, 1e-3, 0.5, "m")
    """Length of one stroke: the filament spread [published: 47.85 +- 3.73 mm]."""
    locate_s: float = num(7.304, 0.0, 600.0, "s")
    """Locating one head and handing its coordinates to the motors, before every pick [identified: 16 s per head]."""
    recognise_s: float = num(1.0, 0.0, 600.0, "s")
    """Taking and segmenting the image of a stop [assumed]."""
    stroke_cut: float = num(0.7505, 1e-6, 1.0 - 1e-6, "")
    """Share of the remaining filaments that one centred stroke cuts [identified: 87.91 % net rate]."""
    cut_radius_m: float = num(0.012, 1e-4, 0.5, "m")
    """Radial tool error (Gaussian sigma) that costs a stroke 39 % of its cut [assumed: half the tuft's radius]."""
    cut_height_m: float = num(0.010, 1e-4, 0.5, "m")
    """The same for a tool held too high or too low [assumed: half the 21.6 mm head height]."""
    capture_radius_m: float = num(0.024, 0.0, 0.5, "m")
    """Beyond this radial error the head does not enter the shear hole [published: half the filament spread]."""
    suction_loss: float = num(0.35, 0.0, 1.0, "")
    """Share of the cut filaments that would drop without suction time [assumed]."""
    suction_decay_s: float = num(1.0, 1e-3, 600.0, "s")
    """Time constant with which suction time reduces that share [assumed]."""
    luck_logit: float = num(0.509, 0.0, 5.0, "")
    """Standard deviation of a head's cut and collection on the logit scale [identified: Table 2, SD 1.60 points]."""
    illegal_s: float = num(1.0, 0.0, 600.0, "s")
    """What an action that is not possible costs [assumed]."""


@dataclass(frozen=True)
class PerceptionModel(Config):
    """What the camera reports of a head, as a statistical model (see ``scripts/measure_camera.py``)."""

    recall: tuple[ByStage, ByStage] = num(..., 0.0, 1.0, "")
    """Probability that a head is reported that no other hides, free and behind leaves, by stage."""
    false_per_stop: float = num(..., 0.0, 20.0, "")
    """Mean number of reports at a stop that are no head."""
    bias_m: Triple = num(..., -0.2, 0.2, "m")
    """Mean error of the reported position (along, across, up)."""
    sigma_m: Triple = num(..., 0.0, 0.2, "m")
    """Standard deviation of that error."""
    stage_confusion: tuple[ByStage, ByStage, ByStage, ByStage] = num(..., 0.0, 1.0, "")
    """Row = true stage, column = reported stage, rows add up to 1."""
    size_sigma: float = num(..., 0.0, 1.0, "")
    """Relative error of the reported size."""
    below: tuple[ByGap, ByGap] = num((_FREE, _FREE), 0.0, 1.0, "")
    """What is left of that probability under a higher head, free and behind leaves, by the gap (``GAPS_M``)."""

    def check(self) -> None:
        """Every stage is reported as some stage."""
        if any(abs(sum(row) - 1.0) > _ROUNDING for row in self.stage_confusion):
            self.refuse("stage_confusion", "each row must add up to 1")

    @classmethod
    def perfect(cls) -> PerceptionModel:
        """Every head with filaments, exactly where it is."""
        seen: ByStage = (0.0, 1.0, 1.0, 1.0)
        confusion = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        return cls((seen, seen), 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), confusion, 0.0)

    @classmethod
    @lru_cache(maxsize=8)
    def measured(cls, scenario: str) -> PerceptionModel:
        """The fit to rendered images of a scenario that ships with the package [identified]."""
        data = json.loads(asset_text("perception/safflower.json"))["scenarios"][scenario]
        return cls(
            recall=data["recall"],
            false_per_stop=data["false_per_stop"],
            bias_m=data["position_bias_m"],
            sigma_m=data["position_sigma_m"],
            stage_confusion=data["stage_confusion"],
            size_sigma=data["size_sigma"],
            below=data["below"],
        )


@dataclass(frozen=True)
class StandGround(RoughGround):
    """The ground on which the cart stands at its stops; as it stands, a plane."""

    wheel_base_m: float = num(0.74, 0.2, 5.0, "m")
    """Front wheels before rear wheels, the arm's plane in the middle [assumed: as drawn]."""
    track_m: float = num(1.10, 0.2, 5.0, "m")
    """Left wheels beside right wheels [assumed: as drawn]."""
    pivot_m: float = num(0.16, 0.0, 3.0, "m")
    """Height of the axles, whose way the cart's drive counts, and about which the frame tilts [assumed: as drawn]."""


@dataclass(frozen=True)
class ScenarioConfig(Config):
    """One kind of field. Days are days of flowering."""

    plants: int = num(..., 1, 500, "")
    """Plants in the row."""
    pitch_m: float = num(..., 0.01, 5.0, "m")
    """Distance of the plants in the row."""
    window_m: float = num(..., 0.02, 5.0, "m")
    """Length of row that a stop serves; the next stop is this much farther."""
    max_heads: int = num(..., 1, 200, "")
    """Most heads on a plant; draws beyond it are cut off."""
    mean_heads: float = num(..., 0.01, 200.0, "")
    """Mean of the negative binomial; without dispersion draws are uniform in 1..max_heads."""
    dispersion: float = num(..., 0.0, 1000.0, "")
    """Size parameter of the negative binomial; 0 draws uniformly from 1..max_heads."""
    motor_height_m: float = num(..., *MOTOR_HEIGHT_M, "m")
    """Height of the motors' axes: the frame is set to the crop before a row."""
    plant_height_m: tuple[float, float] = num(..., 0.0, 2.0, "m")
    """Mean and standard deviation of the plants' height, or its range when ``potted``."""
    crown_m: tuple[float, float] = num(..., 0.01, 1.0, "m")
    """Range of the crown's width."""
    head_drop_m: Triple = num(..., 0.0, 1.0, "m")
    """How far below the plant's top the terminal, primary and secondary heads stand at most."""
    visit_day: tuple[float, float] = num(..., -30.0, 60.0, "d")
    """The row is visited on a day drawn from this range of the flowering period."""
    occluded: float = num(..., 0.0, 1.0, "")
    """Share of heads behind leaves."""
    potted: bool = flag(...)
    """Pots on blocks, each at the middle of its stop, with all their flowers open."""
    time_limit_s: float = num(..., 1.0, 86400.0, "s")
    """The episode is truncated at this simulated time."""
    max_tracks: int = num(..., 1, 5000, "")
    """Most reports kept in one episode."""
    camera_fit: str = choice(..., _FITS)
    """Scenario whose measured camera stands in for the camera with ``perception="model"``."""
    drives: DriveErrors = nested(DriveErrors)
    """Errors of cart and arms."""
    ground: StandGround = nested(StandGround)
    """What the cart stands on."""
    rows: int = num(1, 1, 8, "")
    """Rows side by side that are picked from the same stops; plants are counted over all of them."""
    row_gap_m: float = num(0.0, 0.0, 0.5, "m")
    """Distance of these rows."""
    bag: Bag = nested(Bag)
    """What filaments are sucked into."""
    wilting: Wilting = nested(Wilting)
    """Until when heads are worth picking."""

    def check(self) -> None:
        """Ranges ascend, and the row is one that fits into memory."""
        if self.plants % self.rows:
            self.refuse("plants", f"give a multiple of rows = {self.rows}")
        if self.rows > 1 and self.row_gap_m == 0.0:
            self.refuse("row_gap_m", f"give the distance of the {self.rows} rows in m, above 0")
        for name in ("crown_m", "visit_day") + ("plant_height_m",) * self.potted:
            low, high = getattr(self, name)
            if low > high:
                self.refuse(name, "give a lower and an upper end")
        mean_m, sigma_m = self.plant_height_m
        if not self.potted and sigma_m > 0.2 * mean_m:
            self.refuse("plant_height_m", "give a mean and a standard deviation of at most a fifth of it")
        if self.plants * self.max_heads > _MOST_HEADS:
            self.refuse("max_heads", f"with {self.plants} plants give at most {_MOST_HEADS // self.plants}")
        if self.stops > _MOST_STOPS:
            self.refuse("window_m", f"the row would need {self.stops} stops, give one that needs at most {_MOST_STOPS}")

    @property
    def stops(self) -> int:
        """Stops the row needs."""
        if self.window_m == self.pitch_m:
            return self.places
        return int(-(-self.places * self.pitch_m // self.window_m))

    @property
    def places(self) -> int:
        """Plants in each of the rows."""
        return self.plants // self.rows

    @property
    def demanding(self) -> bool:
        """Whether bag or wilting make the order matter, and so have to be shown."""
        return self.bag.capacity_g > 0.0 or self.wilting.closes_s[1] > 0.0

    def stands_m(self) -> NDArray[np.floating]:
        """Where the plants stand, (plants, 2), along and across, row by row."""
        along = self.pitch_m * (np.arange(self.places, dtype=np.float64) + 0.5 * (not self.potted))
        across = self.row_gap_m * (np.arange(self.rows) - 0.5 * (self.rows - 1))
        return np.column_stack([np.tile(along, self.rows), np.repeat(across, self.places)])


# Plants of the paper's test: 15 pots in 5 groups of 3, 1-4 flowers a pot, height 0.43-0.86 m, crown 0.14-0.38 m
# [published]. Pots stand 0.45 m apart [assumed], short ones on blocks that lift the plant into the arm's reach
# [assumed], and all flowers are open and in view, since only mature ones were presented [assumed].
POTS = ScenarioConfig(
    plants=15,
    pitch_m=0.45,
    window_m=0.45,
    max_heads=4,
    mean_heads=2.5,
    dispersion=0.0,
    motor_height_m=1.18,
    plant_height_m=(0.43, 0.86),
    crown_m=(0.14, 0.38),
    head_drop_m=(0.0, 0.06, 0.10),
    visit_day=(0.0, 0.0),
    occluded=0.0,
    potted=True,
    time_limit_s=1800.0,
    max_tracks=80,
    camera_fit="pots",
)


_PLANTS_IN_ROW = 12
_PACE_S_PER_M = 250.0
"""Time that a metre of row is allowed, whatever grows on it: dense rows cannot be picked clean [assumed]."""


def _row(name: str, pitch_m: float, occluded: float) -> ScenarioConfig:
    # Plant height 0.89 m, crown 274.5 mm, 15.71 heads a plant [published: field means]; the spread of heights within
    # a row, the dispersion and the drops of the later heads are [assumed].
    return ScenarioConfig(
        plants=_PLANTS_IN_ROW,
        pitch_m=pitch_m,
        window_m=0.30,
        max_heads=36,
        mean_heads=15.71,
        dispersion=6.0,
        motor_height_m=1.23,
        plant_height_m=(0.89, 0.03),
        crown_m=(0.20, 0.2745),
        head_drop_m=(0.02, 0.07, 0.12),
        visit_day=(3.0, 13.0),
        occluded=occluded,
        potted=False,
        time_limit_s=_PACE_S_PER_M * _PLANTS_IN_ROW * pitch_m,
        max_tracks=256,
        camera_fit=name,
    )


# A machine in its second season in a dense row: gears of 15 arc minutes [assumed: the usual class of planetary gears],
# encoders off by the middle of the paper's Table 1 [published range 0.001-0.005 rad], a cart that stops on its wheels
# to 2 mm with 2 mm of play in its drive, servos of 8 Hz [assumed].
WORN = DriveErrors(
    LinearDrive(encoder_m=0.002, backlash_m=0.002, stiction_m=0.0005),
    RotaryDrive(encoder_rad=0.003, backlash_rad=0.0044, stiction_rad=0.001),
    lag_s=0.02,
)

# The end of a morning in a bed of two rows that the arm reaches both: plants stand so close that they are narrow and
# bear fewer heads, at the height of flowering [assumed]. The bag holds as much as a dozen heads bear [assumed].
BAG = replace(
    _row("row-sparse", 0.15, 0.10),
    plants=18,
    rows=2,
    row_gap_m=0.10,
    window_m=0.45,
    max_heads=16,
    mean_heads=3.6,
    crown_m=(0.10, 0.14),
    visit_day=(5.0, 7.0),
    time_limit_s=900.0,
    camera_fit="bag",
    bag=Bag(capacity_g=4.0),
    wilting=Wilting(closes_s=(40.0, 900.0)),
)

SCENARIOS: dict[str, ScenarioConfig] = {
    "pots": POTS,
    "row-sparse": _row("row-sparse", 0.30, 0.10),
    "row": _row("row", 0.20, 0.175),
    "row-dense": _row("row-dense", 0.125, 0.25),
    "bag": BAG,
    "field": replace(_row("row-dense", 0.125, 0.25), drives=WORN, ground=StandGround("C")),
}
"""``field`` is the dense row with a worn machine, on ground that is no plane: nobody grinds gears, calibrates
encoders and levels the ground before every row."""


PRESETS = {"modern-perception": {"process.locate_s": 1.0}}
"""``modern-perception``: heads are located in a second [assumed: field detectors with depth cameras run at 10 a second
and more], where the default's 7.3 s are what the published cycle leaves over."""


@dataclass(frozen=True)
class RewardWeights(Config):
    """Value of the named reward terms, in grams of filament."""

    collected_g: float = num(1.0, -1000.0, 1000.0, "")
    """For every gram collected."""
    lost_g: float = num(-0.25, -1000.0, 1000.0, "")
    """For every gram that a pick leaves on the head or drops."""
    seconds: float = num(-0.008, -1000.0, 1000.0, "g/s")
    """For every second; a head of 0.38 g in the published 16 s earns 0.024 g/s, time is charged at a third of that
    [assumed]."""


@dataclass(frozen=True)
class SafflowerConfig(Config):
    """Everything that defines a picking task."""

    scenario: ScenarioConfig = nested(POTS)
    """What grows, and what the machine is set to for it."""
    machine: MachineConfig = nested(MachineConfig)
    """The cart and its arm."""
    process: ProcessConfig = nested(ProcessConfig)
    """Cutting and sucking."""
    weights: RewardWeights = nested(RewardWeights)
    """The reward."""
    slots: int = num(16, 1, 5000, "")
    """Candidates that a policy is shown at once."""
    head_mass_g: float = num(0.377, 1e-3, 5.0, "g")
    """Fresh filaments of an open head [identified: Table 2, 14.152 g on 15 pots of 2.5 heads]."""
    head_mass_spread: float = num(0.25, 0.0, 0.6, "")
    """Standard deviation of the logarithm of a head's mass [assumed]."""
    lane_m: float = num(0.05, 1e-3, 5.0, "m")
    """The fixed order sweeps lanes of this width across the row, to and fro [assumed: the paper names no order]."""

    def check(self) -> None:
        """No more candidates than reports."""
        if self.slots > self.scenario.max_tracks:
            self.refuse("slots", f"give at most scenario.max_tracks = {self.scenario.max_tracks}")
