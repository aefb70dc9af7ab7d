"""Command the sorter random motions and hold every one to the mechanism's limits.

    python scripts/check_sorter_motions.py [--motions 10000] [--seed 0]

Half are free motions between random poses, some of them beyond reach, along a quintic law with the orientation turned
on SO(3). The machine refuses those that leave the workspace on the way; the limit that it names is confirmed with the
mechanism's own margins, and the ends alone are looked at too: how many refused motions would have passed by their ends.
Half are picks as the task plans them, from worlds in which a random policy works; none of these may be refused. What
is not refused is simulated, and after every step the margins of the platform's real pose and of the real sliders are
taken.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
import typer

from fieldgym.agents.policies.base import RandomPolicy
from fieldgym.envs.core import NominalExecutor
from fieldgym.envs.sorting.config import SCENARIOS, PerceptionModel, SortingConfig
from fieldgym.envs.sorting.core import SortingCore
from fieldgym.envs.sorting.motions import PickMotion
from fieldgym.envs.sorting.state import PICK
from fieldgym.mechanisms.errors import UnreachablePoseError
from fieldgym.motion import QUINTIC
from fieldgym.motion.orientation import angle_between, euler_angles, slerp, tilted
from fieldgym.simulation.sorter import SorterMachine
from fieldgym.simulation.sorter_limits import first_violation
from fieldgym.simulation.sorter_model import SorterParameters

LENGTH_TOLERANCE_M, ANGLE_TOLERANCE_RAD = 1e-4, np.deg2rad(0.05)
"""A real pose may pass a limit by what the closed loops leave of the command."""
TOLERANCE = {"cone": ANGLE_TOLERANCE_RAD, "platform": 1e-3}


@dataclass
class Tally:
    """What came of the motions."""

    free: int = 0
    picks: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    refused_on_the_way: int = 0
    refused_picks: int = 0
    unconfirmed: int = 0
    simulated: int = 0
    violations: list[str] = field(default_factory=list)
    worst_m: float = 0.0
    saturated: int = 0


def free_motion(parameters: SorterParameters, rng: np.random.Generator) -> np.ndarray:
    """Poses (n, 6) of a motion between two random poses at the machine's limits."""
    ends = []
    for _ in range(2):
        radius, angle = 0.21 * np.sqrt(rng.random()), 2.0 * np.pi * rng.random()
        place = np.array([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(0.0, 0.095)])
        turn = tilted(np.deg2rad(rng.uniform(0.0, 22.0)), 2.0 * np.pi * rng.random(), np.deg2rad(rng.uniform(-60, 60)))
        ends.append((place, turn))
    (start, start_turn), (end, end_turn) = ends
    linear = QUINTIC.duration(np.linalg.norm(end - start), parameters.velocity_m_s, parameters.acceleration_m_s2)
    angular = QUINTIC.duration(angle_between(start_turn, end_turn), parameters.turn_rad_s, parameters.turn_rad_s2)
    duration_s = max(float(linear), float(angular))
    time = np.arange(int(np.ceil(duration_s * parameters.physics_hz)) + 1) / parameters.physics_hz
    share = QUINTIC.sample(time, 1.0, duration_s).position
    return np.column_stack([start + share[:, None] * (end - start), euler_angles(slerp(start_turn, end_turn, share))])


def pick_motions(count: int, seed: int, physics_hz: float, worlds: int = 16) -> list[np.ndarray]:
    """Poses of picks that a random policy makes in every scenario, half of them with an empty grip."""
    motions: list[np.ndarray] = []
    policy, number = RandomPolicy(seed), 0
    while len(motions) < count:
        name = list(SCENARIOS)[number % len(SCENARIOS)]
        core = SortingCore(SortingConfig(scenario=SCENARIOS[name]), PerceptionModel.measured(), worlds)
        executor = NominalExecutor(core)
        rows = np.arange(worlds)
        core.reset_rows(rows, [np.random.default_rng([seed, number, int(row)]) for row in rows])
        for _ in range(60):
            plan = core.plan(policy.act(core.observe()))
            outcome = executor.execute(plan)
            for row in np.flatnonzero(plan.kind == PICK)[: max(count - len(motions), 0)]:
                motion, held = PickMotion(core.config, plan, int(row)), bool(outcome.grip.held[row])
                steps = np.arange(int(np.ceil(motion.duration_s(held) * physics_hz)) + 1)
                motions.append(motion.sample(steps / physics_hz, held).poses())
            core.apply(plan, outcome)
        number += 1
    return motions


def hold_to_limits(machine: SorterMachine, poses: np.ndarray, tally: Tally, pick: bool) -> None:
    """Command one motion and count what comes of it."""
    mechanism = machine.parameters.mechanism
    try:
        machine.reset(poses[0])
        real: list[np.ndarray] = []
        sliders: list[np.ndarray] = []

        def watch(row: int) -> None:
            position, quaternion = machine.platform()
            real.append(np.concatenate([position, euler_angles(quaternion)]))
            sliders.append(machine.joints()[:3])

        report = machine.run(poses, watch)
    except UnreachablePoseError as error:
        found = first_violation(mechanism, poses)
        tally.refused[error.limit] += 1
        tally.refused_picks += pick
        margins = mechanism.margins(poses[found.sample]) if found is not None else {}
        tally.unconfirmed += not margins or not float(margins[error.limit]) < 0.0
        tally.refused_on_the_way += first_violation(mechanism, poses[[0, -1]]) is None
        return
    tally.simulated += 1
    tally.saturated += bool(report.saturated.any())
    if not real:
        return
    for limit, values in mechanism.margins(np.array(real)).items():
        tolerance = next((t for name, t in TOLERANCE.items() if limit.startswith(name)), LENGTH_TOLERANCE_M)
        if float(values.min()) < -tolerance:
            tally.violations.append(f"{limit} {float(values.min()):.2e}")
    low, high = mechanism.slider_range_m
    beyond = max(low - float(np.min(sliders)), float(np.max(sliders)) - high)
    if beyond > LENGTH_TOLERANCE_M:
        tally.violations.append(f"slider by {beyond:.2e} m")
    tally.worst_m = max(tally.worst_m, float(np.linalg.norm(np.array(real)[:, :3] - poses[1:, :3], axis=1).max()))


def check(motions: int, seed: int) -> Tally:
    """Command ``motions`` motions."""
    tally, rng = Tally(), np.random.default_rng(seed)
    with SorterMachine() as machine:
        picks = pick_motions(motions // 2, seed, machine.parameters.physics_hz)
        for poses in picks:
            tally.picks += 1
            hold_to_limits(machine, poses, tally, True)
        for _ in range(motions - len(picks)):
            tally.free += 1
            hold_to_limits(machine, free_motion(machine.parameters, rng), tally, False)
    return tally


def main(motions: Annotated[int, typer.Option(min=2)] = 10_000, seed: int = 0) -> None:
    """Command the sorter random motions and hold every one to the mechanism's limits."""
    tally = check(motions, seed)
    print(f"{tally.free} free motions, {tally.picks} picks; simulated {tally.simulated}")
    print(f"refused {sum(tally.refused.values())}: {dict(tally.refused.most_common())}")
    print(f"  within the limits at both ends, but not on the way: {tally.refused_on_the_way}")
    print(f"  picks refused: {tally.refused_picks}; named limit not confirmed by margins: {tally.unconfirmed}")
    print(f"limits broken in simulation: {len(tally.violations)} {tally.violations[:5]}")
    print(f"largest distance from the command {1e3 * tally.worst_m:.3f} mm; saturated motors in {tally.saturated}")
    if tally.violations or tally.unconfirmed or tally.refused_picks:
        raise SystemExit(1)


if __name__ == "__main__":
    typer.run(main)
