"""Numbers of the produce sorter: machine, gripper, belt, produce, perception and scenario tiers.

Every number says where it comes from: [published] printed by a source, [identified] found so that a stated result
comes out, [assumed] a free choice. The 3-PRRS paper names sorting as a use of its machine and gives no sorting
figures, so nearly everything here is assumed.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.resources import files
from math import inf, pi, radians

from ...simulation.sorter_model import SorterParameters

GRADES = ("ware", "seed", "ripe", "green")
"""Large tubers, small tubers, ripe fruits, unripe fruits: two shapes, two colours."""


def _require(owner: object, low: float, *names: str, high: float = inf) -> None:
    for name in names:
        value = getattr(owner, name)
        if not low <= value <= high:
            raise ValueError(f"{type(owner).__name__}.{name} = {value}: allowed range [{low}, {high}]")


@dataclass(frozen=True)
class MachineConfig:
    """The 3-PRRS over the belt and how it is used. Mechanism coordinates: x with the belt, y across, z up."""

    sorter: SorterParameters = field(default_factory=SorterParameters)
    """Geometry, rates and motors."""
    travel_level_m: float = 0.090
    """Platform height of every traverse, in the mechanism's coordinates [assumed: clears what lies on the belt]."""
    tilt_limit_rad: float = radians(20.0)
    """Largest tilt that is commanded: the stroke ends a little above it [assumed, from the reach table]."""
    yaw_limit_rad: float = radians(60.0)
    """Largest yaw that is commanded [assumed: the reach shrinks with the yaw]."""
    shortest_move_s: float = 0.10
    """A motion is given at least this long [assumed]."""
    stop_s: float = 0.15
    """Coming to rest from the belt's speed after a grip that holds nothing [assumed]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        _require(self, 1e-3, "shortest_move_s", "stop_s")
        _require(self, 0.0, "tilt_limit_rad", high=radians(20.0))
        _require(self, 0.0, "yaw_limit_rad", high=radians(60.0))
        _require(self, 0.03, "travel_level_m", high=0.095)


@dataclass(frozen=True)
class GripConfig:
    """Two soft fingers that close across the item's width, and what misalignment costs."""

    grip_s: float = 0.15
    """Closing the fingers, while the tool follows the belt [assumed]."""
    release_s: float = 0.10
    """Opening them over the bin [assumed]."""
    best: float = 0.98
    """Share of centred, aligned grips that hold [assumed]."""
    centre_sigma_m: float = 0.008
    """Horizontal tool error (Gaussian sigma) that costs 39 % of them [assumed]."""
    height_sigma_m: float = 0.012
    """The same for a tool too high or too low [assumed]."""
    capture_m: float = 0.025
    """Beyond this horizontal error the fingers close beside the item [assumed]."""
    misfit_sigma: float = 0.12
    """Misfit of the fingers that costs 39 %: sine of the error in yaw times 1 - width / length, and sine of the error
    in tilt times 1 - thickness / length; a round item does not mind how it is turned [assumed]."""
    slip: float = 0.35
    """Share of held items that slip on the way, times 1 - quality of the grip [assumed]."""
    refused_tilt_rad: float = radians(8.0)
    """Items that lean by more than this beyond the machine's tilt limit are not gripped [assumed]."""
    illegal_s: float = 0.25
    """What an action that is not possible costs [assumed]."""
    wait_s: float = 0.50
    """Length of one wait [assumed]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        _require(self, 0.0, "grip_s", "release_s", "refused_tilt_rad")
        _require(self, 1e-6, "centre_sigma_m", "height_sigma_m", "capture_m", "misfit_sigma")
        _require(self, 1e-3, "illegal_s", "wait_s")
        _require(self, 0.0, "best", "slip", high=1.0)


@dataclass(frozen=True)
class ProduceConfig:
    """What comes down the belt: ellipsoids with length >= width >= thickness [all assumed].

    Sizes and shapes are uniform on a raster over their ranges, ends included, so that the rendered world can hold a
    body of every kind.
    """

    fruit_share: float = 0.5
    tuber_length_m: tuple[float, float] = (0.044, 0.080)
    """Typical sorting sizes."""
    ware_from_m: float = 0.061
    """Tubers at least this long are ware, shorter ones seed."""
    tuber_width: tuple[float, float] = (0.62, 0.80)
    """Width / length."""
    fruit_length_m: tuple[float, float] = (0.044, 0.064)
    fruit_width: tuple[float, float] = (0.92, 1.0)
    thickness: tuple[float, float] = (0.72, 0.86)
    """Thickness / width."""
    length_step_m: float = 0.002
    shape_levels: int = 3
    """Levels of either ratio."""
    ripe_from: float = 0.5
    """Ripeness is uniform in [0, 1]; fruits at least this ripe are ripe."""
    skin_sigma: float = 0.06
    """How far the skin's colour is from what the ripeness says, on the same scale."""
    tilt_sigma_rad: float = radians(9.0)
    """Items lean on the ribs of the belt and on each other: Rayleigh."""
    tilt_max_rad: float = radians(40.0)
    density_kg_m3: float = 1050.0
    value: tuple[float, float, float, float] = (1.0, 0.5, 0.8, 0.3)
    """Of a correctly placed item, by grade."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        _require(self, 0.0, "fruit_share", "ripe_from", "skin_sigma", high=1.0)
        _require(self, 0.0, "tilt_sigma_rad", high=pi / 4)
        for name in ("tuber_length_m", "fruit_length_m", "tuber_width", "fruit_width", "thickness"):
            low, high = getattr(self, name)
            if not 0.0 < low <= high:
                raise ValueError(f"{name} = {(low, high)}: give a range with 0 < lower <= upper")
        for name in ("tuber_width", "fruit_width", "thickness"):
            if getattr(self, name)[1] > 1.0:
                raise ValueError(f"{name} = {getattr(self, name)}: length >= width >= thickness needs ratios <= 1")
        _require(self, 1e-4, "length_step_m")
        _require(self, 1, "shape_levels")
        if len(self.value) != len(GRADES):
            raise ValueError(f"value = {self.value}: give {len(GRADES)} numbers, one a grade {GRADES}")


@dataclass(frozen=True)
class BeltConfig:
    """The belt and the bins beside it, in mechanism coordinates [all assumed]."""

    speed_m_s: float = 0.06
    width_m: float = 0.28
    item_half_width_m: float = 0.105
    """Item centres keep to this distance from the belt's middle."""
    camera_x_m: float = -0.46
    """The camera looks down here, upstream of the machine."""
    camera_step_m: float = 0.10
    """Belt travel between two images; an item is reported from the image that shows it nearest the middle."""
    latency_s: float = 0.15
    """From the image to the report."""
    slip_sigma_m: float = 0.002
    """Along and across: where an item is gripped against where the camera and the belt's encoder put it; slip, rolling,
    and the registration of camera and machine."""
    start_x_m: float = -0.23
    """Where the first item may be when the episode begins: the stream is running already."""
    exit_x_m: float = 0.22
    """An item that gets here has passed."""
    bins_m: tuple[tuple[float, float], ...] = ((-0.08, 0.20), (0.08, 0.20), (-0.08, -0.20), (0.08, -0.20))
    """Where the platform lets go of each grade."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        _require(self, 1e-3, "speed_m_s", "camera_step_m")
        _require(self, 0.0, "latency_s", "item_half_width_m", "slip_sigma_m")
        if len(self.bins_m) != len(GRADES):
            raise ValueError(f"bins_m = {self.bins_m}: give {len(GRADES)} places, one a grade {GRADES}")
        if not self.camera_x_m + self.camera_step_m < 0.0 < self.exit_x_m:
            raise ValueError(f"camera_x_m = {self.camera_x_m} must be upstream, exit_x_m = {self.exit_x_m} downstream")


@dataclass(frozen=True)
class PerceptionModel:
    """What the camera reports, as a statistical model; kinds are tuber and fruit.

    See ``scripts/measure_produce_camera.py``.
    """

    recall: float
    false_per_item: float
    bias_m: tuple[float, float, float]
    sigma_m: tuple[float, float, float]
    """Error of the reported centre (along, across, up)."""
    yaw_sigma_rad: tuple[float, float]
    """By kind; a fruit is nearly round."""
    tilt_sigma_rad: tuple[float, float]
    """Per horizontal component, by kind."""
    length_sigma: float
    """Relative error of the reported axes."""
    confusion: tuple[tuple[float, ...], ...]
    """Row = true grade, column = reported grade, rows sum to 1."""

    @classmethod
    def perfect(cls) -> PerceptionModel:
        """Every item exactly as it is."""
        identity = tuple(tuple(float(i == j) for j in range(4)) for i in range(4))
        nowhere, none = (0.0, 0.0, 0.0), (0.0, 0.0)
        return cls(1.0, 0.0, nowhere, nowhere, none, none, 0.0, identity)

    @classmethod
    @lru_cache(maxsize=1)
    def measured(cls) -> PerceptionModel:
        """The fit to rendered images that ships with the package [identified]."""
        text = files(__name__.rsplit(".", 3)[0]).joinpath("assets/perception/sorting.json").read_text("utf-8")
        data = json.loads(text)
        return cls(
            recall=data["recall"],
            false_per_item=data["false_per_item"],
            bias_m=tuple(data["position_bias_m"]),
            sigma_m=tuple(data["position_sigma_m"]),
            yaw_sigma_rad=tuple(data["yaw_sigma_rad"]),
            tilt_sigma_rad=tuple(data["tilt_sigma_rad"]),
            length_sigma=data["length_sigma"],
            confusion=tuple(tuple(row) for row in data["grade_confusion"]),
        )


REFERENCE_CYCLE_S = 1.60
"""Cycle of the machine with ``fifo`` and never a lack of items [identified: ``scripts/calibrate_sorter_load.py``]."""


@dataclass(frozen=True)
class ScenarioConfig:
    """One kind of stream."""

    load: float
    """Offered load: arrival rate times ``REFERENCE_CYCLE_S``; above 1 the machine cannot serve every item."""
    clump: float = 1.0
    """Mean number of items that come together; 1 is a Poisson stream."""
    clump_gap_s: float = 0.20
    """Mean time between the items of a clump."""
    stream_s: float = 90.0
    """Items come for this long."""
    time_limit_s: float = 150.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        _require(self, 1e-3, "load", "clump_gap_s", "stream_s", "time_limit_s")
        _require(self, 1.0, "clump")
        if (1.0 - 1.0 / self.clump) * self.clump_gap_s >= 1.0 / self.rate_hz:
            raise ValueError(f"clump_gap_s = {self.clump_gap_s}: clumps cannot come slower than the stream itself")

    @property
    def rate_hz(self) -> float:
        """Mean arrivals a second."""
        return self.load / REFERENCE_CYCLE_S

    @property
    def max_items(self) -> int:
        """Most items in one stream: six standard deviations above the mean."""
        mean = self.rate_hz * self.stream_s
        return int(mean + 6.0 * (mean * (2.0 * self.clump - 1.0)) ** 0.5) + 4


SCENARIOS: dict[str, ScenarioConfig] = {
    "load-0.7": ScenarioConfig(0.7),
    "load-1.0": ScenarioConfig(1.0),
    "load-1.25": ScenarioConfig(1.25),
    "load-1.6": ScenarioConfig(1.6),
    "clumped-1.25": ScenarioConfig(1.25, clump=4.0),
}


@dataclass(frozen=True)
class RewardWeights:
    """Value of the named reward terms."""

    placed: float = 1.0
    """Times the value of the item's grade."""
    misplaced: float = -0.5
    dropped: float = -0.5
    wasted: float = -0.05
    """A grip that held nothing."""


@dataclass(frozen=True)
class SortingConfig:
    """Everything that defines a sorting task."""

    scenario: ScenarioConfig = SCENARIOS["load-1.25"]
    machine: MachineConfig = field(default_factory=MachineConfig)
    grip: GripConfig = field(default_factory=GripConfig)
    produce: ProduceConfig = field(default_factory=ProduceConfig)
    belt: BeltConfig = field(default_factory=BeltConfig)
    weights: RewardWeights = field(default_factory=RewardWeights)
    slots: int = 12
    """Candidates that a policy is shown at once, in the order in which they leave the reach."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 1 <= self.slots <= 64:
            raise ValueError(f"slots = {self.slots}: allowed range [1, 64]")
        limit = self.machine.sorter.velocity_m_s
        if not self.belt.speed_m_s < 0.5 * limit:
            raise ValueError(f"speed_m_s = {self.belt.speed_m_s}: the tool, at {limit} m/s, cannot follow the belt")
