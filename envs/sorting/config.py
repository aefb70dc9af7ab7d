"""Numbers of the produce sorter: machine, gripper, belt, produce, perception and scenario tiers.

Every number says where it comes from: [published] printed by a source, [identified] found so that a stated result
comes out, [assumed] a free choice. The 3-PRRS paper names sorting as a use of its machine and gives no sorting
figures, so nearly everything here is assumed.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from math import pi, radians

import numpy as np

from ...kernels.config import Config, nested, num
from ...mechanisms import ThreePRRS
from ...simulation.assets import asset_text
from ...simulation.sorter_model import SorterParameters
from ..drives import DriveErrors, LinearDrive, RotaryDrive
from .order_config import OrderConfig

GRADES = ("ware", "seed", "ripe", "green")
"""Large tubers, small tubers, ripe fruits, unripe fruits: two shapes, two colours."""

Pair = tuple[float, float]
Triple = tuple[float, float, float]
Four = tuple[float, float, float, float]

_STRAIGHT = radians(90.0)


@dataclass(frozen=True)
class MachineConfig(Config):
    """The 3-PRRS over the belt and how it is used. Mechanism coordinates: x with the belt, y across, z up."""

    sorter: SorterParameters = nested(SorterParameters)
    """Geometry, rates and motors."""
    travel_level_m: float = num(0.090, 0.03, 0.095, "m")
    """Platform height of every traverse, in the mechanism's coordinates [assumed: clears what lies on the belt]."""
    tilt_limit_rad: float = num(radians(20.0), 0.0, radians(20.0), "rad")
    """Largest tilt that is commanded: the stroke ends a little above it [assumed, from the reach table]."""
    yaw_limit_rad: float = num(radians(60.0), 0.0, radians(60.0), "rad")
    """Largest yaw that is commanded [assumed: the reach shrinks with the yaw]."""
    shortest_move_s: float = num(0.10, 1e-3, 10.0, "s")
    """A motion is given at least this long [assumed]."""
    stop_s: float = num(0.15, 1e-3, 10.0, "s")
    """Coming to rest from the belt's speed after a grip that holds nothing [assumed]."""


@dataclass(frozen=True)
class GripConfig(Config):
    """Two soft fingers that close across the item's width, and what misalignment costs."""

    grip_s: float = num(0.15, 0.0, 10.0, "s")
    """Closing the fingers, while the tool follows the belt [assumed]."""
    release_s: float = num(0.10, 0.0, 10.0, "s")
    """Opening them over the bin [assumed]."""
    best: float = num(0.98, 0.0, 1.0, "")
    """Share of centred, aligned grips that hold [assumed]."""
    centre_sigma_m: float = num(0.008, 1e-6, 0.2, "m")
    """Horizontal tool error (Gaussian sigma) that costs 39 % of them [assumed]."""
    height_sigma_m: float = num(0.012, 1e-6, 0.2, "m")
    """The same for a tool too high or too low [assumed]."""
    capture_m: float = num(0.025, 1e-6, 0.2, "m")
    """Beyond this horizontal error the fingers close beside the item [assumed]."""
    misfit_sigma: float = num(0.12, 1e-6, 10.0, "")
    """Misfit of the fingers that costs 39 %: sine of the error in yaw times 1 - width / length, and sine of the error
    in tilt times 1 - thickness / length; a round item does not mind how it is turned [assumed]."""
    slip: float = num(0.35, 0.0, 1.0, "")
    """Share of held items that slip on the way, times 1 - quality of the grip [assumed]."""
    refused_tilt_rad: float = num(radians(8.0), 0.0, _STRAIGHT, "rad")
    """Items that lean by more than this beyond the machine's tilt limit are not gripped [assumed]."""
    illegal_s: float = num(0.25, 1e-3, 60.0, "s")
    """What an action that is not possible costs [assumed]."""
    wait_s: float = num(0.50, 1e-3, 60.0, "s")
    """Length of one wait [assumed]."""


@dataclass(frozen=True)
class ProduceConfig(Config):
    """What comes down the belt: ellipsoids with length >= width >= thickness [all assumed].

    Sizes and shapes are uniform on a raster over their ranges, ends included, so that the rendered world can hold a
    body of every kind.
    """

    fruit_share: float = num(0.5, 0.0, 1.0, "")
    """Share of fruits, the others are tubers."""
    tuber_length_m: Pair = num((0.044, 0.080), 0.005, 0.3, "m")
    """Lengths of tubers: typical sorting sizes."""
    ware_from_m: float = num(0.061, 0.0, 0.3, "m")
    """Tubers at least this long are ware, shorter ones seed."""
    tuber_width: Pair = num((0.62, 0.80), 0.05, 1.0, "")
    """Width / length of tubers."""
    fruit_length_m: Pair = num((0.044, 0.064), 0.005, 0.3, "m")
    """Lengths of fruits."""
    fruit_width: Pair = num((0.92, 1.0), 0.05, 1.0, "")
    """Width / length of fruits."""
    thickness: Pair = num((0.72, 0.86), 0.05, 1.0, "")
    """Thickness / width."""
    length_step_m: float = num(0.002, 1e-4, 0.3, "m")
    """Raster of the lengths."""
    shape_levels: int = num(3, 1, 1000, "")
    """Levels of either ratio."""
    ripe_from: float = num(0.5, 0.0, 1.0, "")
    """Ripeness is uniform in [0, 1]; fruits at least this ripe are ripe."""
    skin_sigma: float = num(0.06, 0.0, 1.0, "")
    """How far the skin's colour is from what the ripeness says, on the same scale."""
    tilt_sigma_rad: float = num(radians(9.0), 0.0, pi / 4, "rad")
    """Items lean on the ribs of the belt and on each other: Rayleigh."""
    tilt_max_rad: float = num(radians(40.0), 0.0, _STRAIGHT, "rad")
    """None leans further."""
    density_kg_m3: float = num(1050.0, 10.0, 25_000.0, "kg/m3")
    """Of all produce."""
    value: Four = num((1.0, 0.5, 0.8, 0.3), 0.0, 10.0, "")
    """Of a correctly placed item, by grade."""

    def check(self) -> None:
        """Ranges have a lower and an upper end."""
        for name in ("tuber_length_m", "fruit_length_m", "tuber_width", "fruit_width", "thickness"):
            low, high = getattr(self, name)
            if low > high:
                self.refuse(name, "give the smaller one first")


@dataclass(frozen=True)
class BeltConfig(Config):
    """The belt and the bins beside it, in mechanism coordinates [all assumed]."""

    speed_m_s: float = num(0.06, 1e-3, 5.0, "m/s")
    """Of the belt, which never stops."""
    width_m: float = num(0.28, 0.02, 3.0, "m")
    """Of the belt."""
    item_half_width_m: float = num(0.105, 0.0, 1.5, "m")
    """Item centres keep to this distance from the belt's middle."""
    camera_x_m: float = num(-0.46, -5.0, 0.0, "m")
    """The camera looks down here, upstream of the machine."""
    camera_step_m: float = num(0.10, 1e-3, 2.0, "m")
    """Belt travel between two images; an item is reported from the image that shows it nearest the middle."""
    latency_s: float = num(0.15, 0.0, 10.0, "s")
    """From the image to the report."""
    slip_sigma_m: float = num(0.002, 0.0, 0.05, "m")
    """Along and across: where an item is gripped against where the camera and the belt's encoder put it; slip, rolling,
    and the registration of camera and machine."""
    start_x_m: float = num(-0.23, -5.0, 5.0, "m")
    """Where the first item may be when the episode begins: the stream is running already."""
    exit_x_m: float = num(0.22, 0.01, 5.0, "m")
    """An item that gets here has passed."""
    bins_m: tuple[Pair, Pair, Pair, Pair] = num(
        ((-0.08, 0.20), (0.08, 0.20), (-0.08, -0.20), (0.08, -0.20)), -2.0, 2.0, "m"
    )
    """Where the platform lets go of each grade."""

    def check(self) -> None:
        """The camera is upstream, and the stream begins before it ends."""
        if not self.camera_x_m + self.camera_step_m < 0.0:
            self.refuse("camera_x_m", f"give less than -camera_step_m = {-self.camera_step_m:g} m")
        if not self.start_x_m < self.exit_x_m:
            self.refuse("start_x_m", f"give less than exit_x_m = {self.exit_x_m:g} m")
        if self.item_half_width_m > 0.5 * self.width_m:
            self.refuse("item_half_width_m", f"give at most half of width_m = {self.width_m:g} m")


@dataclass(frozen=True)
class PerceptionModel(Config):
    """What the camera reports, as a statistical model; kinds are tuber and fruit.

    See ``scripts/measure_camera.py``.
    """

    recall: float = num(..., 0.0, 1.0, "")
    """Share of items that are reported."""
    false_per_item: float = num(..., 0.0, 10.0, "")
    """Reports of nothing, for each item."""
    bias_m: Triple = num(..., -0.2, 0.2, "m")
    """Of the reported centre (along, across, up)."""
    sigma_m: Triple = num(..., 0.0, 0.2, "m")
    """Error of the reported centre (along, across, up)."""
    yaw_sigma_rad: Pair = num(..., 0.0, pi, "rad")
    """By kind; a fruit is nearly round."""
    tilt_sigma_rad: Pair = num(..., 0.0, pi, "rad")
    """Per horizontal component, by kind."""
    length_sigma: float = num(..., 0.0, 0.1, "")
    """Relative error of the reported axes."""
    confusion: tuple[Four, Four, Four, Four] = num(..., 0.0, 1.0, "")
    """Row = true grade, column = reported grade, rows sum to 1."""

    def check(self) -> None:
        """Rows of shares sum to 1."""
        for row in self.confusion:
            if abs(sum(row) - 1.0) > 1e-3:
                self.refuse("confusion", f"each row must sum to 1, one sums to {sum(row):.6g}")

    @classmethod
    def perfect(cls) -> PerceptionModel:
        """Every item exactly as it is."""
        identity = tuple(tuple(float(i == j) for j in range(4)) for i in range(4))
        nowhere, none = (0.0, 0.0, 0.0), (0.0, 0.0)
        return cls(1.0, 0.0, nowhere, nowhere, none, none, 0.0, identity)  # type: ignore[arg-type]

    @classmethod
    @lru_cache(maxsize=1)
    def measured(cls) -> PerceptionModel:
        """The fit to rendered images that ships with the package [identified]."""
        data = json.loads(asset_text("perception/sorting.json"))
        return cls(
            recall=data["recall"],
            false_per_item=data["false_per_item"],
            bias_m=data["position_bias_m"],
            sigma_m=data["position_sigma_m"],
            yaw_sigma_rad=data["yaw_sigma_rad"],
            tilt_sigma_rad=data["tilt_sigma_rad"],
            length_sigma=data["length_sigma"],
            confusion=data["grade_confusion"],
        )


REFERENCE_CYCLE_S = 1.60
"""Cycle of the machine with ``fifo`` and never a lack of items [identified: ``scripts/calibrate_sorter_load.py``]."""


@dataclass(frozen=True)
class ScenarioConfig(Config):
    """One kind of stream."""

    load: float = num(..., 1e-3, 20.0, "")
    """Offered load: arrival rate times ``REFERENCE_CYCLE_S``; above 1 the machine cannot serve every item."""
    clump: float = num(1.0, 1.0, 100.0, "")
    """Mean number of items that come together; 1 is a Poisson stream."""
    clump_gap_s: float = num(0.20, 1e-3, 600.0, "s")
    """Mean time between the items of a clump."""
    stream_s: float = num(90.0, 1e-3, 3600.0, "s")
    """Items come for this long."""
    time_limit_s: float = num(150.0, 1e-3, 36_000.0, "s")
    """The episode is cut off then."""
    drives: DriveErrors = nested(DriveErrors)
    """Errors of sliders and swings."""
    orders: OrderConfig = nested(OrderConfig)
    """What is packed, until when; none as it stands."""

    def check(self) -> None:
        """Clumps cannot come slower than the stream itself, and cut-offs not after all is over."""
        last_s = self.orders.every_s * self.orders.shipments
        if last_s > self.time_limit_s:
            self.refuse(
                "orders.shipments",
                f"the last leaves after {last_s:g} s: at most time_limit_s = {self.time_limit_s:g} s",
            )
        if (1.0 - 1.0 / self.clump) * self.clump_gap_s >= 1.0 / self.rate_hz:
            self.refuse("clump_gap_s", f"an item comes every {1.0 / self.rate_hz:.3g} s: give less, or a smaller clump")

    @property
    def rate_hz(self) -> float:
        """Mean arrivals a second."""
        return self.load / REFERENCE_CYCLE_S

    @property
    def max_items(self) -> int:
        """Most items in one stream: six standard deviations above the mean."""
        mean = self.rate_hz * self.stream_s
        return int(mean + 6.0 * (mean * (2.0 * self.clump - 1.0)) ** 0.5) + 4


WORN = DriveErrors(
    LinearDrive(encoder_m=0.0005, backlash_m=0.0005, stiction_m=0.0001),
    RotaryDrive(encoder_rad=0.002, backlash_rad=0.0044, stiction_rad=0.001),
    lag_s=0.015,
)
"""Drives after a season of soil and juice: sliders on belts with 0.5 mm of play, encoders off by as much, gears of 15
arc minutes, servos of 11 Hz [assumed: the usual class of planetary gears, belts that were not tightened]."""

SCENARIOS: dict[str, ScenarioConfig] = {
    "load-0.7": ScenarioConfig(0.7),
    "load-1.0": ScenarioConfig(1.0),
    "load-1.25": ScenarioConfig(1.25),
    "load-1.6": ScenarioConfig(1.6),
    "clumped-1.25": ScenarioConfig(1.25, clump=4.0),
    "field": ScenarioConfig(1.25, clump=4.0, drives=WORN),
    "orders": ScenarioConfig(1.6, orders=OrderConfig(shipments=4)),
}
"""``orders`` is ``load-1.6`` packed to order: lorries leave while produce comes, each with lines of two grades.
``field`` is ``clumped-1.25`` on a machine that has worked for a season: produce comes as the harvester's web throws
it, and belts are tightened in winter."""


PRESETS = {
    "slipping-belt": {"belt.slip_sigma_m": 0.005},
    "fast-belt": {"belt.speed_m_s": 0.12},
    "typical-gripper": {"grip.grip_s": 0.30, "grip.release_s": 0.20},
    "mixed-produce": {"grip.best": 0.90},
}
"""``slipping-belt``: produce rolls [assumed]. ``fast-belt``: the upper end of what sorting paddles were tested at
[published: 4-12 cm/s, AgriEngineering 6(3) 175]. ``typical-gripper``: soft fingers of 100-300 ms a stroke [published:
vendors]. ``mixed-produce``: fewer centred grips hold than in a laboratory [assumed, between the published 81 % in an
orchard and 96 % in the laboratory, arXiv 2408.06674]."""


@dataclass(frozen=True)
class RewardWeights(Config):
    """Value of the named reward terms."""

    placed: float = num(1.0, -100.0, 100.0, "")
    """Times the value of the item's grade."""
    misplaced: float = num(-0.5, -100.0, 100.0, "")
    """An item in a wrong bin."""
    dropped: float = num(-0.5, -100.0, 100.0, "")
    """An item that slips out on the way."""
    wasted: float = num(-0.05, -100.0, 100.0, "")
    """A grip that held nothing."""


@dataclass(frozen=True)
class SortingConfig(Config):
    """Everything that defines a sorting task."""

    scenario: ScenarioConfig = nested(SCENARIOS["load-1.25"])
    """The stream."""
    machine: MachineConfig = nested(MachineConfig)
    """The 3-PRRS over the belt."""
    grip: GripConfig = nested(GripConfig)
    """The fingers."""
    produce: ProduceConfig = nested(ProduceConfig)
    """What comes down the belt."""
    belt: BeltConfig = nested(BeltConfig)
    """The belt and the bins."""
    weights: RewardWeights = nested(RewardWeights)
    """What counts."""
    slots: int = num(12, 1, 64, "")
    """Candidates that a policy is shown at once, in the order in which they leave the reach."""

    def check(self) -> None:
        """The machine can follow the belt and put down at the bins."""
        limit = self.machine.sorter.velocity_m_s
        if not self.belt.speed_m_s < 0.5 * limit:
            self.refuse("belt.speed_m_s", f"the tool, at {limit} m/s, cannot follow: give less than half of that")
        sorter, level_m = self.machine.sorter, self.machine.travel_level_m
        for place, there in zip(self.belt.bins_m, _reaches(sorter.mechanism, level_m, self.belt.bins_m), strict=True):
            if not there:
                self.refuse(
                    "belt.bins_m", f"the machine cannot reach {place} at {level_m:g} m, its travel level: give others"
                )


@lru_cache(maxsize=32)
def _reaches(mechanism: ThreePRRS, level_m: float, places_m: tuple[Pair, ...]) -> tuple[bool, ...]:
    """Whether the level platform can be over each place."""
    poses = np.zeros((len(places_m), 6))
    poses[:, :2], poses[:, 2] = places_m, level_m
    return tuple(mechanism.reachable(poses).tolist())
