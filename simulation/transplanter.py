"""The tray transplanter in PyBullet: a closed translational five-bar under a fixed portal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..mechanisms.batching import as_points
from ..motion import Gate
from .assembly import transplanter_assembly
from .client import pybullet
from .machine import LoopMachine
from .motion_result import MotionResult
from .transplanter_model import (
    JOINTS,
    PHYSICS_ASSET,
    TransplanterParameters,
    transplanter_joints,
)

Array = NDArray[np.float64]

MOTORS = ("arm1", "arm2")
_DRIVEN = [JOINTS.index(name) for name in MOTORS]

_SOLVER_ITERATIONS = 12
"""Two closures on light links: more sweeps change the tracking error by less than 0.01 mm."""


@dataclass(frozen=True)
class GateResult(MotionResult):
    """What a motion of the transplanter did.

    Attributes as ``MotionResult``, and:
        final_tool_m: tool (x, y) in the mechanism's plane, (2,).
        tracking_error_m: largest distance of the tool from its command.
        torque_n_m: torques that the motors applied, (steps, 2) when measured, else (1, 2).
    """

    final_tool_m: Array
    tracking_error_m: float
    torque_n_m: Array


class TransplanterMachine(LoopMachine):
    """Two two-link legs and a level platform with a gripper, closed by two point-to-point constraints.

    Tool positions are (x, y) of ``TranslationalFiveBar``. The arm's plane stands across the conveyors at x = 0 of the
    world: the mechanism's x is the world's y, its y is the height over the motor axes.

    Attributes as ``LoopMachine``.
    """

    numbers = TransplanterParameters
    world: ClassVar = {"solver_iterations": _SOLVER_ITERATIONS}
    parameters: TransplanterParameters

    def _build(self) -> None:
        """With the tool in the middle of its window's lower edge."""
        p = self.parameters
        self._build_tree(PHYSICS_ASSET, transplanter_assembly(p))
        self._order = [JOINTS.index(name) for name in self._machine.joints]
        self._payload_kg = 0.0
        joints = range(pybullet.getNumJoints(self.body_id, physicsClientId=self.client.id))
        infos = [pybullet.getJointInfo(self.body_id, joint, physicsClientId=self.client.id) for joint in joints]
        self._platform = next(info[0] for info in infos if info[12] == b"platform")
        (left, bottom), (right, _) = p.arm.window_m
        self.reset([0.5 * (left + right), bottom])

    def reset(self, tool: ArrayLike) -> None:
        """Put all joints where the kinematics says, at rest, and have the motors hold them there.

        Raises:
            UnreachablePoseError: the tool position (2,) is beyond the reach of a leg.
        """
        joints = transplanter_joints(self.parameters, as_points(tool, 2, "tool").reshape(1, 2))[0]
        self._machine.reset(joints[self._order])
        self._machine.hold(joints[_DRIVEN])

    def carry(self, payload_kg: float) -> None:
        """Change what the gripper holds; it counts as a point on the platform.

        Raises:
            ValueError: the mass is negative.
        """
        if not payload_kg >= 0.0:
            raise ValueError(f"payload_kg = {payload_kg}: give a mass >= 0")
        if payload_kg == self._payload_kg:
            return
        masses = self.parameters.arm.masses
        assert masses is not None
        link = self._platform
        info = pybullet.getDynamicsInfo(self.body_id, link, physicsClientId=self.client.id)
        pybullet.changeDynamics(
            self.body_id,
            link,
            mass=masses.platform_kg + payload_kg,
            localInertiaDiagonal=info[2],
            physicsClientId=self.client.id,
        )
        self._payload_kg = payload_kg

    def run(
        self, tool: ArrayLike, on_step: Callable[[int], None] | None = None, *, measure: bool = False
    ) -> GateResult:
        """Drive the machine along a trajectory that is sampled at ``physics_hz`` and starts where it stands.

        Args:
            tool: (n, 2), metres; n - 1 steps are simulated.
            on_step: called after every step with the number of the row that was reached.
            measure: look at every step instead of the last one; several times slower.

        Raises:
            ValueError: shapes do not fit, the first row is elsewhere, or the client runs at another rate.
            UnreachablePoseError: a row is beyond the reach of a leg.
        """
        tools = self._trajectory(tool)
        targets = transplanter_joints(self.parameters, tools)[:, _DRIVEN]
        self._require_start(float(np.linalg.norm(tools[0] - self.tool())))
        tracking, closure = [0.0], [0.0]
        torques: list[Array] = []

        def look(row: int) -> None:
            tracking.append(float(np.linalg.norm(self.tool() - tools[row])))
            closure.append(self._machine.closure_error_m())
            torques.append(self._machine.motor_efforts())

        duration_s = self._follow(targets, look, on_step, measure)
        reached = self.tool()
        efforts = np.array(torques)
        return GateResult(
            duration_s=duration_s,
            final_tool_m=reached,
            final_error_m=float(np.linalg.norm(reached - tools[-1])),
            tracking_error_m=max(tracking),
            closure_error_m=max(closure),
            torque_n_m=efforts,
            saturated=self._machine.saturated(np.abs(efforts).max(axis=0)),
            measured=measure,
        )

    def tool(self) -> Array:
        """Where the tool is in the mechanism's plane, (2,), metres."""
        point = self._machine.point("platform")
        return np.array([point[1], point[2] - self.parameters.motor_height_m])

    def _trajectory(self, tool: ArrayLike) -> Array:
        tools = as_points(tool, 2, "tool")
        if tools.ndim != 2 or len(tools) == 0:
            raise ValueError(f"tool has shape {tools.shape}: expected (n, 2), n >= 1")
        self._require_rate()
        return tools


def full_gate(parameters: TransplanterParameters, gate: Gate) -> tuple[Array, Array, Array]:
    """The whole published window over a gate at ``physics_hz``: position, velocity, acceleration, (n, 2) each."""
    (left, bottom), (right, top) = parameters.arm.window_m
    motion = gate.motion((left, bottom), (right, bottom), top)
    steps = int(np.ceil(motion.duration_s * parameters.physics_hz))
    state = motion.sample(np.arange(steps + 1) / parameters.physics_hz)
    return state.position, state.velocity, state.acceleration


def measure_tracking(
    gate: Gate, parameters: TransplanterParameters | None = None, payload_kg: float = 0.3
) -> GateResult:
    """Tracking, closure and motor torques over the whole window with a payload (0.3 kg is published)."""
    chosen = parameters or TransplanterParameters()
    positions = full_gate(chosen, gate)[0]
    with TransplanterMachine(chosen) as machine:
        machine.reset(positions[0])
        machine.carry(payload_kg)
        return machine.run(positions, measure=True)
