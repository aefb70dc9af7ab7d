"""Paths as curves of their arc length: straight lines, circular arcs and Bezier curves, joined end to end."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .laws import Array

Blend = Literal["circle", "smooth"]

_SAME_DIRECTION = 1e-9
_SMOOTH_CORNER = (1.0, 0.75, 0.4)


class CurvePoint(NamedTuple):
    """Geometry at arc lengths (n,): each field has shape (n, d)."""

    position: Array
    tangent: Array
    """Unit vector, d position / ds."""
    bend: Array
    """Curvature vector d2 position / ds2, 1/m."""


class Segment(Protocol):
    """A smooth piece of a path."""

    @property
    def length_m(self) -> float:
        """Arc length."""
        ...

    def at(self, s: Array) -> CurvePoint:
        """Geometry at arc lengths (n,) in [0, length]."""
        ...


@dataclass(frozen=True)
class Line:
    """A straight segment from ``start`` to ``end``, each (d,), metres."""

    start: Array
    end: Array

    @property
    def length_m(self) -> float:
        """Distance of the ends."""
        return float(np.linalg.norm(self.end - self.start))

    def at(self, s: Array) -> CurvePoint:
        """See ``Segment.at``."""
        direction = (self.end - self.start) / self.length_m
        tangent = np.broadcast_to(direction, (len(s), len(direction)))
        return CurvePoint(self.start + s[:, None] * direction, tangent, np.zeros_like(tangent))


@dataclass(frozen=True)
class Arc:
    """A circular arc that leaves ``start`` along ``tangent`` and bends towards ``normal`` (unit vectors, (d,))."""

    start: Array
    tangent: Array
    normal: Array
    radius_m: float
    angle_rad: float

    @property
    def length_m(self) -> float:
        """Radius times angle."""
        return self.radius_m * self.angle_rad

    def at(self, s: Array) -> CurvePoint:
        """See ``Segment.at``."""
        turned = (s / self.radius_m)[:, None]
        sine, cosine = np.sin(turned), np.cos(turned)
        position = self.start + self.radius_m * (sine * self.tangent + (1.0 - cosine) * self.normal)
        bend = (cosine * self.normal - sine * self.tangent) / self.radius_m
        return CurvePoint(position, cosine * self.tangent + sine * self.normal, bend)


@dataclass(frozen=True)
class Bezier:
    """A Bezier curve with control points (k + 1, d), walked by arc length."""

    controls: Array

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        """Parameters and the arc lengths there: 8-point Gauss-Legendre quadrature on 64 pieces."""
        edges = np.linspace(0.0, 1.0, 65)
        nodes, weights = np.polynomial.legendre.leggauss(8)
        u = edges[:-1, None] + (nodes + 1.0) * 0.5 / 64.0
        speed = np.linalg.norm(self._derivative(u.ravel(), 1), axis=-1).reshape(u.shape)
        return edges, np.concatenate([[0.0], np.cumsum(speed @ weights * 0.5 / 64.0)])

    @property
    def length_m(self) -> float:
        """Arc length."""
        return float(self._table[1][-1])

    def at(self, s: Array) -> CurvePoint:
        """See ``Segment.at``."""
        u = self._parameter(s)
        first, second = self._derivative(u, 1), self._derivative(u, 2)
        square = np.sum(first * first, axis=-1, keepdims=True)
        tangent = first / np.sqrt(square)
        bend = (second - np.sum(second * tangent, axis=-1, keepdims=True) * tangent) / square
        return CurvePoint(self._derivative(u, 0), tangent, bend)

    def _parameter(self, s: Array) -> Array:
        edges, lengths = self._table
        piece = np.clip(np.searchsorted(lengths, s, side="right") - 1, 0, len(edges) - 2)
        share = (s - lengths[piece]) / (lengths[piece + 1] - lengths[piece])
        u = edges[piece] + share * (edges[piece + 1] - edges[piece])
        nodes, weights = np.polynomial.legendre.leggauss(8)
        for _ in range(2):
            reach = u - edges[piece]
            inner = edges[piece, None] + (nodes + 1.0) * 0.5 * reach[:, None]
            speed = np.linalg.norm(self._derivative(inner.ravel(), 1), axis=-1).reshape(inner.shape)
            length = lengths[piece] + speed @ weights * 0.5 * reach
            u = np.clip(u - (length - s) / np.linalg.norm(self._derivative(u, 1), axis=-1), 0.0, 1.0)
        return u

    def _derivative(self, u: Array, order: int) -> Array:
        points = self.controls
        for step in range(order):
            points = (len(self.controls) - 1 - step) * np.diff(points, axis=0)
        points = np.broadcast_to(points, (len(u), *points.shape))
        while points.shape[1] > 1:  # de Casteljau
            points = points[:, :-1] + u[:, None, None] * np.diff(points, axis=1)
        return points[:, 0]


@dataclass(frozen=True)
class CurvedPath:
    """Segments joined end to end.

    Attributes:
        segments: in order; each starts where the one before it ends.
    """

    segments: tuple[Segment, ...]

    def __post_init__(self) -> None:
        """Check that the segments join."""
        if not self.segments:
            raise ValueError("a path needs at least one segment of positive length")
        for index, (before, after) in enumerate(zip(self.segments[:-1], self.segments[1:], strict=True)):
            gap = np.linalg.norm(_end(before).position - _start(after).position)
            if gap > 1e-9:
                raise ValueError(f"segments {index} and {index + 1} are {gap:.3g} m apart: join them end to end")

    @cached_property
    def offsets(self) -> Array:
        """Arc lengths at which the segments start, and the total: (m + 1,)."""
        return np.concatenate([[0.0], np.cumsum([segment.length_m for segment in self.segments])])

    @property
    def length_m(self) -> float:
        """Total arc length."""
        return float(self.offsets[-1])

    @cached_property
    def sharp(self) -> np.ndarray:
        """Which of the m - 1 joints turn the direction, so that a tool can only pass them at rest."""
        return self._jumps("tangent", _SAME_DIRECTION)

    @cached_property
    def kinked(self) -> np.ndarray:
        """Which of the m - 1 joints change the curvature at once (all sharp ones do): the jerk has no bound there."""
        return self._jumps("bend", 1e-6) | self.sharp

    def at(self, s: ArrayLike) -> CurvePoint:
        """Geometry at arc lengths (n,), clipped to the path; at a joint the later segment counts."""
        where = np.clip(np.atleast_1d(np.asarray(s, dtype=np.float64)), 0.0, self.length_m)
        index = np.clip(np.searchsorted(self.offsets, where, side="right") - 1, 0, len(self.segments) - 1)
        dimension = _start(self.segments[0]).position.shape[-1]
        result = CurvePoint(*(np.empty((len(where), dimension)) for _ in range(3)))
        for number, segment in enumerate(self.segments):
            rows = index == number
            if rows.any():
                piece = segment.at(np.minimum(where[rows] - self.offsets[number], segment.length_m))
                for target, values in zip(result, piece, strict=True):
                    target[rows] = values
        return result

    def _jumps(self, field: str, tolerance: float) -> np.ndarray:
        pairs = zip(self.segments[:-1], self.segments[1:], strict=True)
        jumps = [np.linalg.norm(getattr(_end(a), field) - getattr(_start(b), field)) for a, b in pairs]
        return np.array(jumps) > tolerance


def polyline(corners: ArrayLike) -> CurvedPath:
    """Straight legs through ``corners`` (m + 1, d); legs without length are left out."""
    return rounded(corners, 0.0)


def rounded(corners: ArrayLike, radius_m: float, blend: Blend = "circle") -> CurvedPath:
    """Straight legs with rounded corners.

    Args:
        corners: (m + 1, d), metres.
        radius_m: of the circular corners; 0 keeps them sharp.
        blend: ``"circle"``: arcs of that radius (the curvature jumps where they begin). ``"smooth"``: quintic Bezier
            curves that leave and meet the legs at the same points as those arcs, with continuous curvature, so that
            the jerk stays finite; they bend 1.12 times as tightly at a right angle.

    Raises:
        ValueError: the radius is negative or its corners overlap (the message says which leg is too short).
    """
    if not 0.0 <= radius_m < np.inf:
        raise ValueError(f"radius_m = {radius_m} m: give a finite radius >= 0")
    points = np.asarray(corners, dtype=np.float64)
    if points.ndim != 2 or len(points) < 2:
        raise ValueError(f"corners have shape {points.shape}: expected (m + 1, d) with at least two corners")
    points = points[np.append(True, np.any(np.diff(points, axis=0) != 0.0, axis=-1))]
    legs = np.diff(points, axis=0)
    lengths = np.linalg.norm(legs, axis=-1)
    directions = legs / lengths[:, None]
    turns = np.arccos(np.clip(np.sum(directions[:-1] * directions[1:], axis=-1), -1.0, 1.0))
    cuts = np.zeros(len(points))
    if radius_m > 0.0:
        if np.any(turns > np.pi - 1e-6):
            raise ValueError("a corner turns back on itself: it cannot be rounded, use radius_m = 0")
        cuts[1:-1] = radius_m * np.tan(0.5 * turns)
    room = lengths - cuts[:-1] - cuts[1:]
    if np.any(room < -1e-12):
        leg = int(np.argmin(room))
        raise ValueError(
            f"radius_m = {radius_m} m needs {cuts[leg] + cuts[leg + 1]:.4g} m of leg {leg}, which is "
            f"{lengths[leg]:.4g} m long: choose a smaller radius"
        )
    segments: list[Segment] = []
    for leg, direction in enumerate(directions):
        start, end = points[leg] + cuts[leg] * direction, points[leg + 1] - cuts[leg + 1] * direction
        if room[leg] > 1e-12:
            segments.append(Line(start, end))
        if leg + 1 < len(directions) and cuts[leg + 1] > 0.0:
            after = directions[leg + 1]
            if blend == "circle":
                across = after - np.dot(after, direction) * direction
                segments.append(Arc(end, direction, across / np.linalg.norm(across), radius_m, float(turns[leg])))
            else:
                before_s, after_s = -np.array(_SMOOTH_CORNER), np.array(_SMOOTH_CORNER)[::-1]
                controls = np.concatenate([before_s[:, None] * direction, after_s[:, None] * after])
                segments.append(Bezier(points[leg + 1] + cuts[leg + 1] * controls))
    return CurvedPath(tuple(segments))


def _start(segment: Segment) -> CurvePoint:
    return CurvePoint(*(field[0] for field in segment.at(np.zeros(1))))


def _end(segment: Segment) -> CurvePoint:
    return CurvePoint(*(field[0] for field in segment.at(np.array([segment.length_m]))))
