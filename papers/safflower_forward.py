"""The safflower paper's eqs 23-33: forward solution, singularities, drive errors, as printed and as corrected."""

from __future__ import annotations

import numpy as np

from ..mechanisms import FiveBar
from ..mechanisms.batching import Array
from .findings import EXTRACTION, Finding
from .safflower_formulas import LENGTHS, Motion, along, compared, nearest

_OTHER = "q1 measured from the other side, pi - q1"
DRIVE_ERROR_RAD = 0.003
"""Of both motors in the rows of eqs 32 and 33."""


def equations(m: Motion) -> list[Finding]:
    """Eqs 23-29."""
    return [*_tool(m), *_loops(m), *_end(m), _determinant(m)]


def _tool(m: Motion) -> list[Finding]:
    l1, l2, l3, l4, l5, l6, l7 = LENGTHS
    q1, q2, q3, q4 = m.q.T
    scale = np.full_like(m.t.T, l7)
    printed = l6 * along(q4) + l5 * along(q3) + np.array([[l7], [l4]])
    loop = l1 * along(q1) + l2 * along(q2) - l5 * along(q3) - l6 * along(q4) + np.array([[2.0 * l3 - l7], [0.0]])
    return [
        # A residual, so that the scale is that of the lengths it is made of.
        compared("Eq. 23, loop", "A to F over both legs and the platform closes", loop + scale, scale),
        compared(
            "Eq. 24, T",
            "Tx without l3, Ty with + l4",
            printed,
            m.t.T,
            printed - np.array([[l3], [2.0 * l4]]),
            "Tx = ... - l3 and Ty = ... - l4",
        ),
    ]


def _terms(m: Motion, first: Array) -> tuple[float, Array, Array, Array]:
    """W, X, Y and Z of eq. 25 with this angle for q1."""
    l1, l2, l3, _, l5, l6, l7 = LENGTHS
    q4 = m.q[:, 3]
    w = l1**2 + 4 * l3**2 + l5**2 + l6**2 + l7**2 - l2**2 - 4 * l3 * l7
    x = (l6 * l7 - 2 * l3 * l6) * np.cos(q4) + (l1 * l7 - 2 * l1 * l3) * np.cos(first)
    x = 2 * (x + l1 * l6 * np.cos(first) * np.cos(q4) - l1 * l6 * np.sin(first) * np.sin(q4))
    y = 2 * ((l5 * l7 - 2 * l3 * l5) + l1 * l5 * np.cos(first) + l5 * l6 * np.cos(q4))
    return w, x, y, 2 * (l5 * l6 * np.sin(q4) - l1 * l5 * np.sin(first))


def _loops(m: Motion) -> list[Finding]:
    l7 = LENGTHS[-1]
    q1, _, q3, _ = m.q.T
    scale = np.full_like(q1, l7**2)

    def loop(first: Array) -> Array:
        w, x, y, z = _terms(m, first)
        return w + x + y * np.cos(q3) + z * np.sin(q3)

    w, x, y, z = _terms(m, np.pi - q1)
    half = np.tan(0.5 * q3)
    printed_26 = (w + x + y) * half**2 + 2 * z * half**2 + (w + x - y)
    right_26 = (w + x - y) * half**2 + 2 * z * half + (w + x + y)

    def roots(first: Array, leading_sign: float) -> Array:
        """Eq. 27 with the root printed below eq. 26, over W + X + Y or W + X - Y."""
        w, x, y, z = _terms(m, first)
        leading, last = w + x + leading_sign * y, w + x - leading_sign * y
        with np.errstate(invalid="ignore"):
            spread = np.sqrt(z**2 - leading * last)
        return np.nan_to_num(nearest([2.0 * np.arctan((-z + side * spread) / leading) for side in (1.0, -1.0)], q3))

    return [
        compared("Eq. 25, loop", "q1 anticlockwise from +x", loop(q1) + scale, scale, loop(np.pi - q1) + scale, _OTHER),
        compared(
            "Eq. 26, half angle",
            "(W + X + Y) d^2 + 2 Z d^2 + ...",
            printed_26 + scale,
            scale,
            right_26 + scale,
            "(W + X - Y) d^2 + 2 Z d + (W + X + Y) = 0 and q1 as in eq. 25",
            " The source's last term is (A + B - C), letters that it does not define; read as W + X - Y." + EXTRACTION,
        ),
        compared(
            "Eq. 27, q3",
            "q3 = 2 arctan d with the root over W + X + Y",
            roots(q1, 1.0),
            q3,
            roots(np.pi - q1, -1.0),
            "the root over W + X - Y and q1 as in eq. 25",
        ),
    ]


def _end(m: Motion) -> list[Finding]:
    _, _, l3, l4, l5, l6, l7 = LENGTHS
    q1, _, q3, q4 = m.q.T
    right = l6 * along(q4) + l5 * along(q3) + np.array([[l7 - l3], [-l4]])
    printed = right + np.array([[l3], [2.0 * l4]])
    printed[0] += l6 * (np.cos(q1) - np.cos(q4))
    return [compared("Eq. 28, T", "Tx from cos q1", printed, m.t.T, right, "cos q4 and the signs of eq. 24")]


def _determinant(m: Motion) -> Finding:
    l1, l2, _, _, l5, l6, _ = LENGTHS
    q1, q2, q3, q4 = m.q.T
    c, s = np.cos(m.q.T), np.sin(m.q.T)
    o = np.zeros_like(q1)

    def jacobian(corner: Array) -> Array:
        """Sizes of the determinants of eq. 29 with this entry (2, 1)."""
        rows = [
            [-l1 * s[0], -l2 * s[1], l5 * s[2], l6 * s[3]],
            [corner, l2 * c[1], -l5 * c[2], -l6 * c[3]],
            [o, o, -l5 * s[2], -l6 * s[3]],
            [o, o, l5 * c[2], l6 * c[3]],
        ]
        return np.abs(np.linalg.det(np.moveaxis(np.array(rows), -1, 0)))

    return compared(
        "Eq. 29, det J",
        "entry (2,1) is l1 sin q1, det J = l1 l2 s(q2 - q1) l5 l6 s(q4 - q3)",
        jacobian(l1 * s[0]),
        np.abs(l1 * l2 * np.sin(q2 - q1) * l5 * l6 * np.sin(q4 - q3)),
        jacobian(l1 * c[0]),
        "l1 cos q1",
        EXTRACTION,
    )


def drive_errors(bar: FiveBar, m: Motion) -> list[Finding]:
    """Eqs 31-33: where the tool is when both motors err."""
    l1, l2, l3, l4, l5, l6, l7 = LENGTHS
    q1, q4 = m.q[:, 0], m.q[:, 3]
    tx, ty = m.t.T
    scale = np.full_like(q1, l7**2)

    def circle(first: Array) -> Array:
        return (l1 * np.cos(first) + tx - l3) ** 2 + (ty + l4 - l1 * np.sin(first)) ** 2 - l2**2

    beside = (l6 * np.cos(q4) + l7 - tx - l3) ** 2 + (ty + l4 - l6 * np.sin(q4)) ** 2 - l5**2
    printed, right = (np.stack([circle(first), beside]) + scale for first in (q1, np.pi - q1))
    moved = bar.forward(m.q[:, [0, 3]] + DRIVE_ERROR_RAD).T

    def solved(first: Array) -> Array:
        """T' of eq. 32: where the two circles of eq. 31 about the erring elbows cross."""
        one = np.stack([l3 - l1 * np.cos(first), l1 * np.sin(first) - l4])
        two = np.stack([l6 * np.cos(q4 + DRIVE_ERROR_RAD) + l7 - l3, l6 * np.sin(q4 + DRIVE_ERROR_RAD) - l4])
        apart = np.hypot(*(two - one))
        foot = (apart**2 + l2**2 - l5**2) / (2.0 * apart)
        ahead = (two - one) / apart
        with np.errstate(invalid="ignore"):
            aside = np.sqrt(l2**2 - foot**2) * np.stack([-ahead[1], ahead[0]])
        both = np.nan_to_num(np.stack([one + foot * ahead + side * aside for side in (1.0, -1.0)]))
        nearer = np.argmin(np.hypot(*np.moveaxis(both - moved, 1, 0)), axis=0)
        return np.take_along_axis(both, nearer[None, None], axis=0)[0]

    there = solved(np.pi - q1 - DRIVE_ERROR_RAD)
    return [
        compared("Eq. 31, error model", "q1 anticlockwise from +x", printed, scale, right, _OTHER),
        compared(
            "Eq. 32, erring tool",
            "T' solves F1' = F2' = 0 at the erring angles",
            solved(q1 + DRIVE_ERROR_RAD),
            moved,
            there,
            f"{_OTHER}, both motors off by {DRIVE_ERROR_RAD} rad",
        ),
        compared(
            "Eq. 33, error",
            "the distance of T' from T",
            np.hypot(*(there - m.t.T)),
            np.hypot(*(moved - m.t.T)),
            note=" The source has lost the primes of T'; as it stands the distance is zero." + EXTRACTION,
        ),
    ]
