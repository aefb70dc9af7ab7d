"""The 3-PRRS platform with six degrees of freedom: three driven sliders, three driven rotations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .batching import Array, as_points, in_chunks, solve_rows
from .errors import positive_length, raise_beyond_limits
from .five_bar import Conditioning
from .linear import apply, singular_values, solve_where_regular
from .prrs_forward import solve_swings
from .prrs_legs import (
    MARGINS,
    RADIAL,
    TANGENTIAL,
    Legs,
    ThreePRRSChains,
    leg_frame,
    pose_legs,
    write_margins,
)
from .rotations import euler_from_rotation, euler_rate_map, rotation_from_euler
from .spatial_workspace import Reachable, SpatialMethod, SpatialWorkspace, spatial_workspace
from .three_ups_rpu_forward import ForwardResult


@dataclass(frozen=True)
class ThreePRRS:
    """Six-degree-of-freedom 3-PRRS after the 3-PRRS paper (closed vector loops, eqs 1-6).

    Slider i moves vertically at M_i on a circle of diameter D, azimuths 0, 120 and 240 deg; its displacement L_i is
    the height of G_i. There R1, horizontal and radial, is driven by theta_i and turns R2, perpendicular to it; the
    link l hangs from R2 and ends in the spherical joint a_i on the platform's circle of diameter d. The sliders stay
    above the platform.

    A pose is (x, y, z, alpha, beta, gamma): the platform's centre P in metres and T = Rz(gamma) Ry(beta) Rx(alpha).
    Joints are (L1, L2, L3, theta1, theta2, theta3), metres and radians. A twist is (v_P, omega): the velocity of P
    and the platform's angular velocity, both in the fixed frame; ``euler_rates`` and ``twist`` convert.

    Attributes:
        link_m: l, from G_i to a_i.
        base_diameter_m: D, of the circle of the sliders.
        platform_diameter_m: d, of the circle of the spherical joints.
        slider_range_m: lower and upper limit of L_i.
        cone_rad: delta, largest angle between the platform's z axis and a link.
        link_clearance_m: D', smallest distance between two links.
        min_platform_lock: smallest ``platform_lock`` (1 at the level centre with D = d, 0 at a parallel singularity).
    """

    link_m: float
    base_diameter_m: float
    platform_diameter_m: float
    slider_range_m: tuple[float, float]
    cone_rad: float
    link_clearance_m: float = 0.010
    min_platform_lock: float = 0.0

    def __post_init__(self) -> None:
        """Check the lengths and limits."""
        positive_length(l=self.link_m, D=self.base_diameter_m, d=self.platform_diameter_m)
        if not abs(self.base_diameter_m - self.platform_diameter_m) < 2.0 * self.link_m:
            raise ValueError(
                f"D = {self.base_diameter_m} m and d = {self.platform_diameter_m} m are further apart than links of "
                f"l = {self.link_m} m can span: give |D - d| < 2 l"
            )
        low, high = self.slider_range_m
        if not -np.inf < low < high < np.inf:
            raise ValueError(f"slider_range_m = {self.slider_range_m} m: give lower < upper, both finite")
        if not 0.0 < self.cone_rad <= np.pi:
            raise ValueError(f"cone_rad = {self.cone_rad} rad: give a number in (0, pi]")
        if not 0.0 <= self.link_clearance_m < np.inf:
            raise ValueError(f"link_clearance_m = {self.link_clearance_m} m: give a length >= 0")
        if not 0.0 <= self.min_platform_lock < 1.0:
            raise ValueError(f"min_platform_lock = {self.min_platform_lock}: give a number in [0, 1)")

    @classmethod
    def published(cls) -> ThreePRRS:
        """The paper's machine.

        The slider range 90..250 mm is printed. l = 98.3, D = 158.6, d = 70.0 mm and delta = 55.9 deg are identified
        from the twelve workspace limits of Figs 3 and 4 (rms 1.3 mm; a flat ridge, so that other sets fit nearly as
        well). The link diameter 10 mm is assumed; it does not bind at the two orientations.
        """
        return cls(0.0983, 0.1586, 0.0700, (0.090, 0.250), np.deg2rad(55.9))

    @classmethod
    def sorter(cls) -> ThreePRRS:
        """A machine for a belt 0.3 m wide: a cylinder 0.30 m across and 0.10 m high over z = 0.

        Everywhere in the cylinder yaw +-45 deg and tilt 15 deg together; level, the cylinder is 0.40 m across, so that
        bins beside the belt are within reach. Found by ``scripts/synthesise_sorter.py``: the shortest links on a 5 mm
        raster for a platform circle of 160 mm and spherical joints of 55 deg. All values are assumed; the paper
        gives no sorting machine.
        """
        return cls(0.330, 0.160, 0.160, (0.230, 0.455), np.deg2rad(55.0), 0.030, 0.25)

    @classmethod
    def hoe(cls) -> ThreePRRS:
        """The sorter's machine with longer links, for a hoe: level, 0.36 x 0.43 m and 0.10 m high over z = 0.

        Found by ``scripts/synthesise_sorter.py`` as the sorter, with the same platform and joints. All values are
        assumed; the paper names tilling and weeding as uses of the mechanism and gives no machine for them.
        """
        return cls(0.345, 0.160, 0.160, (0.200, 0.445), np.deg2rad(55.0), 0.030, 0.25)

    @cached_property
    def _numbers(self) -> Array:
        """What the legs' joints depend on, (3, 6): see ``prrs_kernels``."""
        sizes = np.array([self.platform_radius_m, self.platform_radius_m, 0.5 * self.base_diameter_m, self.link_m])
        return np.concatenate([RADIAL[:2], RADIAL[:2], np.ones((2, 3))]).T * np.concatenate([[1.0, 1.0], sizes])

    def inverse(self, pose: ArrayLike, *, strict: bool = False) -> Array:
        """Sliders and driven angles of poses (paper eqs 5 and 6, the root with the slider above).

        Args:
            pose: (..., 6), metres and radians.
            strict: raise for a pose beyond any limit instead of returning NaN where the links cannot close.

        Returns:
            (..., 6) joints, metres and radians; theta in (-pi/2, pi/2). NaN for the legs that cannot reach.

        Raises:
            UnreachablePoseError: only with ``strict``; names the limit.
        """
        joints = solve_rows("prrs_kernels", self._numbers, pose, 6, "pose")
        if strict:
            raise_beyond_limits(type(self).__name__, as_points(pose, 6, "pose"), self.margins(pose))
        return joints

    def forward(self, joints: ArrayLike, seed_pose: ArrayLike | None = None) -> ForwardResult:
        """Poses of joint values, on the assembly branch of a seed.

        The links' swings about R2 are three unknowns, the platform's three sides three equations; Newton's method on
        them, each batch element by itself. Where it fails or leaves the seed's assembly mode, the joints are led
        there from the seed's in small steps.

        Args:
            joints: (..., 6), metres and radians.
            seed_pose: pose near the wanted one that the links can close, (..., 6), broadcast; by default level below
                the sliders' mean height.

        Returns:
            ``ForwardResult(pose, converged, iterations)``; the pose is NaN where it did not converge: joint values
            that no pose has, a seed whose links do not close, or a singularity on the way.
        """
        q = as_points(joints, 6, "joints")
        if seed_pose is None:
            seed = np.zeros(q.shape)
            seed[..., 2] = q[..., :3].mean(axis=-1) - self._home_drop_m
        else:
            seed = as_points(seed_pose, 6, "seed_pose")
        q, seed = np.broadcast_arrays(q, seed)
        chains = self.chains(seed)
        shape = q.shape[:-1]
        solution = solve_swings(
            q.reshape(-1, 6).T,
            chains.swing.reshape(-1, 3).T,
            chains.joints.reshape(-1, 6).T,
            self.link_m,
            0.5 * self.base_diameter_m,
            0.5 * np.sqrt(3.0) * self.platform_diameter_m,
        )
        a = solution.a
        centre = a.mean(axis=1)
        x_axis = (a[:, 0] - centre) / self.platform_radius_m
        y_axis = (a[:, 1] - a[:, 2]) / (np.sqrt(3.0) * self.platform_radius_m)
        normal = np.cross(x_axis, y_axis, axis=0)
        rotation = np.moveaxis(np.stack([x_axis, y_axis, normal], axis=1), -1, 0)
        pose = np.concatenate([centre.T, euler_from_rotation(rotation)], axis=-1)
        pose[~solution.converged] = np.nan
        return ForwardResult(
            pose.reshape((*shape, 6)),
            solution.converged.reshape(shape),
            solution.iterations.reshape(shape),
        )

    def pose_error(self, pose: ArrayLike, joint_error: ArrayLike) -> Array:
        """What poses (..., 6) are off by when joints are by ``joint_error`` (..., 6); NaN where no pose has them."""
        return self.forward(self.inverse(pose) + as_points(joint_error, 6, "joint_error"), pose).pose - np.asarray(pose)

    @property
    def home_pose(self) -> Array:
        """Level, on the axis, sliders at half stroke; shape (6,)."""
        return np.array([0.0, 0.0, 0.5 * sum(self.slider_range_m) - self._home_drop_m, 0.0, 0.0, 0.0])

    @property
    def _home_drop_m(self) -> float:
        """Height of the sliders above a level platform on the axis."""
        offset = 0.5 * (self.base_diameter_m - self.platform_diameter_m)
        return float(np.sqrt(self.link_m**2 - offset**2))

    @property
    def platform_radius_m(self) -> float:
        """Distance d / 2 of the spherical joints from P."""
        return 0.5 * self.platform_diameter_m

    def chains(self, pose: ArrayLike) -> ThreePRRSChains:
        """All joint positions, R2 axes and swings at poses (..., 6); NaN for the legs that cannot reach."""
        poses, legs = self._legs(pose)
        frame = leg_frame(legs.link)
        m = np.sqrt(frame.m_square)
        u = (frame.s / m) * TANGENTIAL[..., None]
        u[2] = frame.q / m
        a = legs.arm + poses.reshape(-1, 6).T[:3, None]
        swing = np.arctan2(frame.p, m)
        joints = np.concatenate([legs.slider, np.arctan2(frame.q, frame.s)])
        shape = poses.shape[:-1]

        def vectors(columns: Array) -> Array:
            return np.transpose(columns, (2, 1, 0)).reshape((*shape, 3, 3))

        return ThreePRRSChains(
            vectors(a - legs.link), vectors(a), vectors(u), swing.T.reshape((*shape, 3)), joints.T.reshape((*shape, 6))
        )

    def twist(self, pose: ArrayLike, pose_rates: ArrayLike) -> Array:
        """Twists (v_P, omega), (..., 6), of pose rates (x', y', z', alpha', beta', gamma'), (..., 6)."""
        poses, rates = as_points(pose, 6, "pose"), as_points(pose_rates, 6, "pose_rates")
        omega = apply(euler_rate_map(poses[..., 3:]), rates[..., 3:])
        return np.concatenate([np.broadcast_to(rates[..., :3], omega.shape), omega], axis=-1)

    def euler_rates(self, pose: ArrayLike, twist: ArrayLike) -> Array:
        """Pose rates (x', ..., gamma'), (..., 6), of twists (..., 6); NaN at beta = +-pi/2, where they do not exist."""
        poses, twists = as_points(pose, 6, "pose"), as_points(twist, 6, "twist")
        rates = solve_where_regular(euler_rate_map(poses[..., 3:]), twists[..., 3:])
        return np.concatenate([np.broadcast_to(twists[..., :3], rates.shape), rates], axis=-1)

    def jacobian(self, pose: ArrayLike) -> Array:
        """J of joint rates = J @ (v_P, omega), shape (..., 6, 6); rows L1', L2', L3', theta1', theta2', theta3'."""
        poses, legs = self._legs(pose)
        frame = leg_frame(legs.link)
        slider_row = legs.link / frame.s
        slider_row[2] = -1.0
        # L' = f.v_a / f_z; theta follows from tan(theta) = q/s, in which s depends on the horizontal motion alone.
        angle_row = frame.s * TANGENTIAL[..., None] + frame.q * slider_row
        angle_row[2] = 0.0
        angle_row /= frame.m_square
        linear = np.concatenate([-slider_row, angle_row], axis=1)
        angular = np.cross(np.concatenate([legs.arm, legs.arm], axis=1), linear, axis=0)
        columns = np.concatenate([linear, angular])
        return np.transpose(columns, (2, 1, 0)).reshape((*poses.shape[:-1], 6, 6))

    def joint_rates(self, pose: ArrayLike, twist: ArrayLike) -> Array:
        """Joint rates (..., 6) in m/s and rad/s for twists (v_P, omega), (..., 6)."""
        return apply(self.jacobian(pose), as_points(twist, 6, "twist"))

    def pose_rates(self, pose: ArrayLike, joint_rates: ArrayLike) -> Array:
        """Twists (v_P, omega), (..., 6), for joint rates (..., 6); NaN where J is singular."""
        return solve_where_regular(self.jacobian(pose), as_points(joint_rates, 6, "joint_rates"))

    def joint_accelerations(self, pose: ArrayLike, twist: ArrayLike, twist_rate: ArrayLike) -> Array:
        """Joint accelerations (..., 6) in m/s2 and rad/s2: the closed loops differentiated twice.

        Args:
            pose: (..., 6).
            twist: (v_P, omega), (..., 6).
            twist_rate: its time derivative (a_P, omega'), (..., 6), fixed frame.
        """
        poses, v, a = (
            as_points(values, 6, name)
            for values, name in ((pose, "pose"), (twist, "twist"), (twist_rate, "twist_rate"))
        )
        poses, v, a = np.broadcast_arrays(poses, v, a)
        legs = self._legs(poses)[1]
        v, a = (values.reshape(-1, 6).T for values in (v, a))
        omega, omega_rate = v[3:, None], a[3:, None]
        spin = np.cross(omega, legs.arm, axis=0)
        link_rate = v[:3, None] + spin
        push = a[:3, None] + np.cross(omega_rate, legs.arm, axis=0) + np.cross(omega, spin, axis=0)
        frame = leg_frame(legs.link)
        # d is the link vector l f: d.d' = 0 and d.d'' = -|d'|^2, while v_a = L' z + d' and a_a = L'' z + d''.
        link_rate[2] -= np.sum(legs.link * link_rate, axis=0) / legs.link[2]
        slider = (np.sum(legs.link * push, axis=0) + np.sum(link_rate * link_rate, axis=0)) / legs.link[2]
        push[2] -= slider
        rate, acceleration = leg_frame(link_rate), leg_frame(push)
        theta_rate = (rate.q * frame.s - frame.q * rate.s) / frame.m_square
        stretch = 2.0 * (frame.s * rate.s + frame.q * rate.q)
        theta = (acceleration.q * frame.s - frame.q * acceleration.s - theta_rate * stretch) / frame.m_square
        return np.concatenate([slider, theta]).T.reshape((*poses.shape[:-1], 6))

    def statics(self, pose: ArrayLike, wrench: ArrayLike) -> Array:
        """Slider forces (N) and driven torques (N m), (..., 6), that hold a wrench on the platform (virtual work).

        Args:
            pose: (..., 6).
            wrench: (..., 6), force in N applied at P and moment in N m about P, fixed frame.
        """
        transposed = np.swapaxes(self.jacobian(pose), -1, -2)
        return -solve_where_regular(transposed, as_points(wrench, 6, "wrench"))

    def margins(self, pose: ArrayLike) -> dict[str, Array]:
        """Signed distance (...) to every limit by name, negative outside; NaN where the links cannot close.

        ``leg1_closure`` (metres, always defined) is what the link has left over its horizontal reach;
        ``slider1_lower``, ``slider1_upper`` (metres) the stroke left; ``cone1`` (rad) the spherical joint's angle
        left; ``clearance12`` (metres) the distance between two links as segments, less D'; ``platform_lock``
        (dimensionless) the distance to the parallel singularity. Every leg has its own.
        """
        table = in_chunks(self._margins_kernel, as_points(pose, 6, "pose"), len(MARGINS))
        return {name: table[..., column] for column, name in enumerate(MARGINS)}

    def reachable(self, pose: ArrayLike) -> np.ndarray:
        """Whether poses (..., 6) respect every limit, shape (...)."""
        poses = as_points(pose, 6, "pose")

        def kernel(columns: Array, worst: Array) -> None:
            table = np.empty((len(MARGINS), columns.shape[1]))
            self._margins_kernel(columns, table)
            np.min(table, axis=0, out=worst[0])

        return in_chunks(kernel, poses, 1)[..., 0] >= 0.0

    def conditioning(self, pose: ArrayLike, length_m: float | None = None) -> Conditioning:
        """Condition number and singular values of J (platform speeds -> joint speeds) at poses (..., 6).

        All rates are made speeds: the platform's rotation is scaled by ``length_m`` (default d/2, so that it counts
        by the speed of the spherical joints), the driven angles by the link's length l. The smallest value vanishes
        where the locked joints no longer hold the platform, the largest grows where a link lies level.
        """
        length = self.platform_radius_m if length_m is None else length_m
        positive_length(length_m=length)
        j = self.jacobian(pose).copy()
        j[..., 3:, :] *= self.link_m
        j[..., :, 3:] /= length
        values = singular_values(j)
        with np.errstate(divide="ignore", invalid="ignore"):
            return Conditioning(values[..., 0] / values[..., -1], values[..., -1], values[..., 0])

    def heights(self, position: ArrayLike, orientation: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[Array, Array]:
        """Lowest and highest z (...) that can be reached above (x, y), (..., 2), at orientations (..., 3).

        Only the sliders see the height, and they see it directly, so at a fixed orientation the reach over each
        (x, y) is one interval. NaN where it is empty.
        """
        xy, angles = as_points(position, 2, "position"), as_points(orientation, 3, "orientation")
        xy = np.broadcast_to(xy, (*np.broadcast_shapes(xy.shape[:-1], angles.shape[:-1]), 2))
        angles = np.broadcast_to(angles, (*xy.shape[:-1], 3))
        poses = np.concatenate([xy, np.zeros((*xy.shape[:-1], 1)), angles], axis=-1)
        table = in_chunks(self._margins_kernel, poses, len(MARGINS))
        low, high = -table[..., 3:6].min(axis=-1), table[..., 6:9].min(axis=-1)
        others = np.concatenate([table[..., :3], table[..., 9:]], axis=-1)
        empty = ~(others.min(axis=-1) >= 0.0) | ~(low <= high)
        return np.where(empty, np.nan, low), np.where(empty, np.nan, high)

    def volume(self, orientation: ArrayLike = (0.0, 0.0, 0.0), cells: int = 200) -> float:
        """Volume in m3 of the workspace at one orientation: ``heights`` summed over ``cells`` x ``cells`` columns."""
        lower, upper = self.box(orientation)
        step = (upper - lower)[:2] / cells
        x, y = (lower[k] + step[k] * (np.arange(cells) + 0.5) for k in (0, 1))
        low, high = self.heights(np.stack(np.meshgrid(x, y), axis=-1), orientation)
        return float(np.nansum(high - low) * step[0] * step[1])

    def box(self, orientation: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[Array, Array]:
        """Corners (3,) of a box that holds the workspace at one orientation, metres; from the links' lengths."""
        angles = as_points(orientation, 3, "orientation")
        arm = self.platform_radius_m * rotation_from_euler(angles) @ RADIAL
        middle = 0.5 * self.base_diameter_m * RADIAL - arm
        low, high = self.slider_range_m
        # A link hangs by at least l cos(delta + tilt) and at most l; the box takes 0 and l.
        z_low, z_high = low - self.link_m - arm[2].max(), high - arm[2].min()
        lower = np.array([*(middle[:2].max(axis=1) - self.link_m), z_low])
        upper = np.array([*(middle[:2].min(axis=1) + self.link_m), z_high])
        return lower, np.maximum(upper, lower)

    def workspace(
        self,
        orientation: ArrayLike = (0.0, 0.0, 0.0),
        method: SpatialMethod = "polar",
        *,
        samples: int = 200_000,
        seed: int = 0,
    ) -> SpatialWorkspace:
        """The reachable positions at one orientation (alpha, beta, gamma); see ``spatial_workspace`` for methods."""
        lower, upper = self.box(orientation)
        return spatial_workspace(self.reachable_at(orientation), lower, upper, method, samples, seed)

    def reachable_at(self, orientation: ArrayLike = (0.0, 0.0, 0.0)) -> Reachable:
        """``reachable`` as a function of positions (n, 3) alone, at one orientation."""
        angles = as_points(orientation, 3, "orientation")

        def reachable(position: Array) -> np.ndarray:
            pose = np.concatenate([position, np.broadcast_to(angles, position.shape)], axis=-1)
            return self.reachable(pose)

        return reachable

    def _legs(self, pose: ArrayLike) -> tuple[Array, Legs]:
        poses = as_points(pose, 6, "pose")
        columns = np.ascontiguousarray(poses.reshape(-1, 6).T)
        with np.errstate(invalid="ignore"):
            return poses, pose_legs(columns, self.link_m, 0.5 * self.base_diameter_m, self.platform_radius_m)

    def _margins_kernel(self, pose: Array, table: Array) -> None:
        legs = pose_legs(pose, self.link_m, 0.5 * self.base_diameter_m, self.platform_radius_m)
        limits = self.slider_range_m, self.cone_rad, self.link_clearance_m, self.min_platform_lock
        write_margins(legs, table, self.link_m, self.platform_radius_m, *limits)
