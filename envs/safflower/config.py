"""Numbers of the safflower picker: machine, process, perception and scenario tiers.

Every number says where it comes from: [published] printed by a source, [identified] found so that a published
result comes out, [assumed] a free choice. "The paper" is Guo et al. 2022, Eng. Agric. 42(1) e20210129.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields
from functools import lru_cache
from math import inf

from ...simulation.assets import asset_path
from ...simulation.picker_model import PickerParameters

EFFORTS = ("quick", "normal", "thorough")
STAGES = ("bud", "fresh", "late", "dry")
OPEN_STAGES = (1, 2)


def _require(owner: object, low: float, *names: str, high: float = inf) -> None:
    for name in names:
        value = getattr(owner, name)
        if not low <= value <= high:
            raise ValueError(f"{type(owner).__name__}.{name} = {value}: allowed range [{low}, {high}]")


@dataclass(frozen=True)
class MachineConfig:
    """The cart and its arm: the machine itself and how it is used."""

    picker: PickerParameters = field(default_factory=PickerParameters)
    """Geometry, rates and motors; the scenario sets its ``motor_height_m``."""
    clear_level_m: float = -0.28
    """Level of every traverse in the arm's plane, the widest part of the workspace [assumed]."""
    settle_s: float = 0.5
    """Wait after the cart has moved, until plants and frame stand still [assumed]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        _require(self, 0.0, "settle_s")
        bar = self.picker.five_bar
        if not bar.reachable([0.5 * bar.base_m, self.clear_level_m]):
            raise ValueError(f"clear_level_m = {self.clear_level_m} m is outside the arm's workspace")


@dataclass(frozen=True)
class ProcessConfig:
    """Cutting and sucking one head, by effort (quick, normal, thorough)."""

    strokes: tuple[int, int, int] = (1, 2, 3)
    """Shear strokes over the head [assumed]."""
    suction_s: tuple[float, float, float] = (1.0, 2.0, 3.0)
    """Suction after the last stroke [assumed]."""
    shear_speed: float = 0.030
    """Reciprocating shear speed, m/s [published: the paper, test conditions]."""
    stroke_m: float = 0.04785
    """Length of one stroke: the filament spread [published: 47.85 +- 3.73 mm]."""
    locate_s: float = 7.304
    """Locating one head and handing its coordinates to the motors, before every pick [identified: 16 s per head]."""
    recognise_s: float = 1.0
    """Taking and segmenting the image of a stop [assumed]."""
    stroke_cut: float = 0.7505
    """Share of the remaining filaments that one centred stroke cuts [identified: 87.91 % net rate]."""
    cut_radius_m: float = 0.012
    """Radial tool error (Gaussian sigma) that costs a stroke 39 % of its cut [assumed: half the tuft's radius]."""
    cut_height_m: float = 0.010
    """The same for a tool held too high or too low [assumed: half the 21.6 mm head height]."""
    capture_radius_m: float = 0.024
    """Beyond this radial error the head does not enter the shear hole [published: half the filament spread]."""
    suction_loss: float = 0.35
    """Share of the cut filaments that would drop without suction time [assumed]."""
    suction_decay_s: float = 1.0
    """Time constant with which suction time reduces that share [assumed]."""
    luck_logit: float = 0.509
    """Standard deviation of a head's cut and collection on the logit scale [identified: Table 2, SD 1.60 points]."""
    illegal_s: float = 1.0
    """What an action that is not possible costs [assumed]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("strokes", "suction_s"):
            values = getattr(self, name)
            if len(values) != len(EFFORTS) or min(values) < 0:
                raise ValueError(f"{name} = {values}: give {len(EFFORTS)} values >= 0, one an effort {EFFORTS}")
        _require(self, 1e-6, "shear_speed", "stroke_m", "cut_radius_m", "cut_height_m", "suction_decay_s")
        _require(self, 0.0, "locate_s", "recognise_s", "capture_radius_m", "luck_logit", "illegal_s")
        _require(self, 0.0, "suction_loss", high=1.0)
        _require(self, 1e-6, "stroke_cut", high=1.0 - 1e-6)


@dataclass(frozen=True)
class PerceptionModel:
    """What the camera reports of a head, as a statistical model (see ``scripts/measure_picker_camera.py``)."""

    recall: tuple[tuple[float, ...], ...]
    """Probability that a head is reported, by stage, free and occluded."""
    false_per_stop: float
    """Mean number of reports at a stop that are no head."""
    bias_m: tuple[float, ...]
    sigma_m: tuple[float, ...]
    """Error of the reported position (along, across, up)."""
    stage_confusion: tuple[tuple[float, ...], ...]
    """Row = true stage, column = reported stage, rows sum to 1."""
    size_sigma: float
    """Relative error of the reported size."""

    @classmethod
    def perfect(cls) -> PerceptionModel:
        """Every head with filaments, exactly where it is."""
        identity = tuple(tuple(float(i == j) for j in range(4)) for i in range(4))
        return cls(((0.0, 1.0, 1.0, 1.0),) * 2, 0.0, (0.0,) * 3, (0.0,) * 3, identity, 0.0)

    @classmethod
    @lru_cache(maxsize=8)
    def measured(cls, scenario: str) -> PerceptionModel:
        """The fit to rendered images of a scenario that ships with the package [identified]."""
        with asset_path("perception/safflower.json") as path:
            data = json.loads(path.read_text("utf-8"))["scenarios"][scenario]
        return cls(
            recall=tuple(tuple(row) for row in data["recall"]),
            false_per_stop=data["false_per_stop"],
            bias_m=tuple(data["position_bias_m"]),
            sigma_m=tuple(data["position_sigma_m"]),
            stage_confusion=tuple(tuple(row) for row in data["stage_confusion"]),
            size_sigma=data["size_sigma"],
        )


@dataclass(frozen=True)
class ScenarioConfig:
    """One kind of field. Lengths in metres, days as days of flowering."""

    plants: int
    pitch_m: float
    """Distance of the plants in the row."""
    window_m: float
    """Length of row that a stop serves; the next stop is this much farther."""
    max_heads: int
    """Most heads on a plant; draws beyond it are cut off."""
    mean_heads: float
    """Mean of the negative binomial, or of the uniform 1..max_heads when ``dispersion`` is 0."""
    dispersion: float
    """Size parameter of the negative binomial; 0 draws uniformly from 1..max_heads."""
    motor_height_m: float
    """Height of the motors' axes: the frame is set to the crop before a row."""
    plant_height_m: tuple[float, float]
    """Mean and standard deviation, or the range when ``potted``."""
    crown_m: tuple[float, float]
    """Range of the crown's width."""
    head_drop_m: tuple[float, float, float]
    """How far below the plant's top the terminal, primary and secondary heads stand at most."""
    visit_day: tuple[float, float]
    """The row is visited on a day drawn from this range of the flowering period."""
    occluded: float
    """Share of heads behind leaves."""
    potted: bool
    time_limit_s: float
    max_tracks: int
    """Most reports kept in one episode."""
    camera_fit: str
    """Scenario whose measured camera stands in for the camera with ``perception="model"``."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        _require(self, 1, "plants", "max_heads", "max_tracks")
        _require(self, 1e-3, "pitch_m", "window_m", "time_limit_s", "mean_heads")
        _require(self, 0.0, "dispersion")
        _require(self, 0.0, "occluded", high=1.0)

    @property
    def stops(self) -> int:
        """Stops the row needs."""
        if self.window_m == self.pitch_m:
            return self.plants
        return int(-(-self.plants * self.pitch_m // self.window_m))


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


SCENARIOS: dict[str, ScenarioConfig] = {
    "pots": POTS,
    "row-sparse": _row("row-sparse", 0.30, 0.10),
    "row": _row("row", 0.20, 0.175),
    "row-dense": _row("row-dense", 0.125, 0.25),
}


@dataclass(frozen=True)
class RewardWeights:
    """Value of the named reward terms, in grams of filament."""

    collected_g: float = 1.0
    lost_g: float = -0.25
    """For every gram that a pick leaves on the head or drops."""
    seconds: float = -0.008
    """A head of 0.38 g in the published 16 s earns 0.024 g/s; time is charged at a third of that [assumed]."""


@dataclass(frozen=True)
class SafflowerConfig:
    """Everything that defines a picking task."""

    scenario: ScenarioConfig = POTS
    machine: MachineConfig = field(default_factory=MachineConfig)
    process: ProcessConfig = field(default_factory=ProcessConfig)
    weights: RewardWeights = field(default_factory=RewardWeights)
    slots: int = 16
    """Candidates that a policy is shown at once."""
    head_mass_g: float = 0.377
    """Fresh filaments of an open head [identified: Table 2, 14.152 g on 15 pots of 2.5 heads]."""
    head_mass_spread: float = 0.25
    """Standard deviation of the logarithm of a head's mass [assumed]."""
    lane_m: float = 0.05
    """The fixed order sweeps lanes of this width across the row, to and fro [assumed: the paper names no order]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 1 <= self.slots <= self.scenario.max_tracks:
            raise ValueError(f"slots = {self.slots}: allowed range [1, {self.scenario.max_tracks}]")
        _require(self, 1e-6, "head_mass_g", "lane_m")
        _require(self, 0.0, "head_mass_spread")


def as_dict(config: object) -> dict[str, object]:
    """Flat listing of a configuration's fields for documents and tables."""
    return {item.name: getattr(config, item.name) for item in fields(config)}  # type: ignore[arg-type]
