"""Closed-loop machines in PyBullet: URDF trees joined at run time by point-to-point constraints."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .client import PhysicsClient, pybullet

_T = TypeVar("_T")

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

SATURATION_SHARE = 0.999
"""A motor that needs this share of its limit counts as saturated; the solver stops a hair below the limit itself."""


@dataclass(frozen=True)
class Body:
    """One URDF of a machine.

    Attributes:
        name: unique in the machine; names a free base in ``ClosedLoopMachine.reset``.
        urdf: path of the file; read in the constructor only.
        position_m: of the base link's frame.
        quaternion: of the base link's frame, (x, y, z, w).
        fixed_base: whether the base link is part of the world; a free platform is not.
    """

    name: str
    urdf: Path
    position_m: Vector = (0.0, 0.0, 0.0)
    quaternion: Quaternion = (0.0, 0.0, 0.0, 1.0)
    fixed_base: bool = True


@dataclass(frozen=True)
class Closure:
    """Two points of two links that must coincide.

    Attributes:
        first: link name.
        first_pivot_m: the point in that link's URDF frame.
        second: link name.
        second_pivot_m: the point in that link's URDF frame.
    """

    first: str
    first_pivot_m: Vector
    second: str
    second_pivot_m: Vector


@dataclass(frozen=True)
class Motor:
    """A driven joint.

    Attributes:
        joint: joint name.
        limit: largest torque in N m, or force in N for a prismatic joint, dry friction taken off.
        damping: viscous friction of the joint, N m s/rad or N s/m.
    """

    joint: str
    limit: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        """Check the limit."""
        if not 0.0 < self.limit < np.inf:
            raise ValueError(f"motor {self.joint!r}: limit = {self.limit} must be positive and finite")


class _Link(NamedTuple):
    body: int
    number: int
    """PyBullet's index of the link in its body, -1 for a base."""


class ClosedLoopMachine:
    """Bodies, closures and motors in one client, moved by joint positions.

    The bodies keep their joint and link names, which must be unique in the machine. All one-degree-of-freedom joints
    are addressed in the order of ``joints``, all motors in the order given.

    Attributes:
        client: the world that it lives in.
        joints: names of all one-degree-of-freedom joints, active and passive.
        motors: the driven joints.
        body_ids: PyBullet's number of each body, by name.
    """

    def __init__(
        self,
        client: PhysicsClient,
        bodies: Sequence[Body],
        closures: Sequence[Closure],
        motors: Sequence[Motor],
    ) -> None:
        """Load the bodies, free their joints and close the loops.

        The loops are only declared here: call ``reset`` with a pose that closes them before stepping.

        Args:
            client: the world to build in.
            bodies: URDF trees.
            closures: points that are pinned together.
            motors: driven joints with their limits.

        Raises:
            ValueError: two links or joints share a name, or a closure or motor names one that is missing.
        """
        self.client = client
        self.motors = tuple(motors)
        self.body_ids: dict[str, int] = {}
        self._joints: dict[str, tuple[int, int]] = {}
        self._links: dict[str, _Link] = {}
        # Nothing is ever drawn in this world: see simulation/looks.py.
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_IGNORE_VISUAL_SHAPES
        for body in bodies:
            self._load(body, flags)
        self.joints = tuple(self._joints)
        self._motor_rows = [self._named(self._joints, "joint", motor.joint) for motor in motors]
        self._limits = np.array([motor.limit for motor in motors], dtype=np.float64)
        for (number, index), motor in zip(self._motor_rows, motors, strict=True):
            if motor.damping:
                pybullet.changeDynamics(number, index, jointDamping=motor.damping, physicsClientId=client.id)
        self._columns = self._columns_by_body()
        self._closures = tuple(closures)
        for closure in closures:
            self._close(closure)

    def reset(self, positions: ArrayLike, bases: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None) -> None:
        """Put every joint where the analytic kinematics says, at rest; nothing is stepped.

        Args:
            positions: (len(joints),) in radians and metres, active and passive.
            bases: position (3,) and quaternion (4,) of free bases, by body name.

        Raises:
            ValueError: wrong length, or a value is not finite (a pose out of reach).
        """
        values = np.asarray(positions, dtype=np.float64)
        if values.shape != (len(self.joints),) or not np.all(np.isfinite(values)):
            raise ValueError(f"positions = {values}: expected {len(self.joints)} finite values for {self.joints}")
        reset_joint, client = pybullet.resetJointState, self.client.id
        for (body, joint), value in zip(self._joints.values(), values.tolist(), strict=True):
            reset_joint(body, joint, value, 0.0, client)
        for name, (position, quaternion) in (bases or {}).items():
            body = self._named(self.body_ids, "body", name)
            pybullet.resetBasePositionAndOrientation(body, position, quaternion, physicsClientId=client)
            pybullet.resetBaseVelocity(body, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), physicsClientId=client)

    def follow(self, targets: ArrayLike, on_step: Callable[[int], None] | None = None) -> None:
        """Drive the motors along sampled positions, one row a step, with velocity feed-forward.

        The step from row k to row k + 1 is commanded with position row k and velocity (row k+1 - row k) / dt, so that
        the machine is at row k + 1 when it ends. The machine must stand at the first row.

        Args:
            targets: (n, len(motors)) positions at the client's rate.
            on_step: called after each step with the number of the row that has been reached.

        Raises:
            ValueError: wrong shape, or a value is not finite.
        """
        rows = np.asarray(targets, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != len(self.motors):
            raise ValueError(f"targets has shape {rows.shape}: expected (n, {len(self.motors)})")
        if not np.all(np.isfinite(rows)):
            first = int(np.flatnonzero(~np.isfinite(rows).all(axis=1))[0])
            raise ValueError(f"targets row {first} = {rows[first]} is not finite: the pose is out of reach")
        rates = np.diff(rows, axis=0) * self.client.physics_hz
        client, command, step = self.client.id, pybullet.setJointMotorControlArray, pybullet.stepSimulation
        control = pybullet.POSITION_CONTROL
        drives = []
        for body, columns in self._columns.items():
            indices = [self._motor_rows[column][1] for column in columns]
            gains = [1.0] * len(columns)
            limits = self._limits[columns].tolist()
            drives.append((body, indices, rows[:-1, columns].tolist(), rates[:, columns].tolist(), limits, gains))
        for k in range(len(rates)):
            for body, indices, positions, velocities, limits, gains in drives:
                # One call a body with positional arguments: this line is a large part of a step's time.
                command(body, indices, control, positions[k], velocities[k], limits, gains, gains, client)
            step(client)
            if on_step is not None:
                on_step(k + 1)

    def hold(self, targets: ArrayLike) -> None:
        """Have the motors hold positions (len(motors),) in steps that are not commanded by ``follow``."""
        rows = np.asarray(targets, dtype=np.float64)
        for body, columns in self._columns.items():
            gains, zeros = [1.0] * len(columns), [0.0] * len(columns)
            indices = [self._motor_rows[column][1] for column in columns]
            pybullet.setJointMotorControlArray(
                body,
                indices,
                pybullet.POSITION_CONTROL,
                rows[columns].tolist(),
                zeros,
                self._limits[columns].tolist(),
                gains,
                gains,
                self.client.id,
            )

    def remove(self) -> None:
        """Take the bodies and their closures out of the world."""
        for body in self.body_ids.values():
            pybullet.removeBody(body, physicsClientId=self.client.id)
        self.body_ids = {}

    def joint_positions(self) -> Array:
        """Positions (len(joints),) in the order of ``joints``."""
        client = self.client.id
        return np.array([pybullet.getJointState(*joint, physicsClientId=client)[0] for joint in self._joints.values()])

    def motor_efforts(self) -> Array:
        """Torques or forces (len(motors),) that the motors applied in the last step."""
        client = self.client.id
        return np.array([pybullet.getJointState(*joint, physicsClientId=client)[3] for joint in self._motor_rows])

    def saturated(self, efforts: ArrayLike) -> NDArray[np.bool_]:
        """Which motors (..., len(motors)) are at their limits under ``efforts`` of the same shape."""
        return np.abs(np.asarray(efforts)) >= SATURATION_SHARE * self._limits

    def point(self, link: str, pivot_m: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
        """World position (3,) of a point of a link's URDF frame."""
        body, index = self._named(self._links, "link", link)
        position, quaternion = self._frame(body, index)
        return np.array(pybullet.multiplyTransforms(position, quaternion, pivot_m, (0.0, 0.0, 0.0, 1.0))[0])

    def pose(self, link: str) -> tuple[Array, Array]:
        """World position (3,) and quaternion (x, y, z, w) of a link's URDF frame."""
        position, quaternion = self._frame(*self._named(self._links, "link", link))
        return np.array(position), np.array(quaternion)

    def closure_error_m(self) -> float:
        """Largest distance between two points that are pinned together."""
        gaps = [
            np.linalg.norm(self.point(c.first, c.first_pivot_m) - self.point(c.second, c.second_pivot_m))
            for c in self._closures
        ]
        return float(max(gaps, default=0.0))

    def _load(self, body: Body, flags: int) -> None:
        client = self.client.id
        number = pybullet.loadURDF(
            str(body.urdf),
            body.position_m,
            body.quaternion,
            useFixedBase=body.fixed_base,
            flags=flags,
            physicsClientId=client,
        )
        if body.name in self.body_ids:
            raise ValueError(f"two bodies are named {body.name!r}: give each its own name")
        self.body_ids[body.name] = number
        base = pybullet.getBodyInfo(number, physicsClientId=client)[0].decode()
        self._add(self._links, "link", base, _Link(number, -1))
        # Links of a machine are pinned to each other where they overlap: they must not collide.
        pybullet.setCollisionFilterGroupMask(number, -1, 0, 0, physicsClientId=client)
        for index in range(pybullet.getNumJoints(number, physicsClientId=client)):
            info = pybullet.getJointInfo(number, index, physicsClientId=client)
            kind, joint, link = info[2], info[1].decode(), info[12].decode()
            self._add(self._links, "link", link, _Link(number, index))
            pybullet.setCollisionFilterGroupMask(number, index, 0, 0, physicsClientId=client)
            # Links have no air resistance and joints no friction; every default motor is off, or it brakes the loop.
            pybullet.changeDynamics(
                number, index, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, physicsClientId=client
            )
            if kind in (pybullet.JOINT_REVOLUTE, pybullet.JOINT_PRISMATIC):
                self._add(self._joints, "joint", joint, (number, index))
                pybullet.setJointMotorControl2(
                    number, index, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=client
                )
            elif kind == pybullet.JOINT_SPHERICAL:
                pybullet.setJointMotorControlMultiDof(
                    number,
                    index,
                    pybullet.POSITION_CONTROL,
                    targetPosition=(0.0, 0.0, 0.0, 1.0),
                    positionGain=0.0,
                    velocityGain=0.0,
                    force=(0.0, 0.0, 0.0),
                    physicsClientId=client,
                )

    def _close(self, closure: Closure) -> None:
        first = self._named(self._links, "link", closure.first)
        second = self._named(self._links, "link", closure.second)
        pybullet.createConstraint(
            *first,
            *second,
            pybullet.JOINT_POINT2POINT,
            (0.0, 0.0, 0.0),
            self._in_mass_frame(first, closure.first_pivot_m),
            self._in_mass_frame(second, closure.second_pivot_m),
            physicsClientId=self.client.id,
        )

    def _in_mass_frame(self, link: _Link, pivot_m: Vector) -> Vector:
        """PyBullet wants constraint pivots in the frame of the principal inertia, not in the URDF's."""
        info = pybullet.getDynamicsInfo(*link, physicsClientId=self.client.id)
        to_mass = pybullet.invertTransform(info[3], info[4])
        return pybullet.multiplyTransforms(*to_mass, pivot_m, (0.0, 0.0, 0.0, 1.0))[0]

    def _frame(self, body: int, index: int) -> tuple[Vector, Quaternion]:
        """World pose of a link's URDF frame."""
        client = self.client.id
        if index >= 0:
            state = pybullet.getLinkState(body, index, computeForwardKinematics=True, physicsClientId=client)
            return state[4], state[5]
        mass = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
        info = pybullet.getDynamicsInfo(body, -1, physicsClientId=client)
        return pybullet.multiplyTransforms(*mass, *pybullet.invertTransform(info[3], info[4]))

    def _columns_by_body(self) -> dict[int, list[int]]:
        columns: dict[int, list[int]] = {}
        for column, (body, _) in enumerate(self._motor_rows):
            columns.setdefault(body, []).append(column)
        return columns

    @staticmethod
    def _add(names: dict[str, _T], kind: str, name: str, value: _T) -> None:
        if name in names:
            raise ValueError(f"two {kind}s of the machine are named {name!r}: names must be unique across its bodies")
        names[name] = value

    @staticmethod
    def _named(names: Mapping[str, _T], kind: str, name: str) -> _T:
        if name not in names:
            raise ValueError(f"the machine has no {kind} {name!r}: it has {sorted(names)}")
        return names[name]
