"""The safflower picker in PyBullet: a cart on the row and a closed five-bar that works across it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..mechanisms.batching import as_points
from ..motion import StoppedPath
from .assembly import picker_assembly
from .machine import LoopMachine
from .motion_result import Maxima, MotionResult
from .picker_model import JOINTS, PICKER_ASSET, PickerParameters, picker_joints

Array = NDArray[np.float64]

MOTORS = ("cart", "arm1", "arm2")
_DRIVEN = [JOINTS.index(name) for name in MOTORS]
_SOLVER_ITERATIONS = 60
"""Few long steps with many sweeps cost less than many short ones with few: a step without a sweep takes as long as 40
sweeps. The heavy tool on its light forearms needs them: tracking falls with their square, closure with the steps'."""


@dataclass(frozen=True)
class PickerResult(MotionResult):
    """What a motion of the picker did.

    Attributes as ``MotionResult``, and:
        final_tool_m: tool centre in the world, (3,).
        cart_error_m: largest distance of the tool centre from its command along the row.
        arm_error_m: largest distance of the tool centre from its command in the arm's plane.
        peak_effort: largest magnitudes that the motors (cart, arm1, arm2) applied: N, N m, N m; (3,).
    """

    final_tool_m: Array
    cart_error_m: float
    arm_error_m: float
    peak_effort: Array


class PickerMachine(LoopMachine):
    """The picker: a cart, two two-link legs and a level platform, closed by two point-to-point constraints.

    Tool positions are (u, v) in the five-bar's plane, see ``FiveBar``; the plane stands across the row at the cart's
    x. The world has x along the row, y across, z up, with the ground at z = 0.

    Attributes as ``LoopMachine``.
    """

    numbers = PickerParameters
    world: ClassVar = {"solver_iterations": _SOLVER_ITERATIONS}
    parameters: PickerParameters

    def _build(self) -> None:
        """With the cart at x = 0 and the arms hanging straight down."""
        bar = self.parameters.five_bar
        self._build_tree(PICKER_ASSET, picker_assembly(self.parameters))
        self._order = [JOINTS.index(name) for name in self._machine.joints]
        self.reset(0.0, bar.forward([-0.5 * np.pi, -0.5 * np.pi]))

    def place(self, cart_x_m: float, tool: ArrayLike) -> Array:
        """Put all joints where the kinematics says, at rest, without stepping.

        Args:
            cart_x_m: x of the arm's plane, metres.
            tool: (2,), (u, v) in metres.

        Returns:
            Their values in the order of ``JOINTS``.

        Raises:
            UnreachablePoseError: the tool position is beyond the reach of a leg.
        """
        joints = picker_joints(
            self.parameters, np.array([cart_x_m], dtype=np.float64), as_points(tool, 2, "tool").reshape(1, 2)
        )[0]
        self._machine.reset(joints[self._order])
        return joints

    def reset(self, cart_x_m: float, tool: ArrayLike) -> None:
        """``place`` the machine and have its motors hold it there."""
        self._machine.hold(self.place(cart_x_m, tool)[_DRIVEN])

    def run(
        self,
        cart: ArrayLike,
        tool: ArrayLike,
        on_step: Callable[[int], None] | None = None,
        *,
        measure: bool = False,
    ) -> PickerResult:
        """Drive the machine along a trajectory that is sampled at ``physics_hz`` and starts where it stands.

        Args:
            cart: (n,) x of the arm's plane, metres; n - 1 steps are simulated.
            tool: (n, 2) tool centre (u, v), metres.
            on_step: called after every step with the number of the row that was reached.
            measure: look at every step instead of the last one; some four times slower.

        Raises:
            ValueError: shapes do not fit, the first row is elsewhere, or the client runs at another rate.
            UnreachablePoseError: a row is beyond the reach of a leg.
        """
        carts, tools = self._trajectory(cart, tool)
        targets = picker_joints(self.parameters, carts, tools)[:, _DRIVEN]
        wanted = self._to_world(carts, tools)
        self._require_start(float(np.linalg.norm(wanted[0] - self.tool_world())))
        seen = Maxima(self._machine, 2, len(MOTORS))

        def look(row: int) -> None:
            error = self.tool_world() - wanted[row]
            seen.look(abs(float(error[0])), float(np.hypot(error[1], error[2])))

        duration_s = self._follow(targets, look, on_step, measure)
        tool_m = self.tool_world()
        return PickerResult(
            duration_s=duration_s,
            final_tool_m=tool_m,
            final_error_m=float(np.linalg.norm(tool_m - wanted[-1])),
            cart_error_m=float(seen.errors[0]),
            arm_error_m=float(seen.errors[1]),
            closure_error_m=seen.closure_m,
            peak_effort=seen.effort,
            saturated=self._machine.saturated(seen.effort),
            measured=measure,
        )

    def tool_world(self) -> Array:
        """The tool centre in the world, (3,), metres."""
        return self._machine.point("platform")

    def _trajectory(self, cart: ArrayLike, tool: ArrayLike) -> tuple[Array, Array]:
        carts, tools = np.asarray(cart, dtype=np.float64), as_points(tool, 2, "tool")
        if carts.ndim != 1 or tools.shape != (len(carts), 2) or len(carts) == 0:
            raise ValueError(f"cart has shape {carts.shape} and tool {tools.shape}: expected (n,) and (n, 2), n >= 1")
        self._require_rate()
        return carts, tools

    def _to_world(self, carts: Array, tools: Array) -> Array:
        """World positions (n, 3) of tool centres (n, 2) at cart positions (n,)."""
        y = tools[:, 0] - 0.5 * self.parameters.five_bar.base_m
        return np.stack([carts, y, self.parameters.motor_height_m + tools[:, 1]], axis=-1)


def fastest_gate(parameters: PickerParameters) -> tuple[Array, Array]:
    """The hardest motion that picking can command, sampled at ``physics_hz``: cart (n,) and tool (n, 2).

    The tool rises from 0.46 m below the motors to the traverse level of 0.28 m, goes out to one side of the workspace,
    crosses 0.26 m, and comes back down, at its limits, while the cart drives a stop of 0.45 m at its own limits.
    """
    middle = 0.5 * parameters.five_bar.base_m
    across = middle + np.array([-0.05, -0.05, -0.13, 0.13, 0.05, 0.05])
    level = np.array([-0.46, -0.28, -0.28, -0.28, -0.28, -0.46])
    tool = StoppedPath.under_limits(
        np.stack([across, level], axis=-1), parameters.tool_velocity_m_s, parameters.tool_acceleration_m_s2
    )
    cart = StoppedPath.under_limits([[0.0], [0.45]], parameters.cart_velocity_m_s, parameters.cart_acceleration_m_s2)
    steps = int(np.ceil(max(tool.duration_s, cart.duration_s) * parameters.physics_hz))
    time = np.arange(steps + 1) / parameters.physics_hz
    return cart.sample(time).position[:, 0], tool.sample(time).position


def measure_tracking(parameters: PickerParameters | None = None) -> PickerResult:
    """Tracking, closure and motor efforts over the whole of the fastest gate."""
    chosen = parameters or PickerParameters()
    cart, tool = fastest_gate(chosen)
    with PickerMachine(chosen) as machine:
        machine.reset(cart[0], tool[0])
        return machine.run(cart, tool, measure=True)
