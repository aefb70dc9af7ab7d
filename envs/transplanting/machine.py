"""The machine in PyBullet that carries a transplanting plan out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...motion import QUINTIC, PathMotion, StoppedPath
from ...simulation.motion_result import Rest
from ...simulation.transplanter import GateResult, TransplanterMachine
from ..core import Array
from ..driven import RECOVERY_S, Driven
from .columns import E, P
from .config import TransplantingConfig
from .core import TransplantingCore, TransplantOutcome
from .errors import EMPTY_HANDED
from .rules import INDEX_SOURCE, NOTHING, TransplantPlan
from .timing import Places, above, gate_motion

_REST = Rest(tolerance_m=5e-4, limit_s=0.3, wait_s=0.010)


class Move(NamedTuple):
    """One gate of a decision.

    Attributes:
        start: place, see ``Places``.
        end: place.
        limit: speed index of the acceleration limit, or ``EMPTY_HANDED``.
        phase: ``P.travel`` or ``P.carry``.
        loaded: whether something is in the gripper.
        then: what the gripper does at the end: ``"grip"``, ``"release"``, ``"miss"`` or nothing.
    """

    start: int
    end: int
    limit: int
    phase: int
    loaded: bool
    then: str


class Trajectories:
    """Gates between the places of a configuration in the arm's plane, planned and sampled once each."""

    def __init__(self, config: TransplantingConfig, places: Places):
        """Take places, level and limits from the configuration."""
        machine = config.machine
        (_, bottom), _ = machine.arm.window_m
        self.level_m = bottom + machine.lift_m
        self.points = np.column_stack([places.x_m, bottom + places.height_m])
        limits = *machine.carry_acceleration_m_s2, machine.acceleration_m_s2
        self._gates = [machine.gate(limit) for limit in limits]
        self._known: dict[tuple[int, int, int], StoppedPath | PathMotion] = {}
        self._sampled: dict[tuple[int, int, int, float], Array] = {}

    def motion(self, move: Move) -> StoppedPath | PathMotion:
        """The timed gate of a move."""
        key = move.start, move.end, move.limit
        if key not in self._known:
            start, end = self.points[move.start], self.points[move.end]
            self._known[key] = gate_motion(self._gates[move.limit], start, end, self.level_m)
        return self._known[key]

    def samples(self, move: Move, step_s: float) -> tuple[Array, float]:
        """Positions (n, 2) of a move, ``step_s`` apart from its start until it is over, and its duration."""
        motion, key = self.motion(move), (move.start, move.end, move.limit, step_s)
        if key not in self._sampled:
            steps = int(np.ceil(motion.duration_s / step_s - 1e-9))
            self._sampled[key] = motion.sample(step_s * np.arange(steps + 1)).position
        return self._sampled[key], motion.duration_s


class PyBulletTransplanter(Driven[TransplantPlan, TransplantOutcome]):
    """Executor that drives the closed-loop machine of one world.

    The machine moves in PyBullet; while it stands still (gripping, indexing) time passes without steps.
    """

    def __init__(self, core: TransplantingCore):
        """Build the machine for the rules' single world."""
        super().__init__(core.worlds)
        self._core = core
        self._machine = TransplanterMachine(core.config.machine.parameters)
        self._trajectories = Trajectories(core.config, core.places)
        self._plug_kg = core.config.process.plug_kg

    def place(self) -> None:
        """Put the machine where the rules say it stands."""
        self._machine.carry(0.0)
        self._machine.reset(self._trajectories.points[self._core.state.place[0]])

    def drive(self, plan: TransplantPlan) -> TransplantOutcome:
        """Drive the gates and say how long they took and where the tool came to rest."""
        phases = plan.phases_s.copy()
        errors = self._core.nominal(plan).error_m
        n = self._core.source_shape[1]
        for move in moves(self._core, plan):
            self._machine.carry(self._plug_kg if move.loaded else 0.0)
            moved_s, nominal_s, error_m = self._drive(move)
            phases[0, move.phase] += moved_s - nominal_s
            if move.then:
                errors[0, E.target if move.end >= n else E.source] = error_m
        return TransplantOutcome(phases, errors)

    def _drive(self, move: Move) -> tuple[float, float, float]:
        """Simulated and nominal seconds of a move, and the tool's distance from its end."""
        core, step_s, wanted = self._core, self._machine.client.step_s, None
        positions, nominal_s = self._trajectories.samples(move, step_s)
        if core.errs:
            error = core.place_error(np.array(move.end), np.array(move.limit), core.drive_luck[0])
            share = QUINTIC.sample(step_s * np.arange(len(positions)), 1.0, nominal_s).position
            wanted, positions = positions[-1], self.erring(positions, share, error)
        report: GateResult = self._machine.run(positions)
        still = np.repeat(positions[-1:], _REST.steps(self._machine.client.step_s), axis=0)
        report, moved_s = _REST.wait(report, report.duration_s, nominal_s, lambda: self._machine.run(still))
        if not self.arrived(report.final_error_m, report.saturated):
            # The next gate of the decision begins where this one should have ended.
            self._machine.reset(positions[-1])
            moved_s += RECOVERY_S
        error_m = report.final_error_m if wanted is None else float(np.linalg.norm(report.final_tool_m - wanted))
        return moved_s, nominal_s, error_m

    def missed(self, plan: TransplantPlan) -> TransplantOutcome:
        """The tool stayed where it was, far from every cell."""
        phases = plan.phases_s.copy()
        phases[0, P.travel] += RECOVERY_S
        return TransplantOutcome(phases, np.full((1, len(E)), np.inf))


def moves(core: TransplantingCore, plan: TransplantPlan, row: int = 0) -> list[Move]:
    """The gates of one world's decision, in order."""
    kind, start = int(plan.kind[row]), int(plan.start[row])
    park = core.places.park
    if kind == NOTHING:
        return []
    if kind >= INDEX_SOURCE:
        end = above(core.times, start)
        return [Move(start, end, EMPTY_HANDED, P.travel, False, "")] if end != start else []
    source, target = core.cells_of_pair(int(plan.pair[row]))
    legs: list[Move] = []
    here = start
    if plan.clears[row]:
        legs.append(Move(here, target, EMPTY_HANDED, P.travel, False, "grip"))
        legs.append(Move(target, park, EMPTY_HANDED, P.travel, True, "release"))
        here = park
    gripped = "grip" if plan.grips[row] else "miss"
    legs.append(Move(here, source, EMPTY_HANDED, P.travel, False, gripped))
    if plan.grips[row]:
        legs.append(Move(source, target, kind, P.carry, True, "release"))
    # Where the tool stands already there is no gate to drive.
    return [leg for leg in legs if leg.start != leg.end]
