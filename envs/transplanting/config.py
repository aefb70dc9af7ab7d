"""Numbers of the tray transplanter: machine, conveyors, process, perception and scenario tiers.

Every number says where it comes from: [published] printed by a source, [identified] fitted to rendered images,
[assumed] a free choice. "The paper" is Qi, Hu, Ma, Zhang, CCTA 2011, 10.1007/978-3-642-27275-2_11.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf, isclose
from typing import Literal

import numpy as np

from ...kernels.config import Config, choice, flag, nested, num
from ...kernels.config_kinds import show
from ...mechanisms import TranslationalFiveBar
from ...motion import GATE_STYLES, Gate
from ...simulation.assets import asset_text
from ...simulation.friction import below_limit
from ...simulation.transplanter_model import TransplanterParameters
from ..drives import DriveErrors, RotaryDrive

SPEEDS = ("gentle", "normal", "fast")
REPORTS = ("empty", "healthy", "poor")
EMPTY, HEALTHY, POOR, DAMAGED = range(4)
"""What a cell holds; a camera tells the first three apart."""

Motion = Literal["stop-quintic", "stop-septic", "stop-fastest", "blended", "time-optimal"]
MOTIONS: tuple[Motion, ...] = GATE_STYLES
Confusion = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True)
class Tray(Config):
    """A tray of 540 x 280 mm that travels lengthwise, so that its short rows are served."""

    rows: int = num(..., 1, 100, "")
    """Rows along the direction of travel [published: vendors' pages]."""
    columns: int = num(..., 1, 50, "")
    """Cells of a row, across the direction of travel [published: vendors' pages]."""
    pitch_m: float = num(..., 0.005, 0.5, "m")
    """Distance of neighbouring cells both ways [assumed: from the counts]."""
    length_m: float = num(0.540, 0.05, 3.0, "m")
    """Length of the tray [published: vendors' pages]."""
    width_m: float = num(0.280, 0.05, 1.0, "m")
    """Width of the tray [published: vendors' pages]."""

    def check(self) -> None:
        """The cells fit the tray."""
        for name, cells, room in (("rows", self.rows, self.length_m), ("columns", self.columns, self.width_m)):
            if cells * self.pitch_m > room + 1e-9:
                most = int((room + 1e-9) / self.pitch_m)
                self.refuse(name, f"at {1e3 * self.pitch_m:g} mm at most {most} fit {1e3 * room:g} mm")

    @property
    def cells(self) -> int:
        """Cells of the tray."""
        return self.rows * self.columns


TRAYS = {
    50: Tray(10, 5, 0.054),
    72: Tray(12, 6, 0.045),
    128: Tray(16, 8, 0.033),
    200: Tray(20, 10, 0.027),
    288: Tray(24, 12, 0.022),
}
SOURCE_TRAYS, TARGET_TRAYS = (72, 128, 200, 288), (50, 72)


def tray(cells: int, allowed: tuple[int, ...], name: str) -> Tray:
    """The preset with this many cells.

    Raises:
        ValueError: it is not one of ``allowed``.
    """
    if isinstance(cells, bool) or not isinstance(cells, int | np.integer) or cells not in allowed:
        raise ValueError(f"{name} = {show(cells)} cells: choose one of {', '.join(map(str, allowed))}")
    return TRAYS[cells]


@dataclass(frozen=True)
class MachineConfig(Config):
    """The arm and the two conveyors under it.

    The arm's working rectangle is 600 mm wide, a tray 540 x 280 mm: two trays fit side by side only with their short
    sides across, so a presented row is one of a tray's short rows.
    """

    arm: TranslationalFiveBar = nested(TranslationalFiveBar.transplanter)
    """Geometry and masses; its window is the published 600 x 150 mm."""
    torque_limit_n_m: float = num(90.0, 0.1, 1e4, "N m")
    """Each motor behind its gear [assumed: 1.6 times the 56 N m that the fastest gate with the published payload
    needs]."""
    friction_n_m: float = num(0.0, 0.0, 1e4, "N m")
    """Dry friction of each motor, gear and joints, counted against the motor whichever way it works [assumed]."""
    damping_n_m_s: float = num(0.0, 0.0, 1e3, "N m s/rad")
    """Viscous friction of the same [assumed]."""
    motion: Motion = choice("stop-quintic", MOTIONS)
    """How gates are carried out [published: the paper chooses the quintic with stops at the corners]."""
    velocity_m_s: float = num(4.5, 0.01, 30.0, "m/s")
    """Limit of the tool [published]."""
    acceleration_m_s2: float = num(60.0, 0.1, 1e3, "m/s2")
    """Limit of the tool, used whenever the gripper is empty [published]."""
    carry_acceleration_m_s2: tuple[float, float, float] = num((15.0, 35.0, 60.0), 0.1, 1e3, "m/s2")
    """Limit with a plug in the gripper: gentle, normal, fast [assumed; fast is the published limit]."""
    lift_m: float = num(0.150, 0.0, 1.0, "m")
    """Height of every gate: a plug has to pass over its neighbours' leaves [published: workspace height]."""
    straight_m: float = num(0.050, 0.0, 1.0, "m")
    """Straight rise and fall at a gate's ends, the depth of a cell [assumed: the paper prints no length]."""
    corner_radius_m: float = num(inf, 1e-6, inf, "m")
    """Largest corner radius of blended gates [assumed: as large as the straight pieces leave]."""
    tray_centre_m: float = num(0.160, 0.0, 1.0, "m")
    """Distance of either tray's middle from the machine's; 40 mm between the trays are the chute [assumed]."""
    conveyor_velocity_m_s: float = num(0.25, 1e-3, 5.0, "m/s")
    """Limit of the conveyors; plugs must not tip [assumed]."""
    conveyor_acceleration_m_s2: float = num(1.5, 1e-3, 50.0, "m/s2")
    """Limit of the conveyors, likewise [assumed]."""
    conveyor_settle_s: float = num(0.10, 0.0, 60.0, "s")
    """Wait after a conveyor has moved [assumed]."""
    tray_gap_m: float = num(0.040, 0.0, 3.0, "m")
    """Between a tray and the next one on the same conveyor [assumed]."""

    def check(self) -> None:
        """The gates fit the arm's window, which is even about the middle; a plug is carried within the tool's limit."""
        (left, bottom), (right, top) = self.arm.window_m
        if self.lift_m > top - bottom + 1e-9:
            self.refuse("lift_m", f"the arm's window is {top - bottom:g} m high: give at most that")
        if self.straight_m > self.lift_m:
            self.refuse("straight_m", f"give at most lift_m = {self.lift_m:g} m")
        below_limit(self, "friction_n_m", "torque_limit_n_m", "N m")
        if self.arm.masses is None:
            self.refuse("arm.masses", "give LinkMasses(...), or use TranslationalFiveBar.transplanter()")
        if not isclose(left, -right):
            self.refuse("arm.window_m", "give a rectangle that is even about x = 0")
        if max(self.carry_acceleration_m_s2) > self.acceleration_m_s2:
            self.refuse("carry_acceleration_m_s2", f"give at most acceleration_m_s2 = {self.acceleration_m_s2:g} m/s2")

    @property
    def parameters(self) -> TransplanterParameters:
        """The arm with its motors, as it is simulated."""
        return TransplanterParameters(
            arm=self.arm,
            torque_limit_n_m=self.torque_limit_n_m,
            friction_n_m=self.friction_n_m,
            damping_n_m_s=self.damping_n_m_s,
        )

    def gate(self, acceleration_m_s2: float | None = None) -> Gate:
        """The way over a gate, by default under the empty gripper's limit."""
        limit = self.acceleration_m_s2 if acceleration_m_s2 is None else acceleration_m_s2
        return Gate(self.motion, self.velocity_m_s, limit, self.straight_m, self.corner_radius_m)

    def round_trips_per_min(self, across_m: float, handle_s: float = 0.0) -> float:
        """Transplants a minute, out over ``across_m`` and back at full speed, with ``handle_s`` of gripping a cycle."""
        one_way = float(self.gate().durations(self.lift_m, across_m, self.lift_m))
        return 60.0 / (2.0 * one_way + handle_s)


@dataclass(frozen=True)
class ProcessConfig(Config):
    """Gripping, carrying and setting a plug."""

    grip_s: float = num(0.15, 0.0, 60.0, "s")
    """Needles go in and close, pneumatic [assumed]."""
    release_s: float = num(0.10, 0.0, 60.0, "s")
    """Needles open and draw back, pneumatic [assumed]."""
    extraction: float = num(0.9605, 0.0, 1.0, "")
    """Chance that a plug leaves its cell whole [published: 96.05 % in the field, s41598-025-86421-0]."""
    loss_half_m_s2: float = num(105.0, 0.0, 1e4, "m/s2")
    """The chance to lose a plug on the way is logistic in the carrying acceleration, one half at this one: 0.1 %
    gentle, 0.5 % normal, 3 % fast [assumed]."""
    loss_width_m_s2: float = num(13.0, 1e-3, 1e4, "m/s2")
    """How wide that chance's rise is [assumed]."""
    damage_half_m_s2: float = num(85.0, 0.0, 1e4, "m/s2")
    """The chance that a plug arrives damaged, likewise: 0.2 % gentle, 1 % normal, 9 % fast [assumed]."""
    damage_width_m_s2: float = num(11.0, 1e-3, 1e4, "m/s2")
    """How wide that chance's rise is [assumed]."""
    plug_kg: float = num(0.050, 0.0, 0.3, "kg")
    """Mass of a seedling with its moist plug [assumed; the published payload limit is 0.3 kg]."""
    reach_m: float = num(0.004, 0.0, 0.1, "m")
    """A gripper farther than this from a cell's middle misses the plug or sets it beside the cell [assumed]."""
    illegal_s: float = num(1.0, 0.0, 600.0, "s")
    """What an action that is not possible costs [assumed]."""


@dataclass(frozen=True)
class PerceptionModel(Config):
    """What the row cameras report of a cell, as confusion matrices (see ``scripts/measure_camera.py``).

    Row = what the cell holds (empty, healthy, poor), column = report, rows sum to 1.
    """

    source: Confusion = num(..., 0.0, 1.0, "")
    """Of the source trays' cells [identified]."""
    target: Confusion = num(..., 0.0, 1.0, "")
    """Of the target trays' cells [identified]."""

    def check(self) -> None:
        """Rows are probabilities of everything that can be reported."""
        for name in ("source", "target"):
            if any(not isclose(sum(row), 1.0, abs_tol=1e-6) for row in getattr(self, name)):
                self.refuse(name, "give rows that sum to 1")

    @classmethod
    def perfect(cls) -> PerceptionModel:
        """Every cell as it is."""
        identity = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
        return cls(identity, identity)

    @classmethod
    @lru_cache(maxsize=16)
    def measured(cls, source: Tray = TRAYS[128], target: Tray = TRAYS[72]) -> PerceptionModel:
        """The fit to rendered images of these trays that ships with the package [identified].

        Of a tray that is no preset the camera is taken to see as much as of the preset with the nearest pitch.
        """
        fits = json.loads(asset_text("perception/transplanting.json"))
        matrices = []
        for name, tray, presets in (("source", source, SOURCE_TRAYS), ("target", target, TARGET_TRAYS)):
            cells = min(presets, key=lambda preset, pitch=tray.pitch_m: abs(TRAYS[preset].pitch_m - pitch))
            matrices.append(fits[name][str(cells)]["confusion"])
        return cls(*matrices)


MOST_SOURCES, MOST_ORDERS = 3, 6
"""Source trays that a carousel has room for, and target trays that can be ordered at once."""


@dataclass(frozen=True)
class OrderBook(Config):
    """Orders: each target tray wants one grade of seedlings by the time at which its lorry leaves.

    Poor seedlings are the second grade here: small or pale, sold cheaper or grown on. Source trays stand on a carousel,
    target trays on another; either brings its next tray under the arm, and a tray that comes back presents the row at
    which it left.
    """

    every_s: float = num(0.0, 0.0, 1e5, "s")
    """Between two lorries, each of which takes one tray; 0: nothing is ordered [assumed]."""
    first_s: float = num(0.0, 0.0, 1e5, "s")
    """How much later than ``every_s`` the first one leaves [assumed]."""
    second: float = num(0.5, 0.0, 1.0, "")
    """Share of the target trays that want the second grade [assumed]."""
    supply: tuple[float, float, float] = num((0.0, 0.0, 0.0), 0.0, 1.0, "")
    """Share of the second grade among the planted cells of each source tray; sowings come up unevenly [assumed]."""
    source_turn_s: float = num(2.5, 0.0, 600.0, "s")
    """The carousel brings the next source tray [assumed]."""
    target_turn_s: float = num(2.5, 0.0, 600.0, "s")
    """The other one moves on by one target tray [assumed]."""

    @property
    def on(self) -> bool:
        """Whether anything is ordered."""
        return self.every_s > 0.0


@dataclass(frozen=True)
class ScenarioConfig(Config):
    """One kind of work."""

    source: Tray = nested(...)
    """Kind of the supply's trays."""
    target: Tray = nested(...)
    """Kind of the trays to serve."""
    source_trays: int = num(..., 1, 100, "")
    """Trays of the supply; when the last row is used up there is no more."""
    target_trays: int = num(..., 1, 100, "")
    """Trays to serve in an episode."""
    replug: bool = flag(...)
    """Whether the target trays come planted, with gaps; otherwise they come empty."""
    vacancy: float = num(..., 0.0, 1.0, "")
    """Share of empty cells in planted trays [published range 0.05-0.20]."""
    poor: float = num(..., 0.0, 1.0, "")
    """Share of poor seedlings among planted cells [published range 0.02-0.08]."""
    clumped: float = num(..., 0.0, 1.0, "")
    """Share of the vacancies' (and poor seedlings') variance that neighbouring cells have in common; 0 is uniform
    [assumed]."""
    time_limit_s: float = num(..., 1e-3, 1e6, "s")
    """When an episode is cut off [assumed]."""
    drives: DriveErrors = nested(DriveErrors)
    """Errors of the two arms."""
    orders: OrderBook = nested(OrderBook)
    """What is ordered, if anything is."""

    def check(self) -> None:
        """Orders have room on the carousels, and their trays come empty."""
        if not self.orders.on:
            return
        if self.replug:
            self.refuse("replug", "ordered trays come empty: give False, or orders.every_s = 0 s for none")
        for name, most in (("source_trays", MOST_SOURCES), ("target_trays", MOST_ORDERS)):
            if getattr(self, name) > most:
                self.refuse(name, f"with orders give at most {most}, or orders.every_s = 0 s for none")

    @property
    def pairs(self) -> int:
        """Pairs (source cell, target cell) of the presented rows."""
        return self.source.columns * self.target.columns


def _fill(vacancy: float, poor: float, clumped: float) -> ScenarioConfig:
    # Two trays of the 72-cell kind from the 128-cell kind; the supply outlasts what 20 % vacancies, 8 % poor and the
    # published extraction leave of it.
    return ScenarioConfig(TRAYS[128], TRAYS[72], 2, 2, False, vacancy, poor, clumped, time_limit_s=600.0)


def _replug(vacancy: float, poor: float, clumped: float) -> ScenarioConfig:
    # Four trays of the 72-cell kind are mended from trays of the same kind.
    return ScenarioConfig(TRAYS[72], TRAYS[72], 2, 4, True, vacancy, poor, clumped, time_limit_s=600.0)


WORN = DriveErrors(rotary=RotaryDrive(encoder_rad=0.003, backlash_rad=0.0029, stiction_rad=0.0005), lag_s=0.010)
"""Arms after a season in wet peat: encoders off by the middle of the safflower paper's Table 1 [published range there:
0.001-0.005 rad], gears of 10 arc minutes, servos of 16 Hz [assumed]."""


# The tiers span the published ranges: vacancies 5-20 %, poor seedlings 2-8 %; the hardest is clumped [assumed].
SCENARIOS: dict[str, ScenarioConfig] = {
    "fill-low": _fill(0.05, 0.02, 0.0),
    "fill": _fill(0.10, 0.05, 0.0),
    "fill-high": _fill(0.20, 0.08, 0.6),
    "replug-low": _replug(0.05, 0.02, 0.0),
    "replug": _replug(0.10, 0.05, 0.0),
    "replug-high": _replug(0.20, 0.08, 0.6),
    "field": replace(_replug(0.20, 0.08, 0.6), drives=WORN),
}
"""``field`` is ``replug-high`` with a machine that has worked for a season: cells are taught once, gears wear."""

_SOWN = OrderBook(every_s=80.0, first_s=10.0, supply=(0.3, 0.7, 0.0), source_turn_s=2.5, target_turn_s=2.5)
ORDERS: dict[str, ScenarioConfig] = {
    "orders": ScenarioConfig(TRAYS[128], TRAYS[50], 2, 4, False, 0.10, 0.0, 0.0, time_limit_s=600.0, orders=_SOWN)
}
"""Four trays of the 50-cell kind, two of each grade in any order, from two trays of the 128-cell kind that came up
unevenly: some 230 seedlings for 200 cells, of which a tenth is torn or hurt on the way, and 330 s for what takes 260 s
without a detour. So a row that moves on with seedlings of the other grade is missed later, and to serve both grades
from every row takes a turn a row. Nurseries grade seedlings while they transplant them, to sell trays that stand evenly
[published: Jiangsu University's sorting and transplanting machine, Agronomy 12(11):2683, 2022; how they do it in
protected crops: Agriculture 13(8):1488, 2023]; a turn is a tray's width and gap by the conveyors' law [derived: 0.32 m
at 0.25 m/s], grades, lorries and shares are assumed."""


PRESETS = {"typical-gripper": {"process.grip_s": 0.30, "process.release_s": 0.20}}
"""``typical-gripper``: soft fingers instead of fast needles [published: vendors' 100-300 ms a stroke]."""


@dataclass(frozen=True)
class RewardWeights(Config):
    """Value of the named reward terms, in healthy cells."""

    planted: float = num(1.0, -1e3, 1e3, "")
    """For every target cell more (or less) that holds a healthy seedling."""
    spoiled: float = num(-0.2, -1e3, 1e3, "")
    """For every healthy seedling that was torn, lost, damaged, or sent away with its row [assumed]."""
    seconds: float = num(-0.2, -1e3, 1e3, "1/s")
    """For every second; a cell a 1.5 s earns 0.67 a second, time is charged at about a third of that [assumed]."""


@dataclass(frozen=True)
class TransplantingConfig(Config):
    """Everything that defines a transplanting task."""

    scenario: ScenarioConfig = nested(SCENARIOS["fill"])
    """The kind of work."""
    machine: MachineConfig = nested(MachineConfig)
    """The arm and the conveyors."""
    process: ProcessConfig = nested(ProcessConfig)
    """Gripping, carrying and setting a plug."""
    weights: RewardWeights = nested(RewardWeights)
    """What the reward counts."""

    def check(self) -> None:
        """Every cell lies in the arm's window."""
        right = self.machine.arm.window_m[1][0]
        for name in ("source", "target"):
            kind: Tray = getattr(self.scenario, name)
            outermost = self.machine.tray_centre_m + 0.5 * (kind.columns - 1) * kind.pitch_m
            if outermost > right + 1e-9:
                self.refuse(
                    "machine.tray_centre_m",
                    f"the {name} tray's outermost cell stands {outermost:.3f} m from the middle, the arm reaches "
                    f"{right:.3f} m: reduce it",
                )
