"""Gate paths, up, across and down, and the ways of moving along them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .curves import Bezier, CurvedPath, Line, Segment, polyline, rounded
from .laws import QUINTIC, SEPTIC, Array, MotionLaw
from .minimum_time import PathMotion, minimum_time, squared_speeds
from .paths import PathSample, StoppedPath, gate_corners

GateStyle = Literal["stop-quintic", "stop-septic", "stop-fastest", "blended", "time-optimal"]
GATE_STYLES: tuple[GateStyle, ...] = ("stop-quintic", "stop-septic", "stop-fastest", "blended", "time-optimal")

_LAWS = {"stop-quintic": QUINTIC, "stop-septic": SEPTIC}


@dataclass(frozen=True)
class Gate:
    """A way of carrying something over a gate path under limits on the tool's |v| and |a|.

    Attributes:
        style: ``"stop-quintic"`` and ``"stop-septic"`` rest at both upper corners with that law on every leg;
            ``"stop-fastest"`` rests there too, on minimum-time legs; ``"blended"`` rounds the corners with the largest
            circle that ``straight_m`` and ``radius_m`` allow; ``"time-optimal"`` rises and falls straight over
            ``straight_m`` and takes, between, the fastest pair of Bezier curves over the top level.
        velocity_limit: m/s.
        acceleration_limit: m/s2.
        straight_m: straight rise at the start and straight fall at the end (what a plug or a cup needs).
        radius_m: largest corner radius of ``"blended"``.
    """

    style: GateStyle
    velocity_limit: float
    acceleration_limit: float
    straight_m: float = 0.0
    radius_m: float = np.inf

    def __post_init__(self) -> None:
        """Check style, limits and lengths."""
        if self.style not in GATE_STYLES:
            raise ValueError(f"style {self.style!r} is unknown: choose from {', '.join(GATE_STYLES)}")
        for name in ("velocity_limit", "acceleration_limit", "radius_m"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} = {getattr(self, name)} must be positive")
        if not 0.0 <= self.straight_m < np.inf:
            raise ValueError(f"straight_m = {self.straight_m} m: give a length >= 0")

    def path(self, start: ArrayLike, end: ArrayLike, height: float) -> CurvedPath:
        """The curve from ``start`` to ``end`` (2,) over the absolute level ``height``, metres.

        Raises:
            ValueError: the level lies below an end, or the ends are the same point at that level.
        """
        corners = gate_corners(start, end, height)
        rise, fall = float(corners[1, 1] - corners[0, 1]), float(corners[2, 1] - corners[3, 1])
        across = float(abs(corners[2, 0] - corners[1, 0]))
        if min(rise, fall) < 0.0:
            raise ValueError(f"height = {height} m lies below an end of the gate: raise it by {-min(rise, fall):.4g} m")
        room = min(rise, fall) - self.straight_m
        if self.style.startswith("stop") or room <= 0.0 or across == 0.0:
            return polyline(corners)
        if self.style == "blended":
            return rounded(corners, min(room, 0.5 * across, self.radius_m))
        handles = _fastest_handles(rise, across, fall, self.straight_m, self.velocity_limit, self.acceleration_limit)
        controls = _controls(rise, across, fall, self.straight_m, np.array(handles))
        # The search works on a gate that starts at the origin and runs to the right.
        mirror = np.array([1.0 if corners[2, 0] >= corners[1, 0] else -1.0, 1.0])
        first, second = (corners[0] + mirror * half for half in controls)
        segments: list[Segment] = [Bezier(first), Bezier(second)]
        if self.straight_m > 0.0:
            segments = [Line(corners[0], first[0]), *segments, Line(second[-1], corners[3])]
        return CurvedPath(tuple(segments))

    def motion(self, start: ArrayLike, end: ArrayLike, height: float) -> StoppedPath | PathMotion:
        """The timed motion; both kinds have ``duration_s`` and ``sample(times)``. Arguments as for ``path``."""
        if self.style in _LAWS:
            self.path(start, end, height)  # for its checks
            return StoppedPath.under_limits(
                gate_corners(start, end, height), self.velocity_limit, self.acceleration_limit, _LAWS[self.style]
            )
        return minimum_time(self.path(start, end, height), self.velocity_limit, self.acceleration_limit)

    def durations(self, rise_m: ArrayLike, across_m: ArrayLike, fall_m: ArrayLike) -> Array:
        """Durations in seconds for gates of these strokes; arguments broadcast.

        The laws with stops are computed at once; the others once for each different gate, so a batch over the cells
        of two trays costs as many motions as there are distances.
        """
        strokes = np.broadcast_arrays(*(np.abs(np.asarray(x, dtype=np.float64)) for x in (rise_m, across_m, fall_m)))
        if self.style in _LAWS:
            law = _LAWS[self.style]
            return sum(
                (law.duration(stroke, self.velocity_limit, self.acceleration_limit) for stroke in strokes),
                start=np.zeros(strokes[0].shape),
            )
        rows, back = np.unique(
            np.round(np.stack([stroke.ravel() for stroke in strokes], axis=-1), 9), axis=0, return_inverse=True
        )
        times = np.array([self._duration(*(float(x) for x in row)) for row in rows])
        return times[back.reshape(-1)].reshape(strokes[0].shape)

    def _duration(self, rise: float, across: float, fall: float) -> float:
        if rise == across == fall == 0.0:
            return 0.0
        return self.motion((0.0, 0.0), (across, rise - fall), rise).duration_s


@dataclass(frozen=True)
class OverlappedGate:
    """A gate whose traverse begins before the rise has ended and ends after the fall has begun.

    Rise, traverse and fall each follow the law in their own direction; where they overlap the tool cuts the corner.

    Attributes:
        corners: (4, 2), see ``gate_corners``.
        moving_s: durations of rise, traverse and fall, (3,).
        start_s: instants at which they begin, (3,).
        law: motion law of all three.
    """

    corners: Array
    moving_s: Array
    start_s: Array
    law: MotionLaw = QUINTIC

    @classmethod
    def under_limits(
        cls,
        corners: ArrayLike,
        velocity_limit: float,
        acceleration_limit: float,
        overlap: float,
        law: MotionLaw = QUINTIC,
        *,
        per_axis: bool = False,
    ) -> OverlappedGate:
        """The gate with the last share ``overlap`` of the rise, and the first of the fall, run during the traverse.

        Args:
            corners: (4, 2), metres.
            velocity_limit: m/s.
            acceleration_limit: m/s2.
            overlap: in [0, 1] of the rise's and fall's durations; 0 stops at the corners.
            law: motion law.
            per_axis: let each direction use the whole limit (pick-and-place catalogues count that way). Otherwise the
                motion is slowed as a whole until |v| and |a| of the tool respect the limits.

        Raises:
            ValueError: the overlap is not a share.
        """
        if not 0.0 <= overlap <= 1.0:
            raise ValueError(f"overlap = {overlap} is not a share in [0, 1]")
        points = np.asarray(corners, dtype=np.float64)
        moving = law.duration(np.linalg.norm(np.diff(points, axis=0), axis=-1), velocity_limit, acceleration_limit)
        rise, across, fall = moving
        traverse = (1.0 - overlap) * rise
        start = np.array([0.0, traverse, max(traverse + across - overlap * fall, rise)])
        gate = cls(points, moving, start, law)
        if per_axis:
            return gate
        state = gate.sample(np.linspace(0.0, gate.duration_s, 2001))
        speed, push = (np.max(np.linalg.norm(x, axis=-1)) for x in (state.velocity, state.acceleration))
        factor = max(1.0, float(speed / velocity_limit), float(np.sqrt(push / acceleration_limit)))
        return cls(points, moving * factor, start * factor, law)

    @property
    def duration_s(self) -> float:
        """Time from the first corner to the last."""
        return float(np.max(self.start_s + self.moving_s))

    @property
    def straight_m(self) -> float:
        """Height risen before the traverse begins."""
        stroke = float(np.linalg.norm(self.corners[1] - self.corners[0]))
        return float(self.law.sample(self.start_s[1], stroke, self.moving_s[0]).position)

    def sample(self, time_s: ArrayLike) -> PathSample:
        """State at times (n,), held at the ends."""
        time = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
        legs = np.diff(self.corners, axis=0)
        position = np.broadcast_to(self.corners[0], (len(time), 2)).copy()
        velocity, acceleration = np.zeros_like(position), np.zeros_like(position)
        for leg, begin, duration in zip(legs, self.start_s, self.moving_s, strict=True):
            state = self.law.sample(time - begin, 1.0, duration)
            position += state.position[:, None] * leg
            velocity += state.velocity[:, None] * leg
            acceleration += state.acceleration[:, None] * leg
        return PathSample(position, velocity, acceleration)


_STEPS = 48


@lru_cache(maxsize=4096)
def _fastest_handles(
    rise: float, across: float, fall: float, straight: float, velocity_limit: float, acceleration_limit: float
) -> tuple[float, float, float]:
    """Shares of the handles (up, level, sideways) that make the gate fastest, each in [0, 1]: a narrowing grid."""
    middle, width = np.array([0.5, 0.5, 0.25]), 0.5
    best = (np.inf, (0.5, 0.5, 0.0))
    for _ in range(4):
        ticks = middle[:, None] + width * np.linspace(-1.0, 1.0, 9)
        ticks = np.clip(ticks, [[0.02], [0.02], [0.0]], [[1.0], [0.98], [0.6]])
        # A tool that leaves a straight rise must leave it upwards; without one the first handle may lean.
        sideways = ticks[2, ::2] if straight == 0.0 else np.zeros(1)
        grid = np.stack(np.meshgrid(ticks[0], ticks[1], sideways, indexing="ij"), axis=-1).reshape(-1, 3)
        times = _bezier_durations(rise, across, fall, straight, grid, velocity_limit, acceleration_limit)
        index = int(np.argmin(times))
        if times[index] < best[0]:
            best = (float(times[index]), (float(grid[index, 0]), float(grid[index, 1]), float(grid[index, 2])))
        middle, width = np.array(best[1]), 0.3 * width
    return best[1]


def _controls(rise: float, across: float, fall: float, straight: float, handles: Array) -> tuple[Array, Array]:
    """Control points (..., 4, 2) of the two halves, which meet level over the middle of the traverse."""
    up, level, lean = (handles[..., i] for i in range(3))
    half = 0.5 * across

    def climb(height: float) -> Array:
        room = height - straight
        x = np.stack([np.zeros_like(up), lean * half, (1.0 - level) * half, np.full_like(up, half)], axis=-1)
        y = np.stack([np.full_like(up, straight), straight + up * room, *[np.full_like(up, height)] * 2], axis=-1)
        return np.stack([x, y], axis=-1)

    falling = climb(fall)[..., ::-1, :] * np.array([-1.0, 1.0]) + np.array([across, rise - fall])
    return climb(rise), falling


def _bezier_durations(
    rise: float, across: float, fall: float, straight: float, handles: Array, velocity_limit: float, a_limit: float
) -> Array:
    """Durations (n,) of the gates with these handles (n, 3), on nodes that are uniform in the curves' parameter."""
    edges = np.linspace(0.0, 1.0, _STEPS + 1)
    steps, bends = [], []
    for controls in _controls(rise, across, fall, straight, handles):
        first, second = 3.0 * np.diff(controls, axis=-2), 6.0 * np.diff(controls, n=2, axis=-2)
        speed = np.linalg.norm(_bernstein(edges, 2) @ first, axis=-1)
        middle = np.linalg.norm(_bernstein(0.5 * (edges[1:] + edges[:-1]), 2) @ first, axis=-1)
        steps.append((speed[:, :-1] + 4.0 * middle + speed[:, 1:]) / (6.0 * _STEPS))  # Simpson
        d1, d2 = _bernstein(edges, 2) @ first, _bernstein(edges, 1) @ second
        with np.errstate(divide="ignore", invalid="ignore"):
            bend = np.abs(d1[..., 0] * d2[..., 1] - d1[..., 1] * d2[..., 0]) / speed**3
        bends.append(np.nan_to_num(np.maximum(bend[:, :-1], bend[:, 1:]), nan=0.0))
    if straight > 0.0:
        pieces = np.full((len(handles), _STEPS), straight / _STEPS)
        steps, bends = [pieces, *steps, pieces], [0.0 * pieces, *bends, 0.0 * pieces]
    h = np.concatenate(steps, axis=-1)
    rest = np.zeros((len(handles), h.shape[-1] + 1), dtype=bool)
    rest[:, [0, -1]] = True
    speeds = np.sqrt(
        squared_speeds(h, np.concatenate(bends, axis=-1), rest, velocity_limit, np.full(len(handles), a_limit))
    )
    return np.sum(2.0 * h / (speeds[:, :-1] + speeds[:, 1:]), axis=-1)


def _bernstein(u: Array, degree: int) -> Array:
    """Bernstein polynomials (len(u), degree + 1)."""
    if degree == 1:
        return np.stack([1.0 - u, u], axis=-1)
    return np.stack([(1.0 - u) ** 2, 2.0 * u * (1.0 - u), u * u], axis=-1)
