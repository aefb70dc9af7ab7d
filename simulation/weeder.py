"""The laser weeder in PyBullet: a cart that drives on and a closed 3UPS-RPU platform that follows weeds under it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..mechanisms.batching import as_points
from .assembly import weeder_assembly
from .client import pybullet
from .machine import LoopMachine
from .motion_result import Maxima, MotionResult
from .weeder_model import JOINTS, WEEDER_ASSET, WeederParameters, weeder_joints

Array = NDArray[np.float64]

MOTORS = ("cart", "leg1", "leg2", "leg3", "leg4")
LEVEL_WAY = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
"""Position and quaternion of a way along the world's x."""
_DRIVEN = [JOINTS.index(name) for name in MOTORS]


@dataclass(frozen=True)
class WeederResult(MotionResult):
    """What a motion of the weeder did.

    Attributes as ``MotionResult``, and:
        peak_effort: largest force (5,) of the motors, N, of the steps that were looked at.
        beam: (n, 2) world places where the beam met the plane that was asked for, NaN where nobody looked.
    """

    peak_effort: Array
    beam: Array = field(repr=False)


class WeederMachine(LoopMachine):
    """The weeder: cart, three UPS legs and the RPU leg with the platform, closed by three point-to-point constraints.

    Poses are the mechanism's (x, z, alpha, beta), see ``ThreeUPSRPU``; it hangs under the cart with its X along the
    direction of travel and its Z down. The world has x along the row, y across, z up, ground at z = 0.

    Attributes as ``LoopMachine``.
    """

    numbers = WeederParameters
    parameters: WeederParameters
    _way: tuple[float, ...] = LEVEL_WAY

    def _build(self) -> None:
        """With the cart at x = 0 and the platform at home."""
        mechanism = self.parameters.mechanism
        self._build_tree(WEEDER_ASSET, weeder_assembly(self.parameters))
        self._order = [JOINTS.index(name) for name in self._machine.joints]
        self.reset(0.0, mechanism.home_pose)

    def reset(self, cart_x_m: float, pose: ArrayLike, speed_m_s: float = 0.0, way: Sequence[float] = LEVEL_WAY) -> None:
        """Put all joints where the kinematics says, the cart driving at ``speed_m_s``, all legs at rest against it.

        ``way`` (7,) is position and quaternion (x, y, z, w) of the cart's way.
        """
        self._lay(way)
        poses = as_points(pose, 4, "pose").reshape(1, 4)
        joints = weeder_joints(self.parameters, np.array([cart_x_m]), poses)[0]
        self._machine.reset(joints[self._order])
        if speed_m_s:
            pybullet.resetJointState(self.body_id, 0, cart_x_m, speed_m_s, self.client.id)
        self._machine.hold(joints[_DRIVEN])

    def run(
        self,
        cart: ArrayLike,
        pose: ArrayLike,
        target_height_m: float = 0.0,
        look: NDArray[np.bool_] | None = None,
        on_step: Callable[[int], None] | None = None,
        ways: ArrayLike | None = None,
    ) -> WeederResult:
        """Drive the machine along a trajectory that is sampled at ``physics_hz`` and starts where it stands.

        Args:
            cart: (n,) cart positions, metres; n - 1 steps are simulated.
            pose: (n, 4) poses of the mechanism.
            target_height_m: height of the plane on which the beam is looked for.
            look: (n,) rows after whose step beam, closure and efforts are looked at; by default the last one alone.
            on_step: called after every step with the number of the row that was reached.
            ways: (n, 7), where the cart's way lies in every row, position and quaternion (x, y, z, w): so uneven ground
                moves cart and all. The machine follows it at once: it is far slower than what it carries.

        Raises:
            ValueError: shapes do not fit, the first row is elsewhere, or the client runs at another rate.
        """
        carts, poses = np.asarray(cart, dtype=np.float64), as_points(pose, 4, "pose")
        if carts.ndim != 1 or poses.shape != (len(carts), 4) or len(carts) == 0:
            raise ValueError(f"cart has shape {carts.shape} and pose {poses.shape}: expected (n,) and (n, 4), n >= 1")
        lengths = self.parameters.mechanism.inverse(poses)
        targets = np.concatenate([carts[:, None], lengths], axis=1)
        last = len(carts) - 1
        laid = None if ways is None else np.asarray(ways, np.float64).reshape(len(carts), 7).tolist()
        self._require_rate()
        self._require_start(self._astray_m(carts[0], poses[0]))
        rows = np.zeros(len(carts), bool) if look is None else np.asarray(look, bool).copy()
        rows[last] = True
        beam = np.full((len(carts), 2), np.nan)
        seen = Maxima(self._machine, 0, len(MOTORS))

        def watch(row: int) -> None:
            if rows[row]:
                beam[row] = self.beam_world(target_height_m)
                seen.look()
            if on_step is not None:
                on_step(row)
            if laid is not None and row < last:
                self._lay(laid[row + 1])

        if laid is not None and last:
            self._lay(laid[1])
        self._machine.follow(targets, watch)
        astray_m = self._astray_m(carts[last], poses[last])
        saturated, measured = self._machine.saturated(seen.effort), bool(rows.all())
        duration_s = last * self.client.step_s
        return WeederResult(duration_s, astray_m, seen.closure_m, saturated, measured, seen.effort, beam)

    def _astray_m(self, cart_x_m: float, pose: Array) -> float:
        """Distance of the platform's centre from where a cart and a pose put it."""
        wanted = cart_x_m + float(pose[0]), 0.0, self.parameters.base_height_m - float(pose[1])
        if self._way != LEVEL_WAY:
            wanted = pybullet.multiplyTransforms(self._way[:3], self._way[3:], wanted, LEVEL_WAY[3:])[0]
        return float(np.linalg.norm(self._machine.point("platform") - np.array(wanted)))

    def _lay(self, way: Sequence[float]) -> None:
        """Put the cart's way, and with it all that hangs on it, at a position and quaternion (7,)."""
        if tuple(way) != self._way:
            self._way = tuple(way)
            pybullet.resetBasePositionAndOrientation(self.body_id, self._way[:3], self._way[3:], self.client.id)

    def beam_world(self, height_m: float = 0.0) -> Array:
        """World place (2,) where the beam meets the horizontal plane at ``height_m``."""
        centre, ahead = self._machine.point("platform"), self._machine.point("platform", (0.0, 0.0, 1.0))
        ray = ahead - centre
        return (centre + (height_m - centre[2]) / ray[2] * ray)[:2]
