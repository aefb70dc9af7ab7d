"""The 3-PRRS in PyBullet: three legs of slider, driven rotation and link, and a free platform."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..mechanisms.batching import as_points
from ..mechanisms.errors import UnreachablePoseError
from ..motion.orientation import angle_between, from_euler
from .assembly import prrs_assembly
from .assets import asset_path
from .client import pybullet
from .closed_loop import Body, ClosedLoopMachine
from .machine import START_TOLERANCE_M, LoopMachine, LostMachineError
from .motion_result import Maxima, MotionResult
from .prrs_model import PrrsParameters
from .sorter_limits import first_violation

Array = NDArray[np.float64]

MOTORS = ("slider1", "slider2", "slider3", "drive1", "drive2", "drive3")
"""Driven joints in the order of the mechanism's joints."""
SWINGS = ("swing1", "swing2", "swing3")

START_TOLERANCE_RAD = 0.03
"""As ``START_TOLERANCE_M``, for the platform's turn."""


@dataclass(frozen=True)
class PrrsResult(MotionResult):
    """What a motion of a 3-PRRS did.

    Attributes as ``MotionResult``, and:
        position_error_m: largest distance of the platform's centre from its command.
        angle_error_rad: largest angle between the platform and its command.
        peak_effort: largest magnitudes that the motors applied: 3 forces in N, 3 torques in N m; (6,).
    """

    position_error_m: float
    angle_error_rad: float
    peak_effort: Array


class PrrsMachine(LoopMachine):
    """A 3-PRRS: six motors and a free platform held by three spherical joints.

    Poses are the mechanism's, (x, y, z, alpha, beta, gamma) in metres and radians, see ``ThreePRRS``; the world's
    origin lies on the floor under it.

    Attributes as ``LoopMachine``; ``parameters`` are ``PrrsParameters``, which know the URDFs too.
    """

    def _build(self) -> None:
        """In its home pose."""
        mechanism = self.parameters.mechanism
        self._origin = np.array((0.0, 0.0, self.parameters.origin_height_m))
        assembly = prrs_assembly(self.parameters)
        with _urdf_files(self.parameters) as paths:
            bodies = [
                Body(part.name, paths[part.name], part.position_m, part.quaternion, part.fixed)
                for part in assembly.parts
            ]
            bodies += self._fixtures(paths)
            self._machine = ClosedLoopMachine(self.client, bodies, assembly.closures, assembly.motors)
        names = MOTORS + SWINGS
        self._order = [names.index(name) for name in self._machine.joints]
        body = self.platform_id
        pybullet.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0, physicsClientId=self.client.id)
        info = pybullet.getDynamicsInfo(body, -1, physicsClientId=self.client.id)
        self._inertia, self._to_mass = np.array(info[2]), (info[3], info[4])
        self.reset(mechanism.home_pose)

    @property
    def platform_id(self) -> int:
        """PyBullet's number of the platform."""
        return self._machine.body_ids["platform"]

    def place(self, pose: ArrayLike) -> Array:
        """Put all joints where the kinematics says, at rest, without stepping.

        Returns:
            Their values in the order of ``MOTORS`` and ``SWINGS``.

        Raises:
            UnreachablePoseError: the pose (6,) is beyond a limit; names it.
        """
        poses = as_points(pose, 6, "pose").reshape(1, 6)
        self._require_reach(poses)
        chains = self.parameters.mechanism.chains(poses)
        joints = np.concatenate([chains.joints[0], chains.swing[0]])
        quaternion = from_euler(poses[0, 3:])
        position = poses[0, :3] + self._origin
        # PyBullet places a free body by its centre of mass.
        base = pybullet.multiplyTransforms(position.tolist(), quaternion[[1, 2, 3, 0]].tolist(), *self._to_mass)
        self._machine.reset(joints[self._order], {"platform": base})
        return joints

    def reset(self, pose: ArrayLike) -> None:
        """``place`` the machine and have its motors hold it there."""
        self._machine.hold(self.place(pose)[: len(MOTORS)])

    def run(
        self, pose: ArrayLike, on_step: Callable[[int], None] | None = None, *, measure: bool = False
    ) -> PrrsResult:
        """Drive the machine along poses that are sampled at ``physics_hz`` and start where it stands.

        Args:
            pose: (n, 6); n - 1 steps are simulated.
            on_step: called after every step with the number of the row that was reached.
            measure: look at every step instead of the last one; some three times slower.

        Raises:
            UnreachablePoseError: a pose on the way is beyond a limit; names it, and nothing is moved.
            ValueError: the shape does not fit, the first row is elsewhere, or the client runs at another rate.
        """
        poses = as_points(pose, 6, "pose")
        if poses.ndim != 2 or len(poses) == 0:
            raise ValueError(f"pose has shape {poses.shape}: expected (n, 6) with n >= 1")
        self._require_rate()
        self._require_reach(poses)
        targets = self.parameters.mechanism.inverse(poses)
        quaternions = from_euler(poses[:, 3:])
        position, quaternion = self.platform()
        jump, turn = np.linalg.norm(position - poses[0, :3]), angle_between(quaternion, quaternions[0])
        if jump > START_TOLERANCE_M or turn > START_TOLERANCE_RAD:
            raise LostMachineError(
                f"the motion starts {1e3 * jump:.1f} mm and {np.degrees(turn):.1f} deg from where the platform stands: "
                "start at the last commanded pose, call reset(), or give stronger motors if the last motion's report "
                "says that they were saturated"
            )
        seen = Maxima(self._machine, 2, len(MOTORS))

        def look(row: int) -> None:
            at, turned = self.platform()
            apart = np.linalg.norm(at - poses[row, :3]), angle_between(turned, quaternions[row])
            seen.look(float(apart[0]), float(apart[1]))

        duration_s = self._follow(targets, look, on_step, measure)
        return PrrsResult(
            duration_s=duration_s,
            final_error_m=float(np.linalg.norm(self.platform()[0] - poses[-1, :3])),
            position_error_m=float(seen.errors[0]),
            angle_error_rad=float(seen.errors[1]),
            closure_error_m=seen.closure_m,
            peak_effort=seen.effort,
            saturated=self._machine.saturated(seen.effort),
            measured=measure,
        )

    def platform(self) -> tuple[Array, Array]:
        """The platform's centre (3,) in mechanism coordinates and its quaternion (w, x, y, z)."""
        position, quaternion = self._machine.pose("platform")
        return position - self._origin, quaternion[[3, 0, 1, 2]]

    def joints(self) -> Array:
        """The driven joints (6,) as they stand, in the mechanism's order."""
        values = dict(zip(self._machine.joints, self._machine.joint_positions().tolist(), strict=True))
        return np.array([values[name] for name in MOTORS])

    def _fixtures(self, paths: dict[str, Path]) -> list[Body]:
        """Further bodies of the machine, which do not move; ``paths`` are its URDFs by their stem."""
        return []

    def _require_reach(self, poses: Array) -> None:
        if not np.all(np.isfinite(poses)):
            raise ValueError("the motion holds a NaN or an infinity: every commanded pose must be finite")
        found = first_violation(self.parameters.mechanism, poses)
        if found is not None:
            at = poses[found.sample].tolist()
            raise UnreachablePoseError("ThreePRRS", at, found.limit, found.margin, (found.sample,))


@contextmanager
def _urdf_files(parameters: PrrsParameters) -> Iterator[dict[str, Path]]:
    """URDFs by their stem: the shipped ones for the shipped parameters, else some written for the moment."""
    texts = parameters.assets()
    if parameters == type(parameters)():
        with ExitStack() as stack:
            yield {Path(name).stem: stack.enter_context(asset_path(name)) for name in texts}
        return
    with tempfile.TemporaryDirectory(prefix=f"fieldgym-{parameters.name}-") as folder:
        paths = {Path(name).stem: Path(folder) / Path(name).name for name in texts}
        for path, text in zip(paths.values(), texts.values(), strict=True):
            path.write_text(text, encoding="utf-8")
        yield paths
