"""The laser weeder's 3UPS-RPU platform: two translations and two rotations on four linear actuators."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from . import three_ups_rpu_geometry as geometry
from .batching import Array, as_points, solve_rows
from .errors import positive_length, raise_beyond_limits
from .five_bar import Conditioning
from .linear import angle_of, apply, dot, singular_values, solve_regular
from .three_ups_rpu_forward import ForwardResult, forward_by_continuation
from .three_ups_rpu_geometry import Attachments, ThreeUPSRPUChains
from .workspace import Method, PlanarWorkspace, planar_workspace

SINGULAR_VALUE = 1e-9
"""Smallest singular value (angles scaled by the platform radius) that still counts as regular: rounding level."""

WEEDING_BOX = (
    (-0.10, 0.10),
    (0.50, 0.70),
    (-math.radians(14.0), math.radians(14.0)),
    (-math.radians(14.0), math.radians(14.0)),
)
"""Ranges of x, z (metres), alpha and beta (radians) that the weeding machine needs, with all corners."""

Stroke = tuple[float, float]


class Singularity(NamedTuple):
    """How far a pose is from losing control of the platform, each of shape (...)."""

    smallest: Array
    """Smallest singular value of G with angles scaled by the platform radius, dimensionless."""
    determinant: Array
    """Determinant of the same matrix: its sign tells the two sides of the singular set apart."""
    singular: np.ndarray
    """Whether the smallest singular value is at rounding level."""


@dataclass(frozen=True)
class ThreeUPSRPU:
    """Four-degree-of-freedom platform on three UPS legs and one RPU leg (laser weeding paper, eqs 2-17, corrected).

    The pose is (x, z, alpha, beta): the platform's centre is at (x, 0, z) in the base's axes and its rotation is
    R = Ry(beta) Rx(alpha), the set that the RPU leg allows when its revolute axis is parallel to Y and its universal
    joint has axes parallel to Y and to the platform's x. ``z`` is the absolute height over the base; the paper's Z_o
    in eqs 18-19 is measured from the home height H. The joints are the four leg lengths in the paper's order.

    Attributes:
        base_radius_m: radius r_a of the circle of base joints A_i.
        platform_radius_m: radius r_b of the circle of platform joints B_i; it also scales angles in ``conditioning``.
        base_angles_rad: azimuths of A_1..A_4 from +x towards +y.
        platform_angles_rad: azimuths of B_1..B_4. Leg 4 must stand at pi on both rings.
        home_height_m: height H of the home pose.
        stroke_m: shortest and longest length of each leg.
        max_universal_tilt_rad: largest angle at a universal joint: between leg and base normal for the UPS legs,
            between leg and platform normal for the RPU leg.
        max_platform_tilt_rad: largest angle between the normals of platform and base.
        leg_distance_m: smallest distance between the centre lines of two legs.
        min_singular_value: smallest singular value of the scaled G that the machine accepts, dimensionless.
        paper_orientation: use the paper's R = Rx(alpha) Ry(beta) with Y_o = r_b sin(alpha) sin(beta), which the RPU
            leg as described does not have; only for reproducing the published curves.
    """

    base_radius_m: float
    platform_radius_m: float
    base_angles_rad: tuple[float, float, float, float]
    platform_angles_rad: tuple[float, float, float, float]
    home_height_m: float
    stroke_m: tuple[Stroke, Stroke, Stroke, Stroke]
    max_universal_tilt_rad: float = math.radians(50.0)
    max_platform_tilt_rad: float = math.radians(20.0)
    leg_distance_m: float = 0.15
    min_singular_value: float = 0.05
    paper_orientation: bool = False

    def __post_init__(self) -> None:
        """Check the radii, azimuths and limits."""
        positive_length(r_a=self.base_radius_m, r_b=self.platform_radius_m, H=self.home_height_m)
        for name in ("base_angles_rad", "platform_angles_rad"):
            angles = getattr(self, name)
            if len(angles) != 4 or not np.all(np.isfinite(angles)):
                raise ValueError(f"{name} = {angles}: give four finite azimuths in radians")
            if abs(np.cos(angles[3]) + 1.0) > 1e-12:
                raise ValueError(f"{name}[3] = {angles[3]} rad: the RPU leg stands at azimuth pi on both rings")
        if len(self.stroke_m) != 4 or not all(0.0 < low < high < np.inf for low, high in self.stroke_m):
            raise ValueError(f"stroke_m = {self.stroke_m} m: give four pairs 0 < shortest < longest")
        for name in ("max_universal_tilt_rad", "max_platform_tilt_rad"):
            if not 0.0 < getattr(self, name) < np.pi / 2:
                raise ValueError(f"{name} = {getattr(self, name)} rad: give a number in (0, pi/2)")
        for name in ("leg_distance_m", "min_singular_value"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} = {getattr(self, name)}: give a number >= 0")

    @classmethod
    def published(cls, *, paper_orientation: bool = False) -> ThreeUPSRPU:
        """The paper's layout: r_a = 0.4, r_b = 0.3, H = 0.6 m, joints every 90 degrees (all published).

        The paper prints no limits: the stroke is assumed, one single-stage actuator from 0.45 to 0.85 m. Platform and
        base are homothetic, so every pose with alpha = beta = 0 is singular and not ``reachable``.

        Args:
            paper_orientation: see the class.
        """
        azimuths, stroke = (-0.5 * math.pi, 0.0, 0.5 * math.pi, math.pi), (0.45, 0.85)
        strokes = (stroke, stroke, stroke, stroke)
        return cls(0.4, 0.3, azimuths, azimuths, 0.6, strokes, paper_orientation=paper_orientation)

    @classmethod
    def weeder(cls) -> ThreeUPSRPU:
        """The weeding machine's layout: published radii, base joints 1 and 3 at -+59, platform joints at -+124 deg.

        Found by ``scripts/synthesise_weeder.py``: of all layouts with whole-degree azimuths that are mirrored about
        the XZ plane it has the largest smallest singular value over |x| <= 0.10 m, z 0.5..0.7 m, alpha and beta
        +-14 deg among those with a stroke ratio below 2, universal joints within 50 deg and legs 0.15 m apart. The
        strokes are the extremes over that box rounded outwards to whole millimetres; the platform tilt is assumed.
        """
        base, platform = math.radians(59.0), math.radians(124.0)
        side, front = (0.485, 0.925), (0.427, 0.801)
        base_angles, platform_angles = (-base, 0.0, base, math.pi), (-platform, 0.0, platform, math.pi)
        return cls(0.4, 0.3, base_angles, platform_angles, 0.6, (side, front, side, front))

    @property
    def home_pose(self) -> Array:
        """The pose (0, H, 0, 0), shape (4,)."""
        return np.array([0.0, self.home_height_m, 0.0, 0.0])

    @cached_property
    def attachments(self) -> Attachments:
        """A_i in the base's axes and B_i in the platform's axes, read-only arrays (4, 3) in metres."""
        base = geometry.ring(self.base_radius_m, self.base_angles_rad)
        platform = geometry.ring(self.platform_radius_m, self.platform_angles_rad)
        return Attachments(base, platform, self.paper_orientation)

    @cached_property
    def _numbers(self) -> Array:
        """What the legs' lengths depend on, (4, 6): see ``three_ups_rpu_kernels``."""
        at = self.attachments
        paper = np.full(4, float(self.paper_orientation))
        return np.column_stack([at.base[:, :2], at.platform[:, :2], at.platform[:, 0] + at.radius_m, paper])

    def inverse(self, pose: ArrayLike, *, strict: bool = False) -> Array:
        """Leg lengths for poses (eq. 4 with the orientation that the RPU leg has).

        Every pose has leg lengths, so nothing but NaN in the pose gives NaN; what the actuators and joints can hold
        is told by ``margins``.

        Args:
            pose: (..., 4) as (x, z, alpha, beta), metres and radians.
            strict: raise for a pose beyond any limit.

        Returns:
            (..., 4) leg lengths, metres.

        Raises:
            UnreachablePoseError: only with ``strict``; names the limit.
        """
        if strict:
            raise_beyond_limits(type(self).__name__, as_points(pose, 4, "pose"), self.margins(pose))
        return solve_rows("three_ups_rpu_kernels", self._numbers, pose, 4, "pose")

    def forward(self, lengths: ArrayLike, seed_pose: ArrayLike) -> ForwardResult:
        """Pose for leg lengths, in the assembly mode of a seed pose (Newton's method along a continuation).

        Args:
            lengths: (..., 4), metres.
            seed_pose: (..., 4) regular pose from which the lengths are approached; broadcasts against ``lengths``.

        Returns:
            ``ForwardResult(pose, converged, iterations)``; the pose is NaN where it did not converge: lengths that
            no pose has, a singular seed, or a singularity on the way.
        """
        goal, seed = np.broadcast_arrays(as_points(lengths, 4, "lengths"), as_points(seed_pose, 4, "seed_pose"))
        return forward_by_continuation(partial(geometry.lengths_and_map, self.attachments), goal, seed)

    def pose_error(self, pose: ArrayLike, length_error: ArrayLike) -> Array:
        """What poses (..., 4) are off by when the legs' lengths are by ``length_error`` (..., 4) metres.

        NaN where no pose near the commanded one has such legs.
        """
        poses = as_points(pose, 4, "pose")
        return self.forward(self.inverse(poses) + as_points(length_error, 4, "length_error"), poses).pose - poses

    def chains(self, pose: ArrayLike) -> ThreeUPSRPUChains:
        """Joint positions, leg lengths and leg directions at poses (..., 4)."""
        return geometry.pose_chains(self.attachments, as_points(pose, 4, "pose"))

    def rpu_angles(self, pose: ArrayLike) -> Array:
        """Angles (..., 3) of the RPU leg in rad: base revolute from +z towards +x, then the universal joint's two."""
        poses = as_points(pose, 4, "pose")
        direction = self.chains(poses).direction[..., 3, :]
        swing = np.arctan2(direction[..., 0], direction[..., 2])
        return np.stack([swing, poses[..., 3] - swing, poses[..., 2]], axis=-1)

    def jacobian(self, pose: ArrayLike) -> Array:
        """G of (leg rates, 0, 0) = G @ (v, omega), shape (..., 6, 6) (eq. 10 with n6 = (sin(beta), 0, cos(beta))).

        Rows 1-4 are dimensionless for v and metres for omega, row 5 is the RPU leg's constraint force along Y at B_4,
        row 6 its constraint couple about n6, the direction normal to both axes of its universal joint.
        """
        poses = as_points(pose, 4, "pose")
        return geometry.jacobian(self.attachments, poses, self.chains(poses))

    def rate_map(self, pose: ArrayLike) -> Array:
        """Map (..., 4, 4) of pose rates to leg rates: the first four rows of G times ``twist_map``."""
        return geometry.lengths_and_map(self.attachments, as_points(pose, 4, "pose"))[1]

    def twist_map(self, pose: ArrayLike) -> Array:
        """Map (..., 6, 4) of pose rates to the twist (v, omega) of the platform's centre."""
        return geometry.twist_map(self.attachments, as_points(pose, 4, "pose"))

    def twist(self, pose: ArrayLike, rates: ArrayLike) -> Array:
        """Twist (v, omega), shape (..., 6) in m/s and rad/s, for pose rates (..., 4)."""
        return apply(self.twist_map(pose), as_points(rates, 4, "rates"))

    def twist_rate(self, pose: ArrayLike, rates: ArrayLike, accelerations: ArrayLike) -> Array:
        """Linear and angular acceleration (..., 6) of the platform for pose rates and accelerations (..., 4)."""
        poses, rate = as_points(pose, 4, "pose"), as_points(rates, 4, "rates")
        return geometry.twist_rate(self.attachments, poses, rate, as_points(accelerations, 4, "accelerations"))

    def joint_rates(self, pose: ArrayLike, rates: ArrayLike) -> Array:
        """Leg rates (..., 4) in m/s for pose rates (..., 4) in m/s and rad/s (eq. 8)."""
        return apply(self.rate_map(pose), as_points(rates, 4, "rates"))

    def pose_rates(self, pose: ArrayLike, joint_rates: ArrayLike) -> Array:
        """Pose rates (..., 4) for leg rates (..., 4) in m/s (eq. 10); NaN where the pose is singular."""
        poses = as_points(pose, 4, "pose")
        return solve_regular(self.rate_map(poses), as_points(joint_rates, 4, "joint_rates"), self._regular(poses))

    def joint_accelerations(self, pose: ArrayLike, rates: ArrayLike, accelerations: ArrayLike) -> Array:
        """Leg accelerations (..., 4) in m/s2 (eqs 13 and 16; the same as with ``hessian``).

        Args:
            pose: (..., 4), metres and radians.
            rates: (..., 4), m/s and rad/s.
            accelerations: (..., 4), m/s2 and rad/s2.
        """
        poses = as_points(pose, 4, "pose")
        change = self.twist_rate(poses, rates, accelerations)
        return geometry.leg_accelerations(self.chains(poses), self.twist(poses, rates), change)

    def pose_accelerations(self, pose: ArrayLike, rates: ArrayLike, joint_accelerations: ArrayLike) -> Array:
        """Pose accelerations (..., 4) for leg accelerations (..., 4) in m/s2 (eq. 16); NaN where singular."""
        poses = as_points(pose, 4, "pose")
        rest = as_points(joint_accelerations, 4, "joint_accelerations")
        rest = rest - self.joint_accelerations(poses, rates, np.zeros(4))
        return solve_regular(self.rate_map(poses), rest, self._regular(poses))

    def hessian(self, pose: ArrayLike) -> Array:
        """H_1..H_6 of (leg accelerations, 0, 0) = G A + V^T H V, shape (..., 6, 6, 6) (eqs 13-16).

        H_5 has the sign +r4^ n5^ and H_6 follows from the n6 of ``jacobian``: both differ from the print.
        """
        return geometry.hessian(self.attachments, as_points(pose, 4, "pose"))

    def statics(self, pose: ArrayLike, wrench: ArrayLike) -> Array:
        """Leg forces and constraint reactions (..., 6) that balance a wrench on the platform (eq. 17).

        Args:
            pose: (..., 4), metres and radians.
            wrench: (..., 6) force in N and moment in N m applied to the platform at its centre, base axes.

        Returns:
            (F_1..F_4, F_U, M_U): forces of the legs on the platform in N, positive where a leg pushes; the RPU leg's
            force along Y in N and couple about n6 in N m. NaN where the pose is singular: there no finite leg force
            holds a general wrench.
        """
        poses = as_points(pose, 4, "pose")
        transposed = np.swapaxes(self.jacobian(poses), -1, -2)
        return -solve_regular(transposed, as_points(wrench, 6, "wrench"), self._regular(poses))

    def margins(self, pose: ArrayLike) -> dict[str, Array]:
        """Signed distance (...) to every limit by name, negative outside.

        ``leg1_retracted``, ``leg1_extended`` and their twins of legs 2-4 are metres; ``universal1``..``universal4``
        and ``platform_tilt`` radians; ``clearance`` metres between the two nearest legs; ``regularity`` is the
        dimensionless distance of the smallest singular value from its limit.
        """
        poses = as_points(pose, 4, "pose")
        result = self._geometric_margins(poses)
        result["regularity"] = self.conditioning(poses).smallest - self.min_singular_value
        return result

    def reachable(self, pose: ArrayLike) -> np.ndarray:
        """Whether poses (..., 4) respect every limit, shape (...)."""
        poses = as_points(pose, 4, "pose")
        worst = np.min(np.stack(list(self._geometric_margins(poses).values())), axis=0)
        good = np.empty(poses.shape[:-1], dtype=bool)
        good[...] = worst >= 0.0
        # Singular values cost more than all the other limits together: only what is left pays for them.
        good[good] = self.conditioning(poses[good]).smallest >= self.min_singular_value
        return good

    def conditioning(self, pose: ArrayLike) -> Conditioning:
        """Condition number and singular values of G at poses (..., 4), all dimensionless.

        Angles are scaled by the platform radius: the twist counts as (v, r_b omega) and the couple's row as a rate of
        r_b, so each singular value is a leg or constraint rate per unit of platform speed. The smallest one of G is
        never above that of the 4x4 map of pose rates scaled in the same way.
        """
        values = singular_values(self._scaled_jacobian(pose))
        with np.errstate(divide="ignore"):
            return Conditioning(values[..., 0] / values[..., -1], values[..., -1], values[..., 0])

    def singularity(self, pose: ArrayLike) -> Singularity:
        """Distance of poses (..., 4) from the singular set, where locked legs leave the platform a motion."""
        scaled = self._scaled_jacobian(pose)
        smallest = singular_values(scaled)[..., -1]
        return Singularity(smallest, np.linalg.det(scaled), smallest < SINGULAR_VALUE)

    def null_twist(self, pose: ArrayLike) -> Array:
        """The motion (v, omega), shape (..., 6), that locked legs leave the platform; NaN at regular poses.

        Scaled to |omega| = 1 rad/s, or to |v| = 1 m/s where nothing turns, with its largest entry positive.
        """
        scaled = self._scaled_jacobian(pose)
        known = np.asarray(np.isfinite(scaled).all(axis=(-1, -2)))
        _, values, right = np.linalg.svd(np.where(known[..., None, None], scaled, 0.0))
        twist = right[..., -1, :].copy()
        twist[..., 3:] /= self.platform_radius_m
        turn = np.linalg.norm(twist[..., 3:], axis=-1)
        twist /= np.where(turn > SINGULAR_VALUE, turn, np.linalg.norm(twist[..., :3], axis=-1))[..., None]
        largest = np.take_along_axis(twist, np.argmax(np.abs(twist), axis=-1)[..., None], axis=-1)
        free = known & (values[..., -1] < SINGULAR_VALUE)
        return np.where(free[..., None], twist * np.sign(largest), np.nan)

    def workspace(
        self,
        method: Method = "monte-carlo",
        *,
        orientation: tuple[float, float] = (0.0, 0.0),
        samples: int = 200_000,
        seed: int = 0,
    ) -> PlanarWorkspace:
        """The reachable region of (x, z) at one orientation; see ``planar_workspace`` for the methods.

        Args:
            method: "monte-carlo" or "polar".
            orientation: (alpha, beta) in radians.
            samples: points tried.
            seed: seed of the thrown points.

        Raises:
            ValueError: nothing is reachable at this orientation (as with ``published()`` without tilt).
        """
        longest = max(high for _, high in self.stroke_m)
        aside = longest * np.sin(self.max_universal_tilt_rad) + self.base_radius_m + self.platform_radius_m

        def reachable(points: Array) -> np.ndarray:
            tilts = np.broadcast_to(np.asarray(orientation, dtype=np.float64), points.shape)
            return self.reachable(np.concatenate([points, tilts], axis=-1))

        high = longest + self.platform_radius_m
        return planar_workspace(reachable, (-aside, 0.0), (aside, high), method, samples, seed)

    def _scaled_jacobian(self, pose: ArrayLike) -> Array:
        scaled = self.jacobian(pose)
        scaled[..., :5, 3:] /= self.platform_radius_m
        return scaled

    def _regular(self, poses: Array) -> np.ndarray:
        return self.conditioning(poses).smallest >= SINGULAR_VALUE

    def _geometric_margins(self, poses: Array) -> dict[str, Array]:
        chains = self.chains(poses)
        result: dict[str, Array] = {}
        for leg, (shortest, longest) in enumerate(self.stroke_m):
            result[f"leg{leg + 1}_retracted"] = chains.length[..., leg] - shortest
            result[f"leg{leg + 1}_extended"] = longest - chains.length[..., leg]
        cosines = chains.direction[..., 2].copy()
        cosines[..., 3] = dot(chains.direction[..., 3, :], chains.rotation[..., 2])
        for leg in range(4):
            result[f"universal{leg + 1}"] = self.max_universal_tilt_rad - angle_of(cosines[..., leg])
        result["platform_tilt"] = self.max_platform_tilt_rad - angle_of(chains.rotation[..., 2, 2])
        result["clearance"] = geometry.leg_distances(chains).min(axis=-1) - self.leg_distance_m
        return result
