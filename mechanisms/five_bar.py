"""The planar five-bar that carries the safflower picker's cutting head."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .batching import Array, as_points, in_chunks
from .errors import UnreachablePoseError, positive_length
from .geometry import segment_distance
from .workspace import Method, PlanarWorkspace, planar_workspace

_HANGING = -0.5 * np.pi
_NEAR_UPRIGHT = 1e-6


class Conditioning(NamedTuple):
    """Singular values of a dimensionally homogeneous Jacobian, each of shape (...)."""

    number: Array
    smallest: Array
    largest: Array


class FiveBarChains(NamedTuple):
    """Every joint of a posed five-bar, shape (..., 2) each, in the paper's letters (Fig. 3)."""

    b: Array
    c: Array
    d: Array
    e: Array
    q: Array
    """Angles of the driven-by-motor arms (q1, q4), radians."""
    q_passive: Array
    """Angles of the forearms (q2, q3), radians."""


@dataclass(frozen=True)
class FiveBar:
    """Two-degree-of-freedom planar five-bar A-B-C-T-D-E-F after the safflower paper, eqs 1-34 with their corrections.

    The motors sit at A = (0, 0) and F = (base, 0); the arms AB and FE are driven, the forearms BC and ED carry the
    platform CD, which stays level, and the tool centre T lies ``tool_drop_m`` below the middle of CD. The tool hangs
    below the motors, elbows outwards. Positions are T = (x, y) in metres, x across the row, y upwards. Joint angles
    (q1, q4) are measured anticlockwise from +x in the open range (-3/2 pi, pi/2), so that nothing wraps while an arm
    swings about the hanging direction.

    Attributes:
        arm_m: driven arms, (l1, l6).
        forearm_m: forearms, (l2, l5).
        half_platform_m: half the platform's width, l3.
        tool_drop_m: tool centre below the platform joints, l4.
        base_m: distance of the motors, l7.
        arm_range_rad: lower and upper limit of q1; q4 has the mirrored range.
        min_forearm_angle_rad: smallest angle between the forearms' lines (distance to the parallel singularity).
        min_elbow_angle_rad: smallest angle between arm and forearm lines (distance to the serial singularity).
        link_clearance_m: smallest distance between links that do not share a joint.
    """

    arm_m: tuple[float, float]
    forearm_m: tuple[float, float]
    half_platform_m: float
    tool_drop_m: float
    base_m: float
    arm_range_rad: tuple[float, float] = (np.deg2rad(-175.0), np.deg2rad(-75.0))
    min_forearm_angle_rad: float = np.deg2rad(20.0)
    min_elbow_angle_rad: float = np.deg2rad(10.0)
    link_clearance_m: float = 0.02

    def __post_init__(self) -> None:
        """Check the lengths and limits."""
        positive_length(l1=self.arm_m[0], l2=self.forearm_m[0], l5=self.forearm_m[1], l6=self.arm_m[1], l7=self.base_m)
        for name in ("half_platform_m", "tool_drop_m", "link_clearance_m"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} = {getattr(self, name)} m: give a length >= 0")
        for name in ("min_forearm_angle_rad", "min_elbow_angle_rad"):
            if not 0.0 <= getattr(self, name) < np.pi / 2:
                raise ValueError(f"{name} = {getattr(self, name)} rad: allowed range [0, pi/2)")
        low, high = self.arm_range_rad
        if not 3.0 * _HANGING < low < high < np.pi / 2:
            raise ValueError(f"arm_range_rad = {self.arm_range_rad}: need -3/2 pi < lower < upper < pi/2")

    @classmethod
    def safflower(cls) -> FiveBar:
        """The picker's geometry.

        l1 = l6 = 175 mm, l2 = l5 = 350 mm and l7 - 2 l3 = 500 mm are identified from the paper's workspace (an
        equilateral triangle of side 0.35 m, Fig. 6) and Table 1; how the 500 mm split into l7 and l3, and l4, do not
        change the motion and are assumed.
        """
        return cls.from_lengths(0.175, 0.350, 0.040, 0.060, 0.350, 0.175, 0.580)

    @classmethod
    def from_lengths(
        cls, l1: float, l2: float, l3: float, l4: float, l5: float, l6: float, l7: float, **limits: object
    ) -> FiveBar:
        """Build from the paper's link names (metres); ``limits`` are the keyword limits of the class."""
        return replace(cls((l1, l6), (l2, l5), l3, l4, l7), **limits)  # type: ignore[arg-type]

    def inverse(self, position: ArrayLike, *, strict: bool = False) -> Array:
        """Joint angles for tool positions (paper eqs 1-13).

        Written as the half-angle root of the loop equation about the hanging direction: one square root and one
        arctangent a leg, no iteration.

        Args:
            position: (..., 2), metres.
            strict: raise for a pose beyond any limit instead of returning NaN where the links cannot close.

        Returns:
            (..., 2) angles (q1, q4), radians; NaN where a leg cannot reach.

        Raises:
            UnreachablePoseError: only with ``strict``; names the limit.
        """
        points = as_points(position, 2, "position")
        joints = in_chunks(self._inverse_kernel, points, 2)
        if strict:
            self._raise_beyond_limits(points)
        return joints

    def forward(self, joints: ArrayLike) -> Array:
        """Tool positions for joint angles: the lower intersection of the forearms' circles (paper eqs 23-28).

        Args:
            joints: (..., 2) angles (q1, q4), radians.

        Returns:
            (..., 2) positions, metres; NaN where the forearms do not meet.
        """
        q = as_points(joints, 2, "joints")
        b, e = self._elbows(q)
        b = b + np.array([self.half_platform_m, 0.0])
        e = e - np.array([self.half_platform_m, 0.0])
        l2, l5 = self.forearm_m
        across = e - b
        square = np.sum(across * across, axis=-1)
        along = 0.5 * (1.0 + (l2 * l2 - l5 * l5) / square)
        with np.errstate(invalid="ignore"):
            height = np.sqrt(l2 * l2 / square - along * along)
        x = b[..., 0] + along * across[..., 0] + height * across[..., 1]
        y = b[..., 1] + along * across[..., 1] - height * across[..., 0]
        return np.stack([x, y - self.tool_drop_m], axis=-1)

    def chains(self, position: ArrayLike) -> FiveBarChains:
        """All joint positions and angles at tool positions (..., 2); NaN where unreachable."""
        t = as_points(position, 2, "position")
        q = self.inverse(t)
        b, e = self._elbows(q)
        c = t + np.array([-self.half_platform_m, self.tool_drop_m])
        d = t + np.array([self.half_platform_m, self.tool_drop_m])
        q2 = np.arctan2(c[..., 1] - b[..., 1], c[..., 0] - b[..., 0])
        q3 = np.arctan2(d[..., 1] - e[..., 1], d[..., 0] - e[..., 0])
        return FiveBarChains(b, c, d, e, q, np.stack([q2, q3], axis=-1))

    def jacobian(self, position: ArrayLike) -> Array:
        """J of joint rates = J @ tool velocity (corrected eq. 18), shape (..., 2, 2), rad/m."""
        return self._jacobian(self.chains(position))

    def joint_rates(self, position: ArrayLike, velocity: ArrayLike) -> Array:
        """Joint rates (..., 2) in rad/s for tool velocities (..., 2) in m/s (corrected eq. 17)."""
        return _apply(self.jacobian(position), as_points(velocity, 2, "velocity"))

    def pose_rates(self, position: ArrayLike, joint_rates: ArrayLike) -> Array:
        """Tool velocities (..., 2) in m/s for joint rates (..., 2) in rad/s (corrected eqs 19-20)."""
        return _solve(self.jacobian(position), as_points(joint_rates, 2, "joint_rates"))

    def joint_accelerations(self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> Array:
        """Joint accelerations (..., 2) in rad/s2 (corrected eq. 22).

        Args:
            position: (..., 2), metres.
            velocity: (..., 2), m/s.
            acceleration: (..., 2), m/s2.
        """
        chains = self.chains(position)
        v, a = as_points(velocity, 2, "velocity"), as_points(acceleration, 2, "acceleration")
        rates = _apply(self._jacobian(chains), v)
        arm, forearm = np.array(self.arm_m), np.array(self.forearm_m)
        q, passive = chains.q, chains.q_passive
        # The forearm's own rate is what the tool velocity leaves across it once the elbow's motion is taken off.
        across = -np.sin(passive) * v[..., :1] + np.cos(passive) * v[..., 1:]
        passive_rates = (across - arm * rates * np.cos(passive - q)) / forearm
        along = np.cos(passive) * a[..., :1] + np.sin(passive) * a[..., 1:]
        push = along + arm * rates**2 * np.cos(q - passive) + forearm * passive_rates**2
        return push / (arm * np.sin(passive - q))

    def statics(self, position: ArrayLike, force: ArrayLike) -> Array:
        """Motor torques (..., 2) in N m that hold a force (..., 2) in N applied to the tool (virtual work)."""
        transposed = np.swapaxes(self.jacobian(position), -1, -2)
        return -_solve(transposed, as_points(force, 2, "force"))

    def transmission_angles(self, position: ArrayLike) -> Array:
        """Angles (..., 3) in [0, pi/2] rad: elbow B (q2 - q1), elbow E (q3 - q4), between the forearms (q3 - q2).

        The first two vanish at the serial singularities (eq. 30), the third at the parallel one, which eq. 30 lacks.
        """
        return self._transmission_angles(self.chains(position))

    def margins(self, position: ArrayLike) -> dict[str, Array]:
        """Signed distance (...) to every limit by name, negative outside; NaN where the links cannot close.

        ``leg1_reach``, ``leg1_fold`` and their leg-2 twins are metres and always defined; ``q1_lower``, ``q1_upper``,
        ``q4_lower``, ``q4_upper``, ``elbow1``, ``elbow2`` (serial singularity) and ``forearms`` (parallel singularity)
        are radians; ``clearance`` is metres between links that share no joint.
        """
        points = as_points(position, 2, "position")
        chains = self.chains(points)
        result: dict[str, Array] = {}
        for leg, (wrist, motor) in enumerate(((chains.c, 0.0), (chains.d, self.base_m))):
            distance = np.hypot(wrist[..., 0] - motor, wrist[..., 1])
            result[f"leg{leg + 1}_reach"] = self.arm_m[leg] + self.forearm_m[leg] - distance
            result[f"leg{leg + 1}_fold"] = distance - abs(self.arm_m[leg] - self.forearm_m[leg])
        low, high = self.arm_range_rad
        q1, q4 = chains.q[..., 0], chains.q[..., 1]
        result |= {"q1_lower": q1 - low, "q1_upper": high - q1}
        result |= {"q4_lower": q4 + np.pi + high, "q4_upper": -np.pi - low - q4}
        angles = self._transmission_angles(chains)
        result["elbow1"] = angles[..., 0] - self.min_elbow_angle_rad
        result["elbow2"] = angles[..., 1] - self.min_elbow_angle_rad
        # Signed: a tool above the line BE would have its forearms crossed, the assembly mode that forward() excludes.
        crossing = np.sin(chains.q_passive[..., 0] - chains.q_passive[..., 1])
        result["forearms"] = np.copysign(angles[..., 2], crossing) - self.min_forearm_angle_rad
        result["clearance"] = self._clearance(chains) - self.link_clearance_m
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
        determinant = np.abs(_determinant(j))
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(np.maximum(square * square - 4.0 * determinant * determinant, 0.0))
            largest_inverse = np.sqrt(0.5 * (square + root))
            smallest_inverse = determinant / largest_inverse
            return Conditioning(largest_inverse / smallest_inverse, 1.0 / largest_inverse, 1.0 / smallest_inverse)

    def pose_error(self, position: ArrayLike, joint_error: ArrayLike) -> Array:
        """Tool displacement (..., 2) in metres when the motors are off by ``joint_error`` (..., 2) rad (eq. 33)."""
        points = as_points(position, 2, "position")
        return self.forward(self.inverse(points) + as_points(joint_error, 2, "joint_error")) - points

    def workspace(self, method: Method = "monte-carlo", *, samples: int = 200_000, seed: int = 0) -> PlanarWorkspace:
        """The reachable region: points, area and outline (paper Fig. 6); see ``planar_workspace`` for the methods."""
        reach = max(a + f for a, f in zip(self.arm_m, self.forearm_m, strict=True)) + self.half_platform_m
        lower = (-reach, -reach - self.tool_drop_m)
        upper = (self.base_m + reach, reach - self.tool_drop_m)
        return planar_workspace(self.reachable, lower, upper, method, samples, seed)

    def _inverse_kernel(self, position: Array, joints: Array) -> None:
        """Half-angle root of the loop closure: with phi = q + pi/2 and t = tan(phi/2), one quadratic in t a leg."""
        y = position[1] + self.tool_drop_m
        y_square = y * y
        for leg, (offset, side) in enumerate(
            ((-self.half_platform_m, 1.0), (self.half_platform_m - self.base_m, -1.0))
        ):
            arm, forearm = self.arm_m[leg], self.forearm_m[leg]
            x = position[0] + offset
            square = x * x
            square += y_square
            reach = square * (0.5 / arm)
            reach += (arm * arm - forearm * forearm) * (0.5 / arm)
            np.multiply(reach, reach, out=joints[leg])
            square -= joints[leg]
            np.sqrt(square, out=square)
            if side < 0.0:
                np.negative(square, out=square)
            square -= x
            denominator = np.subtract(y, reach, out=reach)
            nearest = np.abs(denominator).min() if denominator.size else 1.0
            np.divide(square, denominator, out=square)
            np.arctan(square, out=square)
            np.multiply(square, 2.0, out=joints[leg])
            joints[leg] += _HANGING
            if not nearest > _NEAR_UPRIGHT:
                self._mend_upright(x, y, denominator, leg, side, joints[leg])

    def _mend_upright(self, x: Array, y: Array, denominator: Array, leg: int, side: float, joints: Array) -> None:
        """Where an arm points straight up the half-angle quotient is 0/0: build the elbow and take its direction."""
        rows = np.flatnonzero(np.abs(denominator) <= _NEAR_UPRIGHT)
        if len(rows) == 0:
            return
        px, py, arm, forearm = x[rows], y[rows], self.arm_m[leg], self.forearm_m[leg]
        square = px * px + py * py
        along = 0.5 * (square + arm * arm - forearm * forearm) / square
        height = side * np.sqrt(arm * arm / square - along * along)
        angle = np.arctan2(along * py - height * px, along * px + height * py)
        joints[rows] = np.where(angle > np.pi / 2, angle - 2.0 * np.pi, angle)

    def _elbows(self, q: Array) -> tuple[Array, Array]:
        directions = np.stack([np.cos(q), np.sin(q)], axis=-1)
        base = np.array([self.base_m, 0.0])
        return self.arm_m[0] * directions[..., 0, :], base + self.arm_m[1] * directions[..., 1, :]

    def _jacobian(self, chains: FiveBarChains) -> Array:
        directions = np.stack([np.cos(chains.q_passive), np.sin(chains.q_passive)], axis=-1)
        with np.errstate(divide="ignore"):
            return directions / (np.array(self.arm_m) * np.sin(chains.q_passive - chains.q))[..., None]

    def _transmission_angles(self, chains: FiveBarChains) -> Array:
        q2, q3 = chains.q_passive[..., 0], chains.q_passive[..., 1]
        between = np.concatenate([chains.q_passive - chains.q, (q3 - q2)[..., None]], axis=-1)
        return np.arcsin(np.minimum(np.abs(np.sin(between)), 1.0))

    def _clearance(self, chains: FiveBarChains) -> Array:
        a = np.zeros(2)
        f = np.array([self.base_m, 0.0])
        a, f = np.broadcast_to(a, chains.b.shape), np.broadcast_to(f, chains.b.shape)
        pairs = (
            (a, chains.b, f, chains.e),
            (a, chains.b, chains.d, chains.e),
            (f, chains.e, chains.b, chains.c),
        )
        return np.min(np.stack([segment_distance(*pair) for pair in pairs]), axis=0)

    def _raise_beyond_limits(self, points: Array) -> None:
        for name, margin in self.margins(points).items():
            # NaN margins belong to legs that cannot close, which a reach or fold limit has already named.
            bad = np.argwhere(margin < 0.0)
            if len(bad):
                index = tuple(int(i) for i in bad[0])
                raise UnreachablePoseError("FiveBar", points[index].tolist(), name, float(margin[index]), index)


def _determinant(matrix: Array) -> Array:
    return matrix[..., 0, 0] * matrix[..., 1, 1] - matrix[..., 0, 1] * matrix[..., 1, 0]


def _apply(matrix: Array, vector: Array) -> Array:
    return np.sum(matrix * vector[..., None, :], axis=-1)


def _solve(matrix: Array, vector: Array) -> Array:
    determinant = _determinant(matrix)
    x = matrix[..., 1, 1] * vector[..., 0] - matrix[..., 0, 1] * vector[..., 1]
    y = matrix[..., 0, 0] * vector[..., 1] - matrix[..., 1, 0] * vector[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack([x, y], axis=-1) / determinant[..., None]
