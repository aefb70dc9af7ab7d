"""Poses a second: inverse and forward kinematics of every mechanism, and what numeric solvers make of them."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from fieldgym.mechanisms import FiveBar, ThreePRRS, ThreeUPSRPU, TranslationalFiveBar
from fieldgym.scripts.speed_lines import Line, best_of

BATCH = 1_000_000
"""Poses of an inverse batch."""
MILLION = "M/s"
"""Million poses a second."""


def kinematics(quick: bool) -> Iterator[Line]:
    """Every mechanism on a million poses of its working box, then numeric solvers on one leg of the five-bar."""
    batched: dict[str, float] = {}
    for name, machine, poses, target in _mechanisms():
        joints = machine.inverse(poses)
        batched[name] = len(poses) / best_of(lambda m=machine, p=poses: m.inverse(p), 3 if quick else 9) / 1e6
        yield Line(f"{name} inverse, batch", batched[name], MILLION, target, note="10^6 poses")
        for kind, pose in (("array", poses[0].copy()), ("list", poses[0].tolist())):
            rate = _rate(lambda m=machine, p=pose: m.inverse(p), 2_000, quick)
            yield Line(f"{name} inverse, one {kind}", rate, MILLION, 1.0)
        few = joints[: len(joints) if isinstance(machine, (FiveBar, TranslationalFiveBar)) else 5_000]
        rest = (machine.home_pose,) if isinstance(machine, ThreeUPSRPU) else ()
        seconds = best_of(lambda m=machine, j=few, r=rest: m.forward(j, *r), 2 if quick else 3)
        yield Line(f"{name} forward, batch", len(few) / seconds / 1e6, MILLION, note=f"{len(few):,} poses")
        rate = _rate(lambda m=machine, j=few[0], r=rest: m.forward(j, *r), 20, quick)
        yield Line(f"{name} forward, one", rate, MILLION)
    yield from _in_a_kernel(quick)
    numeric = _pybullet_rate(100 if quick else 400) / 1e6
    yield Line("PyBullet's numeric inverse, one leg", numeric, MILLION)
    yield Line("five-bar batch to PyBullet's", batched["five-bar"] / numeric, "x", 1_000.0)
    newton = _pinocchio_rate(50 if quick else 200)
    if newton is not None:
        yield Line("Pinocchio, Newton steps, one leg", newton / 1e6, MILLION)
        yield Line("five-bar batch to Pinocchio", batched["five-bar"] / newton * 1e6, "x")


def _rate(call: Any, calls: int, quick: bool) -> float:
    """Million calls a second."""
    return calls / best_of(lambda: [call() for _ in range(calls)], 5 if quick else 15) / 1e6


def _mechanisms() -> Iterator[tuple[str, Any, np.ndarray, float | None]]:
    """Name, machine, poses spread over its working box, and million poses a second that its inverse should reach."""
    generator = np.random.default_rng(0)

    def spread(low: Any, high: Any) -> np.ndarray:
        return generator.uniform(low, high, (BATCH, len(low)))

    bar, tilt = FiveBar.safflower(), np.deg2rad(14.0)
    inside = bar.workspace(samples=20_000).points
    yield "five-bar", bar, spread(inside.min(axis=0), inside.max(axis=0)), 60.0
    yield "transplanter", TranslationalFiveBar.transplanter(), spread([-0.3, -0.66], [0.3, -0.51]), 60.0
    yield "3UPS-RPU", ThreeUPSRPU.weeder(), spread([-0.1, 0.5, -tilt, -tilt], [0.1, 0.7, tilt, tilt]), 40.0
    low, high = [-0.1, -0.1, 0.0, -0.2, -0.2, -0.7], [0.1, 0.1, 0.1, 0.2, 0.2, 0.7]
    yield "3-PRRS", ThreePRRS.sorter(), spread(low, high), 25.0


def _in_a_kernel(quick: bool) -> Iterator[Line]:
    """What a kernel pays that asks for one pose after the other, each depending on the one before."""
    from fieldgym.kernels import compiled
    from fieldgym.mechanisms.two_legs_kernels import inverse_of_one

    @compiled
    def walk(pose: np.ndarray, legs: np.ndarray, angles: np.ndarray, count: int) -> float:
        total = 0.0
        for _ in range(count):
            pose[0] += 1e-12 * angles[0]
            inverse_of_one(pose, legs, angles)
            total += angles[1]
        return total

    bar = FiveBar.safflower()
    pose, angles = np.array([0.29, -0.40]), np.zeros(2)
    seconds = best_of(lambda: walk(pose, bar._numbers, angles, 100_000), 3 if quick else 9)
    yield Line("five-bar inverse, one, in a kernel", 0.1 / seconds, MILLION, 1.0)


def _pybullet_rate(calls: int) -> float:
    """Poses a second of PyBullet's numeric inverse on one leg; the closed loop would need two and their match."""
    from fieldgym.simulation.client import pybullet
    from fieldgym.simulation.picker import PickerMachine

    with PickerMachine() as machine:
        link = pybullet.getNumJoints(machine.body_id, physicsClientId=machine.client.id) - 1
        target = machine.tool_world()

        def solve() -> None:
            for i in range(calls):
                pybullet.calculateInverseKinematics(
                    machine.body_id, link, target + 1e-4 * (i % 7), physicsClientId=machine.client.id
                )

        return calls / best_of(solve, 3)


def _pinocchio_rate(calls: int) -> float | None:
    """Poses a second of damped Newton steps with Pinocchio on one leg of the picker; None where it is not installed."""
    try:
        pinocchio: Any = importlib.import_module("pinocchio")
    except ImportError:
        return None
    from fieldgym.simulation.assets import asset_path

    with asset_path("urdf/picker/picker.urdf") as path:
        model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    frame = model.getFrameId("forearm1", pinocchio.FrameType.BODY)
    tip = pinocchio.SE3(np.eye(3), np.array([0.0, FiveBar.safflower().forearm_m[0], 0.0]))
    # A turning joint may count as cosine and sine: poses are reached by turning, not by writing angles.
    turn = np.zeros(model.nv)
    turn[model.joints[model.getJointId("arm1")].idx_v] = -2.0
    turn[model.joints[model.getJointId("forearm1")].idx_v] = 1.2
    start = pinocchio.integrate(model, pinocchio.neutral(model), turn)
    pinocchio.framesForwardKinematics(model, data, start)
    home = (data.oMf[frame] * tip).translation.copy()

    def solve() -> None:
        for i in range(calls):
            q = start.copy()
            target = home + np.array([0.0, 0.02, 0.01 * (i % 5)])
            for _ in range(50):
                pinocchio.computeJointJacobians(model, data, q)
                pinocchio.updateFramePlacements(model, data)
                placed = data.oMf[frame] * tip
                gap = target - placed.translation
                if np.linalg.norm(gap) < 1e-9:
                    break
                full = pinocchio.getFrameJacobian(model, data, frame, pinocchio.LOCAL_WORLD_ALIGNED)
                arm = placed.translation - data.oMf[frame].translation
                jacobian = full[:3] - np.cross(arm, full[3:].T).T
                step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-9 * np.eye(3), gap)
                q = pinocchio.integrate(model, q, step)

    return calls / best_of(solve, 3)
