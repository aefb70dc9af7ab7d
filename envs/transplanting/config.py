"""Numbers of the tray transplanter: machine, conveyors, process, perception and scenario tiers.

Every number says where it comes from: [published] printed by a source, [identified] fitted to rendered images,
[assumed] a free choice. "The paper" is Qi, Hu, Ma, Zhang, CCTA 2011, 10.1007/978-3-642-27275-2_11.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.resources import files
from math import inf, isclose
from typing import Literal

from ...mechanisms import TranslationalFiveBar
from ...motion import GATE_STYLES, Gate

SPEEDS = ("gentle", "normal", "fast")
REPORTS = ("empty", "healthy", "poor")
EMPTY, HEALTHY, POOR, DAMAGED = range(4)
"""What a cell holds; a camera tells the first three apart."""

Motion = Literal["stop-quintic", "stop-septic", "stop-fastest", "blended", "time-optimal"]
MOTIONS: tuple[Motion, ...] = GATE_STYLES


def _require(owner: object, low: float, *names: str, high: float = inf) -> None:
    for name in names:
        value = getattr(owner, name)
        if not low <= value <= high:
            raise ValueError(f"{type(owner).__name__}.{name} = {value}: allowed range [{low}, {high}]")


@dataclass(frozen=True)
class Tray:
    """A tray of 540 x 280 mm [published: vendors' pages] that travels lengthwise, so that its short rows are served.

    Attributes:
        rows: rows along the direction of travel.
        columns: cells of a row, across it.
        pitch_m: distance of neighbouring cells both ways, from the published cell counts.
    """

    rows: int
    columns: int
    pitch_m: float
    length_m: float = 0.540
    width_m: float = 0.280

    def __post_init__(self) -> None:
        """Check that the cells fit the tray."""
        _require(self, 1, "rows", "columns")
        _require(self, 1e-3, "pitch_m", "length_m", "width_m")
        for name, cells, room in (("rows", self.rows, self.length_m), ("columns", self.columns, self.width_m)):
            if cells * self.pitch_m > room + 1e-9:
                raise ValueError(f"{name} = {cells} at {1e3 * self.pitch_m:.0f} mm do not fit {1e3 * room:.0f} mm")

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
    if cells not in allowed:
        raise ValueError(f"{name} = {cells!r} cells: choose one of {', '.join(map(str, allowed))}")
    return TRAYS[cells]


@dataclass(frozen=True)
class MachineConfig:
    """The arm and the two conveyors under it.

    The arm's working rectangle is 600 mm wide, a tray 540 x 280 mm: two trays fit side by side only with their short
    sides across, so a presented row is one of a tray's short rows.
    """

    arm: TranslationalFiveBar = field(default_factory=TranslationalFiveBar.transplanter)
    """Geometry and masses; its ``window_m`` is the published 600 x 150 mm."""
    motion: Motion = "stop-quintic"
    """How gates are carried out [published: the paper chooses the quintic with stops at the corners]."""
    velocity_m_s: float = 4.5
    """Limit of the tool [published]."""
    acceleration_m_s2: float = 60.0
    """Limit of the tool, used whenever the gripper is empty [published]."""
    carry_acceleration_m_s2: tuple[float, float, float] = (15.0, 35.0, 60.0)
    """Limit with a plug in the gripper: gentle, normal, fast [assumed; fast is the published limit]."""
    lift_m: float = 0.150
    """Height of every gate: a plug has to pass over its neighbours' leaves [published: workspace height]."""
    straight_m: float = 0.050
    """Straight rise and fall at a gate's ends, the depth of a cell [assumed: the paper prints no length]."""
    corner_radius_m: float = inf
    """Largest corner radius of ``motion="blended"`` [assumed: as large as the straight pieces leave]."""
    tray_centre_m: float = 0.160
    """Distance of either tray's middle from the machine's; 40 mm between the trays are the chute [assumed]."""
    conveyor_velocity_m_s: float = 0.25
    conveyor_acceleration_m_s2: float = 1.5
    """Limits of the conveyors; plugs must not tip [assumed]."""
    conveyor_settle_s: float = 0.10
    """Wait after a conveyor has moved [assumed]."""
    tray_gap_m: float = 0.040
    """Between a tray and the next one on the same conveyor [assumed]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.motion not in MOTIONS:
            raise ValueError(f"motion = {self.motion!r} is unknown: choose one of {', '.join(map(repr, MOTIONS))}")
        positive = ("velocity_m_s", "acceleration_m_s2", "conveyor_velocity_m_s", "conveyor_acceleration_m_s2")
        _require(self, 1e-6, *positive, "corner_radius_m")
        _require(self, 0.0, "conveyor_settle_s", "tray_gap_m", "tray_centre_m")
        (left, bottom), (right, top) = self.arm.window_m
        _require(self, 0.0, "lift_m", high=top - bottom + 1e-9)
        _require(self, 0.0, "straight_m", high=self.lift_m)
        if not isclose(left, -right):
            raise ValueError(f"arm.window_m = {self.arm.window_m}: give a rectangle that is even about x = 0")
        limits = self.carry_acceleration_m_s2
        if len(limits) != len(SPEEDS) or not 0.0 < min(limits) <= max(limits) <= self.acceleration_m_s2:
            raise ValueError(
                f"carry_acceleration_m_s2 = {limits}: give {len(SPEEDS)} values in (0, {self.acceleration_m_s2}], "
                f"one a speed {SPEEDS}"
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
class ProcessConfig:
    """Gripping, carrying and setting a plug."""

    grip_s: float = 0.15
    """Needles go in and close, pneumatic [assumed]."""
    release_s: float = 0.10
    """Needles open and draw back, pneumatic [assumed]."""
    extraction: float = 0.9605
    """Chance that a plug leaves its cell whole [published: 96.05 % in the field, s41598-025-86421-0]."""
    loss_half_m_s2: float = 105.0
    loss_width_m_s2: float = 13.0
    """Chance to lose a plug on the way: logistic in the carrying acceleration, one half at the first number; 0.1 %
    gentle, 0.5 % normal, 3 % fast [assumed]."""
    damage_half_m_s2: float = 85.0
    damage_width_m_s2: float = 11.0
    """Chance that a plug arrives damaged, likewise; 0.2 % gentle, 1 % normal, 9 % fast [assumed]."""
    plug_kg: float = 0.050
    """Mass of a seedling with its moist plug [assumed; the published payload limit is 0.3 kg]."""
    reach_m: float = 0.004
    """A gripper farther than this from a cell's middle misses the plug or sets it beside the cell [assumed]."""
    illegal_s: float = 1.0
    """What an action that is not possible costs [assumed]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        _require(self, 0.0, "plug_kg", high=0.3)
        _require(self, 0.0, "grip_s", "release_s", "reach_m", "illegal_s", "loss_half_m_s2", "damage_half_m_s2")
        _require(self, 1e-3, "loss_width_m_s2", "damage_width_m_s2")
        _require(self, 0.0, "extraction", high=1.0)


@dataclass(frozen=True)
class PerceptionModel:
    """What the row cameras report of a cell, as confusion matrices (see ``scripts/measure_tray_camera.py``)."""

    source: tuple[tuple[float, ...], ...]
    target: tuple[tuple[float, ...], ...]
    """Row = what the cell holds (empty, healthy, poor), column = report, rows sum to 1."""

    def __post_init__(self) -> None:
        """Check the shapes and sums."""
        for name in ("source", "target"):
            matrix = getattr(self, name)
            if len(matrix) != 3 or any(len(row) != 3 or not isclose(sum(row), 1.0, abs_tol=1e-6) for row in matrix):
                raise ValueError(f"{name} = {matrix}: give 3 x 3 probabilities whose rows sum to 1")

    @classmethod
    def perfect(cls) -> PerceptionModel:
        """Every cell as it is."""
        identity = tuple(tuple(float(i == j) for j in range(3)) for i in range(3))
        return cls(identity, identity)

    @classmethod
    @lru_cache(maxsize=16)
    def measured(cls, source: Tray = TRAYS[128], target: Tray = TRAYS[72]) -> PerceptionModel:
        """The fit to rendered images of these trays that ships with the package [identified].

        Of a tray that is no preset the camera is taken to see as much as of the preset with the nearest pitch.
        """
        text = files(__name__.rsplit(".", 3)[0]).joinpath("assets/perception/transplanting.json").read_text("utf-8")
        matrices = []
        for name, tray, presets in (("source", source, SOURCE_TRAYS), ("target", target, TARGET_TRAYS)):
            cells = min(presets, key=lambda preset, pitch=tray.pitch_m: abs(TRAYS[preset].pitch_m - pitch))
            confusion = json.loads(text)[name][str(cells)]["confusion"]
            matrices.append(tuple(tuple(row) for row in confusion))
        return cls(*matrices)


@dataclass(frozen=True)
class ScenarioConfig:
    """One kind of work."""

    source: Tray
    target: Tray
    source_trays: int
    """Trays of the supply; when the last row is used up there is no more."""
    target_trays: int
    """Trays to serve in an episode."""
    replug: bool
    """Whether the target trays come planted, with gaps; otherwise they come empty."""
    vacancy: float
    """Share of empty cells in planted trays [published range 0.05-0.20]."""
    poor: float
    """Share of poor seedlings among planted cells [published range 0.02-0.08]."""
    clumped: float
    """Share of the vacancies' (and poor seedlings') variance that neighbouring cells have in common; 0 is uniform."""
    time_limit_s: float

    def __post_init__(self) -> None:
        """Check the ranges."""
        _require(self, 1, "source_trays", "target_trays")
        _require(self, 0.0, "vacancy", "poor", "clumped", high=1.0)
        _require(self, 1e-3, "time_limit_s")

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


# The tiers span the published ranges: vacancies 5-20 %, poor seedlings 2-8 %; the hardest is clumped [assumed].
SCENARIOS: dict[str, ScenarioConfig] = {
    "fill-low": _fill(0.05, 0.02, 0.0),
    "fill": _fill(0.10, 0.05, 0.0),
    "fill-high": _fill(0.20, 0.08, 0.6),
    "replug-low": _replug(0.05, 0.02, 0.0),
    "replug": _replug(0.10, 0.05, 0.0),
    "replug-high": _replug(0.20, 0.08, 0.6),
}


@dataclass(frozen=True)
class RewardWeights:
    """Value of the named reward terms, in healthy cells."""

    planted: float = 1.0
    """For every target cell more (or less) that holds a healthy seedling."""
    spoiled: float = -0.2
    """For every healthy seedling that was torn, lost, damaged, or sent away with its row [assumed]."""
    seconds: float = -0.2
    """A cell a 1.5 s earns 0.67 a second; time is charged at about a third of that [assumed]."""


@dataclass(frozen=True)
class TransplantingConfig:
    """Everything that defines a transplanting task."""

    scenario: ScenarioConfig = SCENARIOS["fill"]
    machine: MachineConfig = field(default_factory=MachineConfig)
    process: ProcessConfig = field(default_factory=ProcessConfig)
    weights: RewardWeights = field(default_factory=RewardWeights)

    def __post_init__(self) -> None:
        """Check that every cell lies in the arm's window."""
        right = self.machine.arm.window_m[1][0]
        for name in ("source", "target"):
            kind: Tray = getattr(self.scenario, name)
            outermost = self.machine.tray_centre_m + 0.5 * (kind.columns - 1) * kind.pitch_m
            if outermost > right + 1e-9:
                raise ValueError(
                    f"the {name} tray's outermost cell stands {outermost:.3f} m from the middle, the arm reaches "
                    f"{right:.3f} m: reduce tray_centre_m"
                )
