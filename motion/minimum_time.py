"""The fastest motion along a given path under limits on speed, acceleration and jerk in tool space.

With the arc length s, the squared speed z = (ds/dt)^2 and the curvature k, the acceleration is z'/2 along the path and
k z across it. |v| <= V and |a| <= A then read z <= min(V^2, A / k) and |z'| <= 2 sqrt(A^2 - k^2 z^2): a slope field
whose highest solution from rest to rest is found by one sweep forwards and one backwards over s (Bobrow 1985).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from .curves import CurvedPath, Line
from .laws import Array, MotionSample
from .paths import PathSample
from .profiles import SCurve


@dataclass(frozen=True)
class PathMotion:
    """A motion along a path: between nodes the tangential acceleration is a linear function of time.

    Attributes:
        path: the curve.
        time_s: of the nodes, (n,), increasing from 0.
        arc_m: arc lengths at the nodes, (n,).
        speed: ds/dt at the nodes, (n,), m/s.
        acceleration: d2s/dt2 just after each node but the last, (n - 1,), m/s2.
        jerk: d3s/dt3 between the nodes, (n - 1,), m/s3.
    """

    path: CurvedPath
    time_s: Array
    arc_m: Array
    speed: Array
    acceleration: Array
    jerk: Array

    @property
    def duration_s(self) -> float:
        """Time of the whole path."""
        return float(self.time_s[-1])

    def along(self, time_s: ArrayLike) -> MotionSample:
        """Arc length and its derivatives at times (n,), held at the ends."""
        time = np.clip(np.atleast_1d(np.asarray(time_s, dtype=np.float64)), 0.0, self.duration_s)
        node = np.clip(np.searchsorted(self.time_s, time, side="right") - 1, 0, len(self.time_s) - 2)
        t, v, a, j = time - self.time_s[node], self.speed[node], self.acceleration[node], self.jerk[node]
        inside = (time > 0.0) & (time < self.duration_s)
        return MotionSample(
            np.clip(self.arc_m[node] + ((j / 6.0 * t + 0.5 * a) * t + v) * t, 0.0, self.path.length_m),
            np.where(inside, v + (a + 0.5 * j * t) * t, 0.0),
            np.where(inside, a + j * t, 0.0),
            np.where(inside, j, 0.0),
        )

    def sample(self, time_s: ArrayLike) -> PathSample:
        """State at times (n,), held at the ends."""
        along = self.along(time_s)
        point = self.path.at(along.position)
        speed, push = along.velocity[:, None], along.acceleration[:, None]
        return PathSample(point.position, speed * point.tangent, push * point.tangent + speed**2 * point.bend)

    def slowed(self, factor: float) -> PathMotion:
        """The same motion in ``factor`` times the time."""
        return PathMotion(
            self.path,
            self.time_s * factor,
            self.arc_m,
            self.speed / factor,
            self.acceleration / factor**2,
            self.jerk / factor**3,
        )


def minimum_time(
    path: CurvedPath,
    velocity_limit: float,
    acceleration_limit: float,
    jerk_limit: float = np.inf,
    *,
    nodes: int = 200,
) -> PathMotion:
    """The fastest motion from rest to rest along ``path`` under limits on the tool's |v|, |a| and |jerk|.

    The tool stops at sharp joints. Straight stretches between stops are exact (``SCurve``). Curved ones without a jerk
    limit are optimal up to the discretisation, on its safe side: a step respects the acceleration limit at its tightest
    (at 200 steps a segment below 0.1 % slow on rounded gates, 0.3 % on tightly winding curves).
    With a jerk limit a curved stretch takes the optimal motion under |v| and |a|, averaged over a window of time and
    slowed until all limits hold, with the best window: feasible, but not proven the fastest.

    Args:
        path: see ``rounded`` and ``polyline``.
        velocity_limit: m/s, > 0.
        acceleration_limit: m/s2, > 0.
        jerk_limit: m/s3, > 0.
        nodes: steps a segment.

    Raises:
        ValueError: a limit is not positive, there are too few steps, or the jerk is limited on a path whose
            curvature jumps.
    """
    limits = {"velocity_limit": velocity_limit, "acceleration_limit": acceleration_limit, "jerk_limit": jerk_limit}
    for name, limit in limits.items():
        if not limit > 0.0:
            raise ValueError(f"{name} = {limit} must be positive")
    if nodes < 2:
        raise ValueError(f"nodes = {nodes}: give at least 2 steps a segment")
    if np.isfinite(jerk_limit) and np.any(path.kinked & ~path.sharp):
        joint = int(np.flatnonzero(path.kinked & ~path.sharp)[0])
        raise ValueError(
            f"the curvature jumps at s = {path.offsets[joint + 1]:.4g} m, where a moving tool's jerk is infinite: "
            'round the corners with blend="smooth", or set no jerk_limit'
        )
    bounds = [0, *(np.flatnonzero(path.sharp) + 1), len(path.segments)]
    stretches = []
    for first, last in pairwise(bounds):
        stretch = CurvedPath(path.segments[first:last])
        if all(isinstance(segment, Line) for segment in stretch.segments):
            stretches.append(_straight(stretch, velocity_limit, acceleration_limit, jerk_limit))
            continue
        motion = _swept(stretch, velocity_limit, acceleration_limit, jerk_limit, nodes)
        if np.isfinite(jerk_limit):
            motion = _smoothed(motion, velocity_limit, acceleration_limit, jerk_limit)
        stretches.append(motion)
    return _joined(path, stretches)


def squared_speeds(
    steps_m: Array, curvature: Array, rest: np.ndarray, speed_limit: ArrayLike, acceleration_limit: ArrayLike
) -> Array:
    """Highest feasible squared speeds at the nodes; batched over leading axes.

    Args:
        steps_m: (..., n) arc lengths of the steps; zero steps are allowed.
        curvature: (..., n) in 1/m, the tightest of each step.
        rest: (..., n + 1) nodes at which the tool stops.
        speed_limit: (..., n + 1) at the nodes, m/s.
        acceleration_limit: (...), m/s2.

    Returns:
        (..., n + 1) in m2/s2.
    """
    a = np.asarray(acceleration_limit, dtype=np.float64)
    ceiling = np.square(np.broadcast_to(speed_limit, rest.shape))
    with np.errstate(divide="ignore"):
        by_bend = a[..., None] / curvature
    ceiling[..., :-1] = np.minimum(ceiling[..., :-1], by_bend)
    ceiling[..., 1:] = np.minimum(ceiling[..., 1:], by_bend)
    ceiling[rest] = 0.0
    gain = 2.0 * steps_m * a[..., None]
    swing = 1.0 + (2.0 * steps_m * curvature) ** 2
    if ceiling.ndim == 1:
        _sweep_one(ceiling, gain, swing)
    else:
        for node in range(gain.shape[-1]):
            reached = _climb(ceiling[..., node], gain[..., node], swing[..., node])
            np.minimum(ceiling[..., node + 1], reached, out=ceiling[..., node + 1])
        for node in range(gain.shape[-1] - 1, -1, -1):
            reached = _climb(ceiling[..., node + 1], gain[..., node], swing[..., node])
            np.minimum(ceiling[..., node], reached, out=ceiling[..., node])
    return ceiling


def _climb(z: Array, gain: Array, swing: Array) -> Array:
    """Squared speed after a step whose acceleration just meets the limit at the faster end.

    The larger root of (y - z)^2 + (2 h k y)^2 = (2 h A)^2 with gain = 2 h A and swing = 1 + (2 h k)^2.
    """
    return (z + np.sqrt(np.maximum(z * z - swing * (z * z - gain * gain), 0.0))) / swing


def _sweep_one(ceiling: Array, gain: Array, swing: Array) -> None:
    """The two sweeps for a single path in plain floats, which are several times faster than array scalars."""
    z, gains, swings = ceiling.tolist(), gain.tolist(), swing.tolist()
    for order, ahead, behind in ((range(len(gains)), 1, 0), (range(len(gains) - 1, -1, -1), 0, 1)):
        for node in order:
            low, g, w = z[node + behind], gains[node], swings[node]
            reached = (low + max(low * low - w * (low * low - g * g), 0.0) ** 0.5) / w
            if reached < z[node + ahead]:
                z[node + ahead] = reached
    ceiling[:] = z


def _swept(
    path: CurvedPath, velocity_limit: float, acceleration_limit: float, jerk_limit: float, nodes: int
) -> PathMotion:
    """A stretch without stops, optimal under |v|, |a| and the jerk that its bends alone cause."""
    share = np.linspace(0.0, 1.0, nodes + 1)
    # Nodes and the middles between them.
    bends = [segment.at(np.linspace(0.0, segment.length_m, 2 * nodes + 1)).bend for segment in path.segments]
    starts = path.offsets[:-1, None] + share[:-1] * np.diff(path.offsets)[:, None]
    arc = np.append(starts.ravel(), path.length_m)
    # A step has the tightest curvature of its ends and middle; at a joint each side sees its own segment.
    curvature = np.concatenate(
        [np.maximum(np.maximum(k[:-2:2], k[1::2]), k[2::2]) for k in (np.linalg.norm(b, axis=-1) for b in bends)]
    )
    speed_limit = np.full(len(arc), velocity_limit)
    if np.isfinite(jerk_limit):
        twist = np.concatenate([np.linalg.norm(np.diff(b[::2], axis=0), axis=-1) for b in bends]) / np.diff(arc)
        with np.errstate(divide="ignore"):
            by_twist = np.cbrt(jerk_limit / twist)
        speed_limit[:-1] = np.minimum(speed_limit[:-1], by_twist)
        speed_limit[1:] = np.minimum(speed_limit[1:], by_twist)
    rest = np.zeros(len(arc), dtype=bool)
    rest[[0, -1]] = True
    speed = np.sqrt(squared_speeds(np.diff(arc), curvature, rest, speed_limit, np.float64(acceleration_limit)))
    steps = 2.0 * np.diff(arc) / (speed[:-1] + speed[1:])
    time = np.concatenate([[0.0], np.cumsum(steps)])
    return PathMotion(path, time, arc, speed, np.diff(speed) / steps, np.zeros(len(steps)))


def _straight(path: CurvedPath, velocity_limit: float, acceleration_limit: float, jerk_limit: float) -> PathMotion:
    """A straight stretch: the S-curve's phases are the nodes."""
    curve = SCurve.under_limits(path.length_m, velocity_limit, acceleration_limit, jerk_limit)
    ramp, hold, cruise = float(curve.ramp_s), float(curve.hold_s), float(curve.cruise_s)
    a, j = float(curve.peak_acceleration), float(curve.peak_jerk)
    phases = np.array(
        [
            (ramp, 0.0, j),
            (hold, a, 0.0),
            (ramp, a, -j),
            (cruise, 0.0, 0.0),
            (ramp, 0.0, -j),
            (hold, -a, 0.0),
            (ramp, -a, j),
        ]
    )
    return _integrated(path, *phases[phases[:, 0] > 0.0].T)


def _integrated(path: CurvedPath, steps_s: Array, acceleration: Array, jerk: Array) -> PathMotion:
    """Nodes from steps of linear tangential acceleration, closed on the path's length against rounding."""
    speed = np.concatenate([[0.0], np.cumsum((acceleration + 0.5 * jerk * steps_s) * steps_s)])
    gains = ((jerk / 6.0 * steps_s + 0.5 * acceleration) * steps_s + speed[:-1]) * steps_s
    arc = np.concatenate([[0.0], np.cumsum(gains)])
    closing = path.length_m / arc[-1]
    time = np.concatenate([[0.0], np.cumsum(steps_s)])
    return PathMotion(path, time, arc * closing, speed * closing, acceleration * closing, jerk * closing)


def _smoothed(motion: PathMotion, velocity_limit: float, acceleration_limit: float, jerk_limit: float) -> PathMotion:
    """The best of the window averages of ``motion``, each slowed until it respects the limits."""
    shape = _shape(motion.path)

    def candidate(window_s: float) -> PathMotion:
        averaged = _averaged(motion, window_s)
        velocity, acceleration, jerk = _peaks(averaged, shape)
        factors = velocity / velocity_limit, np.sqrt(acceleration / acceleration_limit), np.cbrt(jerk / jerk_limit)
        return averaged.slowed(max(factors) * (1.0 + 1e-5))

    low, high = 1e-3 * motion.duration_s, motion.duration_s
    best = motion
    for _ in range(3):
        windows = np.geomspace(low, high, 9)
        tried = [candidate(float(window)) for window in windows]
        index = int(np.argmin([one.duration_s for one in tried]))
        low, high, best = windows[max(index - 1, 0)], windows[min(index + 1, len(windows) - 1)], tried[index]
    return best


def _shape(path: CurvedPath) -> Array:
    """Rows s, curvature k, dk/ds and curvature times torsion on a fine grid, each joint from both sides."""
    columns = []
    for offset, segment in zip(path.offsets, path.segments, strict=False):
        s = np.linspace(0.0, segment.length_m, 401)
        point = segment.at(s)
        twist = np.gradient(point.bend, s, axis=0, edge_order=2)
        k = np.linalg.norm(point.bend, axis=-1)
        square = np.sum(twist * twist, axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.where(k > 1e-9, np.sum(twist * point.bend, axis=-1) / k, np.sqrt(square))
        columns.append(np.stack([offset + s, k, slope, np.sqrt(np.maximum(square - k**4 - slope**2, 0.0))]))
    return np.concatenate(columns, axis=1)


def _peaks(motion: PathMotion, shape: Array) -> tuple[float, float, float]:
    """Largest |v|, |a| and |jerk| of the tool, in the Frenet frame of the path (see ``_shape``)."""
    # Every node is looked at from both sides, and so is every point of the shape's grid.
    s = np.concatenate([shape[0], motion.arc_m])
    k, slope, turn = (np.concatenate([row, np.interp(motion.arc_m, shape[0], row)]) for row in shape[1:])
    v = np.sqrt(np.interp(s, motion.arc_m, motion.speed**2))
    a = np.interp(s, motion.arc_m, np.append(motion.acceleration, 0.0))
    jerk = 0.0
    for side in ("left", "right"):
        step = np.clip(np.searchsorted(motion.arc_m, s, side=side) - 1, 0, len(motion.jerk) - 1)
        along = motion.jerk[step] - v**3 * k**2
        across = 3.0 * v * a * k + v**3 * slope
        jerk = max(jerk, float(np.max(along**2 + across**2 + (v**3 * turn) ** 2)))
    return float(np.max(v)), float(np.sqrt(np.max(a**2 + (v**2 * k) ** 2))), float(np.sqrt(jerk))


def _averaged(motion: PathMotion, window_s: float) -> PathMotion:
    """Arc length averaged over the last ``window_s``: the acceleration becomes continuous, its slope bounded."""
    breaks = np.unique(np.concatenate([motion.time_s, motion.time_s + window_s]))
    breaks = breaks[np.append(True, np.diff(breaks) > 1e-12 * motion.duration_s)]

    def speed_at(time: Array) -> Array:
        return np.interp(time, motion.time_s, motion.speed, left=0.0, right=0.0)

    acceleration = (speed_at(breaks) - speed_at(breaks - window_s)) / window_s
    steps = np.diff(breaks)
    return _integrated(motion.path, steps, acceleration[:-1], np.diff(acceleration) / steps)


def _joined(path: CurvedPath, motions: list[PathMotion]) -> PathMotion:
    starts_s = np.concatenate([[0.0], np.cumsum([motion.duration_s for motion in motions])])
    starts_m = np.concatenate([[0.0], np.cumsum([motion.path.length_m for motion in motions])])

    def nodes(field: str, starts: Array | None = None) -> Array:
        shifted = [getattr(m, field)[:-1] + (0.0 if starts is None else starts[i]) for i, m in enumerate(motions)]
        last = getattr(motions[-1], field)[-1] + (0.0 if starts is None else starts[len(motions) - 1])
        return np.append(np.concatenate(shifted), last)

    return PathMotion(
        path,
        nodes("time_s", starts_s),
        nodes("arc_m", starts_m),
        nodes("speed"),
        np.concatenate([motion.acceleration for motion in motions]),
        np.concatenate([motion.jerk for motion in motions]),
    )
