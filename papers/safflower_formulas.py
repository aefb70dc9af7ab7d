"""The safflower paper's equations, as printed and as corrected, against numerical differentiation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mechanisms import FiveBar
from ..mechanisms.batching import Array
from .findings import Finding, statement

LENGTHS = (0.160, 0.330, 0.050, 0.040, 0.360, 0.190, 0.550)
"""l1 to l7 in metres of a five-bar without equal links, so that a wrong index shows."""

_STEP = 1e-4
_EXACT = 1e-6


@dataclass(frozen=True)
class _Motion:
    """Random poses of the uneven five-bar in motion; every rate is differentiated from positions."""

    t: Array
    v: Array
    a: Array
    q: Array
    """(n, 4): q1, q2, q3, q4."""
    rates: Array
    """(n, 4), rad/s."""
    accelerations: Array
    """(n, 2): of q1 and q4, rad/s2."""


def equations() -> list[Finding]:
    """One finding for each equation of the kinematic sections that is tested."""
    bar = FiveBar.from_lengths(*LENGTHS)
    motion = _moving(bar)
    return [*_positions(motion), *_velocities(bar, motion), *_accelerations(motion), *_loops(motion)]


def _angles(bar: FiveBar, t: Array) -> Array:
    chains = bar.chains(t)
    return np.stack([chains.q[:, 0], chains.q_passive[:, 0], chains.q_passive[:, 1], chains.q[:, 1]], axis=-1)


def _moving(bar: FiveBar) -> _Motion:
    rng = np.random.default_rng(0)
    thrown = rng.uniform((0.15, -0.51), (0.43, -0.22), (8000, 2))
    # Clear of the singularities, where numerical differentiation is not the better witness.
    clear = thrown[bar.reachable(thrown) & (np.min(bar.transmission_angles(thrown), axis=-1) > np.deg2rad(25.0))]
    t = clear[:200]
    v, a = rng.normal(size=t.shape), 10.0 * rng.normal(size=t.shape)
    near = [_angles(bar, t + k * _STEP * v + 0.5 * (k * _STEP) ** 2 * a) for k in (-2, -1, 0, 1, 2)]
    rates = (8.0 * (near[3] - near[1]) - (near[4] - near[0])) / (12.0 * _STEP)
    bends = (16.0 * (near[3] + near[1]) - (near[4] + near[0]) - 30.0 * near[2]) / (12.0 * _STEP**2)
    return _Motion(t, v, a, near[2], rates, bends[:, [0, 3]])


def _compared(item: str, claim: str, printed: Array, corrected: Array, truth: Array, right: str) -> Finding:
    """Both forms against the truth, by the largest error relative to the largest true value."""
    size = float(np.max(np.abs(truth)))
    errors = [float(np.nanmax(np.abs(values - truth))) / size for values in (printed, corrected)]
    return statement(
        item,
        claim,
        errors[0] < _EXACT,
        f"Relative error {errors[0]:.2g} as printed, {errors[1]:.1g} with {right} (200 poses, uneven links).",
        corrected=errors[1] < _EXACT,
    )


def _nearest(candidates: list[Array], truth: Array) -> Array:
    """The candidate angles closest to the truth, continued to it over full turns."""
    continued = [truth + np.angle(np.exp(1j * (angle - truth))) for angle in candidates]
    distance = np.nan_to_num(np.abs(np.stack(continued) - truth), nan=np.inf)
    return np.take_along_axis(np.stack(continued), np.argmin(distance, axis=0)[None], axis=0)[0]


def _positions(m: _Motion) -> list[Finding]:
    l1, l2, l3, l4, l5, l6, l7 = LENGTHS
    q1, _, q3, q4 = m.q.T
    dx, dy = m.t[:, 0] + l3 - l7, m.t[:, 1] + l4
    rho = np.hypot(dx, dy)
    swing = np.arccos((rho**2 + l6**2 - l5**2) / (2.0 * rho * l6))
    plain, full = np.arctan(dy / dx), np.arctan2(dy, dx)
    ex, ey = l7 + l6 * np.cos(q4), l6 * np.sin(q4)
    cx, cy = m.t[:, 0] - l3, m.t[:, 1] + l4
    base = np.arctan2(cy, cx)
    with np.errstate(invalid="ignore"):
        narrow = np.arccos((cx**2 + cy**2 + l1**2 - l2**2) / (2.0 * np.sqrt(cx**2 + cy**2 * l1)))
    wide = np.arccos((cx**2 + cy**2 + l1**2 - l2**2) / (2.0 * l1 * np.hypot(cx, cy)))
    tx, ty = m.t.T
    printed_t = np.stack([l6 * np.cos(q4) + l7 + l5 * np.cos(q3), l6 * np.sin(q4) + l5 * np.sin(q3) + l4])
    printed_28 = np.stack([l6 * np.cos(q1) + l7 + l5 * np.cos(q3), l6 * np.sin(q4) + l5 * np.sin(q3) + l4])
    right_t = printed_t - np.array([[l3], [2.0 * l4]])
    return [
        _compared(
            "Eqs 4 and 13, q4",
            "q0 is an arctangent of a quotient",
            _nearest([plain + swing, plain - swing], q4),
            _nearest([full + swing, full - swing], q4),
            q4,
            "the arctangent of two arguments",
        ),
        _compared(
            "Eq. 9, q3",
            "q3 is an arctangent of a quotient",
            np.arctan((dy - ey) / (dx + l7 - ex)),
            np.arctan2(dy - ey, dx + l7 - ex),
            q3,
            "the arctangent of two arguments",
        ),
        _compared(
            "Eq. 12, q1",
            "denominator 2 sqrt(Cx^2 + Cy^2 l1)",
            np.nan_to_num(_nearest([base + narrow, base - narrow], q1)),
            _nearest([base + wide, base - wide], q1),
            q1,
            "2 l1 sqrt(Cx^2 + Cy^2)",
        ),
        _compared(
            "Eq. 24, T",
            "Tx without l3, Ty with + l4",
            printed_t,
            right_t,
            np.stack([tx, ty]),
            "Tx = ... - l3 and Ty = ... - l4",
        ),
        _compared(
            "Eq. 28, T",
            "Tx from cos q1",
            printed_28,
            right_t,
            np.stack([tx, ty]),
            "cos q4 and the signs of eq. 24",
        ),
    ]


def _velocities(bar: FiveBar, m: _Motion) -> list[Finding]:
    l1, l2, _, _, l5, l6, _ = LENGTHS
    q1, q2, q3, q4 = m.q.T
    w1, w2, w3, w4 = m.rates.T
    vx, vy = m.v.T
    e2, e3 = vx * np.cos(q2) + vy * np.sin(q2), vx * np.cos(q3) + vy * np.sin(q3)
    s21, s34, s32 = np.sin(q2 - q1), np.sin(q3 - q4), np.sin(q3 - q2)
    truth = np.stack([w1, w4])
    printed_18 = np.stack([e2 / (l2 * s21), (vx + vy) * np.cos(q3) / (l1 * s34)])
    right = np.stack([e2 / (l1 * s21), e3 / (l6 * s34)])
    gap = np.cos(q2) - np.sin(q2)
    printed_20 = np.stack(
        [
            l2 * s21 / gap * w1 - l1 * s34 * np.sin(q2) / (np.cos(q3) * gap) * w4,
            -l2 * s21 / gap * w1 + l1 * s21 * np.cos(q2) / (np.cos(q3) * gap) * w4,
        ]
    )
    right_20 = np.stack(
        [
            (l1 * s21 * np.sin(q3) * w1 - l6 * s34 * np.sin(q2) * w4) / s32,
            (-l1 * s21 * np.cos(q3) * w1 + l6 * s34 * np.cos(q2) * w4) / s32,
        ]
    )
    return [
        _compared(
            "Eq. 14, C'y",
            "-l1 cos q1 q1' + l2 cos q2 q2'",
            -l1 * np.cos(q1) * w1 + l2 * np.cos(q2) * w2,
            l1 * np.cos(q1) * w1 + l2 * np.cos(q2) * w2,
            vy,
            "+l1 cos q1 q1'",
        ),
        _compared(
            "Eq. 15, D'",
            "the q3' terms with l6",
            np.stack([-l6 * np.sin(q4) * w4 - l6 * np.sin(q3) * w3, l6 * np.cos(q4) * w4 + l6 * np.cos(q3) * w3]),
            np.stack([-l6 * np.sin(q4) * w4 - l5 * np.sin(q3) * w3, l6 * np.cos(q4) * w4 + l5 * np.cos(q3) * w3]),
            m.v.T,
            "l5 there",
        ),
        _compared(
            "Eqs 16 and 17, joint rates",
            "denominators l2 sin(q1 - q2) and l1 sin(q3 - q4)",
            np.stack([e2 / (l2 * -s21), e3 / (l1 * s34)]),
            right,
            truth,
            "l1 sin(q2 - q1) and l6 sin(q3 - q4)",
        ),
        _compared("Eq. 18, matrix", "row 1 with l2, entry (2,2) cos q3", printed_18, right, truth, "l1 and sin q3"),
        _compared(
            "Eq. 20, J_T",
            "entries over cos q2 - sin q2",
            printed_20,
            right_20,
            m.v.T,
            "[[l1 s21 s3, -l6 s34 s2], [-l1 s21 c3, l6 s34 c2]] / sin(q3 - q2)",
        ),
    ]


def _accelerations(m: _Motion) -> list[Finding]:
    l1, l2, _, _, l5, l6, _ = LENGTHS
    q1, q2, q3, q4 = m.q.T
    w1, w2, w3, w4 = m.rates.T
    ax, ay = m.a.T
    first = (ax + l2 * np.cos(q2) * w2**2 + l1 * np.cos(q1) * w1**2) * np.cos(q1)
    first -= (ay + l2 * np.sin(q2) * w2**2 + l1 * np.sin(q1) * w1**2) * np.sin(q1)
    second = (ax + l1 * np.cos(q4) * w4**2 + l2 * np.cos(q3) * w3**2) * np.cos(q3)
    second -= (ay + l1 * np.sin(q4) * w4**2 + l2 * np.sin(q3) * w3**2) * np.sin(q4)
    printed = np.stack([first / (l2 * np.sin(q1 - q2)), second / (l1 * np.sin(q3 - q4))])
    e2, e3 = ax * np.cos(q2) + ay * np.sin(q2), ax * np.cos(q3) + ay * np.sin(q3)
    right = np.stack(
        [
            (e2 + l1 * w1**2 * np.cos(q1 - q2) + l2 * w2**2) / (l1 * np.sin(q2 - q1)),
            (e3 + l6 * w4**2 * np.cos(q4 - q3) + l5 * w3**2) / (l6 * np.sin(q3 - q4)),
        ]
    )
    return [
        _compared(
            "Eq. 22, joint accelerations",
            "projected on the driven arms",
            printed,
            right,
            m.accelerations.T,
            "the projection on the forearms, q1'' = [T''.e2 + l1 q1'^2 c(q1 - q2) + l2 q2'^2] / (l1 s(q2 - q1))",
        )
    ]


def _loops(m: _Motion) -> list[Finding]:
    l1, l2, l3, l4, l5, l6, l7 = LENGTHS
    q1, q2, q3, q4 = m.q.T
    tx, ty = m.t.T
    w = l1**2 + 4 * l3**2 + l5**2 + l6**2 + l7**2 - l2**2 - 4 * l3 * l7

    def terms(first: Array) -> tuple[Array, Array, Array]:
        x = (l6 * l7 - 2 * l3 * l6) * np.cos(q4) + (l1 * l7 - 2 * l1 * l3) * np.cos(first)
        x = 2 * (x + l1 * l6 * np.cos(first) * np.cos(q4) - l1 * l6 * np.sin(first) * np.sin(q4))
        y = 2 * ((l5 * l7 - 2 * l3 * l5) + l1 * l5 * np.cos(first) + l5 * l6 * np.cos(q4))
        return x, y, 2 * (l5 * l6 * np.sin(q4) - l1 * l5 * np.sin(first))

    def loop(first: Array) -> Array:
        x, y, z = terms(first)
        return w + x + y * np.cos(q3) + z * np.sin(q3)

    def circle(first: Array) -> Array:
        return (l1 * np.cos(first) + tx - l3) ** 2 + (ty + l4 - l1 * np.sin(first)) ** 2 - l2**2

    x, y, z = terms(np.pi - q1)
    half = np.tan(0.5 * q3)
    printed_26 = (w + x + y) * half**2 + 2 * z * half**2 + (w + x - y)
    right_26 = (w + x - y) * half**2 + 2 * z * half + (w + x + y)
    zero, other = np.zeros_like(q1), "q1 measured from the other side, pi - q1"

    def jacobian(corner: Array) -> Array:
        """Determinants of eq. 29 with this entry (2, 1)."""
        c, s = np.cos(m.q.T), np.sin(m.q.T)
        o = np.zeros_like(q1)
        rows = [
            [-l1 * s[0], -l2 * s[1], l5 * s[2], l6 * s[3]],
            [corner, l2 * c[1], -l5 * c[2], -l6 * c[3]],
            [o, o, -l5 * s[2], -l6 * s[3]],
            [o, o, l5 * c[2], l6 * c[3]],
        ]
        return np.linalg.det(np.moveaxis(np.array(rows), -1, 0))

    product = l1 * l2 * np.sin(q2 - q1) * l5 * l6 * np.sin(q4 - q3)

    def vanishes(item: str, claim: str, printed: Array, corrected: Array, right: str) -> Finding:
        # Residuals, so the scale is that of the squared lengths they are made of.
        scale = l7**2 + zero
        return _compared(item, claim, printed + scale, corrected + scale, scale, right)

    return [
        vanishes("Eq. 25, loop", "q1 anticlockwise from +x", loop(q1), loop(np.pi - q1), other),
        vanishes(
            "Eq. 26, half angle",
            "(W + X + Y) d^2 + 2 Z d^2 + ...",
            printed_26,
            right_26,
            "(W + X - Y) d^2 + 2 Z d + (W + X + Y) = 0 and q1 as in eq. 25",
        ),
        _compared(
            "Eq. 29, det J",
            "entry (2,1) is l1 sin q1, det J = l1 l2 s(q2 - q1) l5 l6 s(q4 - q3)",
            np.abs(jacobian(l1 * np.sin(q1))),
            np.abs(jacobian(l1 * np.cos(q1))),
            np.abs(product),
            "l1 cos q1 (eq. 30 is then this product, not a chain of equal signs)",
        ),
        vanishes("Eq. 31, error model", "q1 anticlockwise from +x", circle(q1), circle(np.pi - q1), other),
    ]
