"""What the planar machines with two arms and two forearms share: one set of formulas for every five-bar."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .batching import Array, as_points, solve_rows
from .errors import raise_beyond_limits
from .geometry import segment_distance
from .linear import apply, dot
from .workspace import Method, PlanarWorkspace, planar_workspace

_UPRIGHT_BAND = 0.02


class Conditioning(NamedTuple):
    """Singular values of a dimensionally homogeneous Jacobian, each of shape (...)."""

    number: Array
    smallest: Array
    largest: Array


class Leg(NamedTuple):
    """A driven arm and its forearm."""

    arm_m: float
    forearm_m: float
    motor_x_m: float
    """Where the motor's axis stands; both motors are at y = 0."""
    wrist_x_m: float
    """Where the forearm holds the platform, relative to the tool centre."""
    side: float
    """1 for the leg whose elbow points to -x, -1 for the other."""


class LegPose(NamedTuple):
    """Both legs of a posed machine, in the order of its joints."""

    elbow: Array
    """(..., 2 legs, 2), metres."""
    wrist: Array
    """(..., 2 legs, 2), metres."""
    arm: Array
    """Joint angles of the driven arms, (..., 2), radians."""
    forearm: Array
    """Angles of the forearms, (..., 2), radians."""


@dataclass(frozen=True, kw_only=True)
class TwoLegs:
    """Two motors at y = 0, two driven arms, two forearms that carry a level platform below them, elbows outwards.

    Joint angles are measured anticlockwise from +x in the open range (-3/2 pi, pi/2), so that nothing wraps while an
    arm swings about the hanging direction.

    Attributes:
        arm_range_rad: lower and upper limit of the left arm's angle; the right arm has the mirrored range.
        min_forearm_angle_rad: smallest angle between the forearms' lines (distance to the parallel singularity).
        min_elbow_angle_rad: smallest angle between arm and forearm lines (distance to the serial singularity).
        link_clearance_m: smallest distance between links that do not share a joint.
    """

    arm_range_rad: tuple[float, float] = (np.deg2rad(-175.0), np.deg2rad(-75.0))
    min_forearm_angle_rad: float = np.deg2rad(20.0)
    min_elbow_angle_rad: float = np.deg2rad(10.0)
    link_clearance_m: float = 0.02

    _JOINTS: ClassVar[tuple[str, str]]

    @property
    def _legs(self) -> tuple[Leg, Leg]:
        """The legs in the order of the joints."""
        raise NotImplementedError

    @property
    def _drop_m(self) -> float:
        """How far the tool centre lies below the wrists."""
        raise NotImplementedError

    def _check_limits(self) -> None:
        if not 0.0 <= self.link_clearance_m < np.inf:
            raise ValueError(f"link_clearance_m = {self.link_clearance_m} m: give a length >= 0")
        for name in ("min_forearm_angle_rad", "min_elbow_angle_rad"):
            if not 0.0 <= getattr(self, name) < np.pi / 2:
                raise ValueError(f"{name} = {getattr(self, name)} rad: give a number in [0, pi/2)")
        low, high = self.arm_range_rad
        if not -1.5 * np.pi < low < high < np.pi / 2:
            raise ValueError(f"arm_range_rad = {self.arm_range_rad}: give -3/2 pi < lower < upper < pi/2")

    def inverse(self, position: ArrayLike, *, strict: bool = False) -> Array:
        """Joint angles for tool positions.

        One square root, one quotient and one arctangent a leg, no iteration; machine code, see ``two_legs_kernels``.

        Args:
            position: (..., 2), metres.
            strict: raise for a pose beyond any limit instead of returning NaN where the links cannot close.

        Returns:
            (..., 2) joint angles, radians; NaN where a leg cannot reach.

        Raises:
            UnreachablePoseError: only with ``strict``; names the limit.
        """
        joints = solve_rows("two_legs_kernels", self._numbers, position, 2, "position")
        if strict:
            raise_beyond_limits(type(self).__name__, as_points(position, 2, "position"), self.margins(position))
        return joints

    def forward(self, joints: ArrayLike) -> Array:
        """Tool positions for joint angles: the lower intersection of the forearms' circles.

        Args:
            joints: (..., 2), radians.

        Returns:
            (..., 2) positions, metres; NaN where the forearms do not meet.
        """
        legs = self._legs
        elbows = self._elbows(as_points(joints, 2, "joints"))
        # Moving each elbow back by its wrist's offset makes both circles meet in the point above the tool.
        shifted = elbows - np.array([[leg.wrist_x_m, 0.0] for leg in legs])
        left = 0 if legs[0].side > 0.0 else 1
        b, e = shifted[..., left, :], shifted[..., 1 - left, :]
        near, far = legs[left].forearm_m, legs[1 - left].forearm_m
        across = e - b
        with np.errstate(divide="ignore", invalid="ignore"):
            square = dot(across, across)
            along = 0.5 * (1.0 + (near * near - far * far) / square)
            height = np.sqrt(near * near / square - along * along)
            x = b[..., 0] + along * across[..., 0] + height * across[..., 1]
            y = b[..., 1] + along * across[..., 1] - height * across[..., 0]
        return np.stack([x, y - self._drop_m], axis=-1)

    def jacobian(self, position: ArrayLike) -> Array:
        """J of joint rates = J @ tool velocity, shape (..., 2, 2), rad/m."""
        return self._jacobian(self._pose(position))

    def joint_rates(self, position: ArrayLike, velocity: ArrayLike) -> Array:
        """Joint rates (..., 2) in rad/s for tool velocities (..., 2) in m/s."""
        return apply(self.jacobian(position), as_points(velocity, 2, "velocity"))

    def pose_rates(self, position: ArrayLike, joint_rates: ArrayLike) -> Array:
        """Tool velocities (..., 2) in m/s for joint rates (..., 2) in rad/s."""
        return solve_pair(self.jacobian(position), as_points(joint_rates, 2, "joint_rates"))

    def joint_accelerations(self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> Array:
        """Joint accelerations (..., 2) in rad/s2.

        Args:
            position: (..., 2), metres.
            velocity: (..., 2), m/s.
            acceleration: (..., 2), m/s2.
        """
        v, a = as_points(velocity, 2, "velocity"), as_points(acceleration, 2, "acceleration")
        return self._joint_motion(self._pose(position), v, a)[1]

    def statics(self, position: ArrayLike, force: ArrayLike) -> Array:
        """Motor torques (..., 2) in N m that hold a force (..., 2) in N applied to the tool (virtual work)."""
        transposed = np.swapaxes(self.jacobian(position), -1, -2)
        return -solve_pair(transposed, as_points(force, 2, "force"))

    def transmission_angles(self, position: ArrayLike) -> Array:
        """Angles (..., 3) in [0, pi/2] rad: elbow of the first leg, of the second, between the forearms.

        The first two vanish at the serial singularities, the third at the parallel one.
        """
        return self._transmission_angles(self._pose(position))

    def margins(self, position: ArrayLike) -> dict[str, Array]:
        """Signed distance (...) to every limit by name, negative outside; NaN where the links cannot close.

        ``leg1_reach``, ``leg1_fold`` and their leg-2 twins are metres and always defined; each joint's ``_lower`` and
        ``_upper``, ``elbow1``, ``elbow2`` (serial singularity) and ``forearms`` (parallel singularity) are radians;
        ``clearance`` is metres between links that share no joint.
        """
        pose = self._pose(position)
        legs = self._legs
        result: dict[str, Array] = {}
        for index, leg in enumerate(legs):
            distance = np.hypot(pose.wrist[..., index, 0] - leg.motor_x_m, pose.wrist[..., index, 1])
            result[f"leg{index + 1}_reach"] = leg.arm_m + leg.forearm_m - distance
            result[f"leg{index + 1}_fold"] = distance - abs(leg.arm_m - leg.forearm_m)
        low, high = self.arm_range_rad
        for index, leg in enumerate(legs):
            bounds = (low, high) if leg.side > 0.0 else (-np.pi - high, -np.pi - low)
            angle, name = pose.arm[..., index], self._JOINTS[index]
            result |= {f"{name}_lower": angle - bounds[0], f"{name}_upper": bounds[1] - angle}
        angles = self._transmission_angles(pose)
        result["elbow1"] = angles[..., 0] - self.min_elbow_angle_rad
        result["elbow2"] = angles[..., 1] - self.min_elbow_angle_rad
        # Signed: a tool above the line of the elbows would have its forearms crossed, which forward() excludes.
        crossing = legs[0].side * np.sin(pose.forearm[..., 0] - pose.forearm[..., 1])
        result["forearms"] = np.copysign(angles[..., 2], crossing) - self.min_forearm_angle_rad
        result["clearance"] = self._clearance(pose) - self.link_clearance_m
        return result

    def reachable(self, position: ArrayLike) -> np.ndarray:
        """Whether tool positions (..., 2) respect every limit, shape (...)."""
        worst = np.min(np.stack(list(self.margins(position).values())), axis=0)
        return worst >= 0.0

    def conditioning(self, position: ArrayLike) -> Conditioning:
        """Condition number and singular values (m/rad) of the velocity map joints -> tool at positions (..., 2).

        Both joints are rotations and both outputs are lengths, so the map is homogeneous as it stands.
        """
        j = self.jacobian(position)
        square = np.sum(j * j, axis=(-1, -2))
        determinant = np.abs(determinant_of_pair(j))
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(np.maximum(square * square - 4.0 * determinant * determinant, 0.0))
            largest_inverse = np.sqrt(0.5 * (square + root))
            smallest_inverse = determinant / largest_inverse
            return Conditioning(largest_inverse / smallest_inverse, 1.0 / largest_inverse, 1.0 / smallest_inverse)

    def pose_error(self, position: ArrayLike, joint_error: ArrayLike) -> Array:
        """Tool displacement (..., 2) in metres when the motors are off by ``joint_error`` (..., 2) rad."""
        points = as_points(position, 2, "position")
        return self.forward(self.inverse(points) + as_points(joint_error, 2, "joint_error")) - points

    def workspace(self, method: Method = "monte-carlo", *, samples: int = 200_000, seed: int = 0) -> PlanarWorkspace:
        """The reachable region: points, area and outline; see ``planar_workspace`` for the methods."""
        legs = self._legs
        reach = max(leg.arm_m + leg.forearm_m + abs(leg.wrist_x_m) for leg in legs)
        motors = [leg.motor_x_m for leg in legs]
        lower = (min(motors) - reach, -reach - self._drop_m)
        upper = (max(motors) + reach, reach - self._drop_m)
        return planar_workspace(self.reachable, lower, upper, method, samples, seed)

    @cached_property
    def _numbers(self) -> Array:
        """What the legs' angles depend on, (2, 6): see ``two_legs_kernels``."""
        rows = []
        for leg in self._legs:
            scale, level = 0.5 / leg.arm_m, leg.arm_m - leg.forearm_m - _UPRIGHT_BAND * leg.arm_m
            lead = (leg.arm_m * leg.arm_m - leg.forearm_m * leg.forearm_m) * scale
            rows.append((leg.wrist_x_m - leg.motor_x_m, self._drop_m, scale, lead, leg.side, level))
        return np.array(rows)

    def _elbows(self, angles: Array) -> Array:
        """Elbow positions (..., 2 legs, 2)."""
        directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        motors = np.array([[leg.motor_x_m, 0.0] for leg in self._legs])
        return motors + np.array([[leg.arm_m] for leg in self._legs]) * directions

    def _pose(self, position: ArrayLike) -> LegPose:
        tool = as_points(position, 2, "position")
        angles = solve_rows("two_legs_kernels", self._numbers, tool, 2, "position")
        elbow = self._elbows(angles)
        wrist = tool[..., None, :] + np.array([[leg.wrist_x_m, self._drop_m] for leg in self._legs])
        forearm = np.arctan2(wrist[..., 1] - elbow[..., 1], wrist[..., 0] - elbow[..., 0])
        return LegPose(elbow, wrist, angles, forearm)

    def _jacobian(self, pose: LegPose) -> Array:
        directions = np.stack([np.cos(pose.forearm), np.sin(pose.forearm)], axis=-1)
        arms = np.array([leg.arm_m for leg in self._legs])
        with np.errstate(divide="ignore", invalid="ignore"):
            return directions / (arms * np.sin(pose.forearm - pose.arm))[..., None]

    def _joint_motion(self, pose: LegPose, velocity: Array, acceleration: Array) -> tuple[Array, Array]:
        """Joint rates and joint accelerations, (..., 2) each."""
        arm = np.array([leg.arm_m for leg in self._legs])
        length = np.array([leg.forearm_m for leg in self._legs])
        rates = apply(self._jacobian(pose), velocity)
        sine, cosine = np.sin(pose.forearm), np.cos(pose.forearm)
        between = pose.forearm - pose.arm
        # The forearm's own rate is what the tool velocity leaves across it once the elbow's motion is taken off.
        across = -sine * velocity[..., :1] + cosine * velocity[..., 1:]
        forearm_rates = (across - arm * rates * np.cos(between)) / length
        along = cosine * acceleration[..., :1] + sine * acceleration[..., 1:]
        push = along + arm * rates**2 * np.cos(between) + length * forearm_rates**2
        with np.errstate(divide="ignore", invalid="ignore"):
            return rates, push / (arm * np.sin(between))

    def _transmission_angles(self, pose: LegPose) -> Array:
        apart = pose.forearm[..., :1] - pose.forearm[..., 1:]
        between = np.concatenate([pose.forearm - pose.arm, apart], axis=-1)
        return np.arcsin(np.minimum(np.abs(np.sin(between)), 1.0))

    def _clearance(self, pose: LegPose) -> Array:
        motors = [np.broadcast_to([leg.motor_x_m, 0.0], pose.elbow[..., 0, :].shape) for leg in self._legs]
        (b, e), (c, d) = (np.moveaxis(points, -2, 0) for points in (pose.elbow, pose.wrist))
        pairs = ((motors[0], b, motors[1], e), (motors[0], b, d, e), (motors[1], e, b, c))
        return np.min(np.stack([segment_distance(*pair) for pair in pairs]), axis=0)


def determinant_of_pair(matrix: Array) -> Array:
    """Determinants (...) of matrices (..., 2, 2)."""
    return matrix[..., 0, 0] * matrix[..., 1, 1] - matrix[..., 0, 1] * matrix[..., 1, 0]


def solve_pair(matrix: Array, vector: Array) -> Array:
    """Solutions (..., 2) of matrix @ solution = vector by Cramer's rule; infinite or NaN where singular."""
    determinant = determinant_of_pair(matrix)
    x = matrix[..., 1, 1] * vector[..., 0] - matrix[..., 0, 1] * vector[..., 1]
    y = matrix[..., 0, 0] * vector[..., 1] - matrix[..., 1, 0] * vector[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack([x, y], axis=-1) / determinant[..., None]
