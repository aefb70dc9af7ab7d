"""The safflower paper's eqs 1-22, as printed and as corrected, against numerical differentiation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mechanisms import FiveBar
from ..mechanisms.batching import Array
from .findings import EXTRACTION, Finding, statement

LENGTHS = (0.160, 0.330, 0.050, 0.040, 0.360, 0.190, 0.550)
"""l1 to l7 in metres of a five-bar without equal links, so that a wrong index shows."""

_STEP = 1e-4
EXACT = 1e-6
"""Largest error, relative to the largest true value, of an equation that holds."""


@dataclass(frozen=True)
class Motion:
    """Random poses of the uneven five-bar in motion; every rate is differentiated from positions."""

    t: Array
    v: Array
    a: Array
    q: Array
    """(n, 4): q1, q2, q3, q4."""
    rates: Array
    """(n, 4), rad/s."""
    accelerations: Array
    """(n, 4), rad/s2."""


def equations(bar: FiveBar, motion: Motion) -> list[Finding]:
    """One finding for each of eqs 1-22, those that say the same together."""
    return [*_positions(motion), *_velocities(bar, motion), *_accelerations(motion)]


def _angles(bar: FiveBar, t: Array) -> Array:
    chains = bar.chains(t)
    return np.stack([chains.q[:, 0], chains.q_passive[:, 0], chains.q_passive[:, 1], chains.q[:, 1]], axis=-1)


def moving(bar: FiveBar) -> Motion:
    """Two hundred poses of the bar, clear of its singularities, in random motion."""
    rng = np.random.default_rng(0)
    thrown = rng.uniform((0.15, -0.51), (0.43, -0.22), (8000, 2))
    # Clear of the singularities, where numerical differentiation is not the better witness.
    clear = thrown[bar.reachable(thrown) & (np.min(bar.transmission_angles(thrown), axis=-1) > np.deg2rad(25.0))]
    t = clear[:200]
    v, a = rng.normal(size=t.shape), 10.0 * rng.normal(size=t.shape)
    near = [_angles(bar, t + k * _STEP * v + 0.5 * (k * _STEP) ** 2 * a) for k in (-2, -1, 0, 1, 2)]
    rates = (8.0 * (near[3] - near[1]) - (near[4] - near[0])) / (12.0 * _STEP)
    bends = (16.0 * (near[3] + near[1]) - (near[4] + near[0]) - 30.0 * near[2]) / (12.0 * _STEP**2)
    return Motion(t, v, a, near[2], rates, bends)


def compared(
    item: str, claim: str, printed: Array, truth: Array, corrected: Array | None = None, right: str = "", note: str = ""
) -> Finding:
    """Both forms against the truth, by the largest error relative to the largest true value.

    Args:
        item: place in the paper.
        claim: the form in words.
        printed: values of the printed form.
        truth: values without it.
        corrected: values of the corrected form, where there is one.
        right: what was corrected.
        note: ends the reason.
    """
    size = float(np.max(np.abs(truth)))

    def error(values: Array) -> float:
        return float(np.nanmax(np.abs(values - truth))) / size

    why = f"Relative error {error(printed):.2g} as printed"
    holds = None if corrected is None else error(corrected) < EXACT
    why += "" if corrected is None else f", {error(corrected):.1g} with {right}"
    why += f" (200 poses, uneven links).{note}"
    return statement(item, claim, error(printed) < EXACT, why, corrected=holds)


def nearest(candidates: list[Array], truth: Array) -> Array:
    """The candidate angles closest to the truth, continued to it over full turns."""
    continued = [truth + np.angle(np.exp(1j * (angle - truth))) for angle in candidates]
    distance = np.nan_to_num(np.abs(np.stack(continued) - truth), nan=np.inf)
    return np.take_along_axis(np.stack(continued), np.argmin(distance, axis=0)[None], axis=0)[0]


def along(angle: Array) -> Array:
    """Unit vectors (2, n) at angles (n,)."""
    return np.stack([np.cos(angle), np.sin(angle)])


def _positions(m: Motion) -> list[Finding]:
    l1, l2, l3, l4, l5, l6, l7 = LENGTHS
    q1, q2, q3, q4 = m.q.T
    first, second = np.array([[0.0], [0.0]]), np.array([[l7], [0.0]])
    c, d = (m.t.T + np.array([[side * l3], [l4]]) for side in (-1.0, 1.0))
    dx, dy = d - second
    rho = np.hypot(dx, dy)
    swing = np.arccos((rho**2 + l6**2 - l5**2) / (2.0 * rho * l6))
    plain, full = np.arctan(dy / dx), np.arctan2(dy, dx)
    elbow = second + l6 * along(q4)
    ways = {sign: second + l6 * along(full + turn) for sign, turn in (("+", swing), ("-", -swing))}
    sign = min(ways, key=lambda name: float(np.max(np.abs(ways[name] - elbow))))
    ex, ey = elbow
    cx, cy = c
    base = np.arctan2(cy, cx)
    with np.errstate(invalid="ignore"):
        narrow = np.arccos((cx**2 + cy**2 + l1**2 - l2**2) / (2.0 * np.sqrt(cx**2 + cy**2 * l1)))
    wide = np.arccos((cx**2 + cy**2 + l1**2 - l2**2) / (2.0 * l1 * np.hypot(cx, cy)))
    return [
        compared(
            "Eqs 1, 2, 7 and 8, D",
            "D = T + (l3, l4) = E + l5 (cos q3, sin q3)",
            d,
            elbow + l5 * along(q3),
            note=" The source's eq. 2 has l_A, which no legend names; read as l4." + EXTRACTION,
        ),
        compared("Eq. 3, rho_D", "the length of FD", rho, np.hypot(*(l6 * along(q4) + l5 * along(q3)))),
        compared(
            "Eqs 4 and 13, q4",
            "q0 is an arctangent of a quotient",
            nearest([plain + swing, plain - swing], q4),
            q4,
            nearest([full + swing, full - swing], q4),
            "the arctangent of two arguments",
            " The source divides Dy - Fy by itself; read as (Dy - Fy) / (Dx - Fx)." + EXTRACTION,
        ),
        compared(
            "Eqs 5 and 6, E",
            "E = F + l6 (cos, sin) of q0 +- arccos(...)",
            ways[sign],
            elbow,
            note=f" With the sign {sign} at every pose, and q0 of two arguments as in the row above.",
        ),
        compared(
            "Eq. 9, q3",
            "q3 is an arctangent of a quotient",
            np.arctan((dy - ey) / (dx + l7 - ex)),
            q3,
            np.arctan2(dy - ey, dx + l7 - ex),
            "the arctangent of two arguments",
        ),
        compared("Eqs 10 and 11, C", "C = T + (-l3, l4)", c, first + l1 * along(q1) + l2 * along(q2)),
        compared(
            "Eq. 12, q1",
            "denominator 2 sqrt(Cx^2 + Cy^2 l1)",
            np.nan_to_num(nearest([base + narrow, base - narrow], q1)),
            q1,
            nearest([base + wide, base - wide], q1),
            "2 l1 sqrt(Cx^2 + Cy^2)",
            EXTRACTION,
        ),
    ]


def _velocities(bar: FiveBar, m: Motion) -> list[Finding]:
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
    # J_T column by column: the tool's way for a small turn of one motor.
    turns = 1e-5 * np.eye(2)
    driven = m.q[:, [0, 3]]
    columns = [(bar.forward(driven + turn) - bar.forward(driven - turn)) / 2e-5 for turn in turns]
    return [
        compared(
            "Eq. 14, C'y",
            "-l1 cos q1 q1' + l2 cos q2 q2'",
            -l1 * np.cos(q1) * w1 + l2 * np.cos(q2) * w2,
            vy,
            l1 * np.cos(q1) * w1 + l2 * np.cos(q2) * w2,
            "+l1 cos q1 q1'",
            EXTRACTION,
        ),
        compared(
            "Eq. 15, D'",
            "the q3' terms with l6",
            np.stack([-l6 * np.sin(q4) * w4 - l6 * np.sin(q3) * w3, l6 * np.cos(q4) * w4 + l6 * np.cos(q3) * w3]),
            m.v.T,
            np.stack([-l6 * np.sin(q4) * w4 - l5 * np.sin(q3) * w3, l6 * np.cos(q4) * w4 + l5 * np.cos(q3) * w3]),
            "l5 there",
            EXTRACTION,
        ),
        compared(
            "Eqs 16 and 17, joint rates",
            "denominators l2 sin(q1 - q2) and l1 sin(q3 - q4)",
            np.stack([e2 / (l2 * -s21), e3 / (l1 * s34)]),
            truth,
            right,
            "l1 sin(q2 - q1) and l6 sin(q3 - q4)",
        ),
        compared("Eq. 18, matrix", "row 1 with l2, entry (2,2) cos q3", printed_18, truth, right, "l1, l6 and sin q3"),
        compared(
            "Eq. 19, J_T",
            "T' = J_T (q1', q4')",
            (columns[0] * w1[:, None] + columns[1] * w4[:, None]).T,
            m.v.T,
            note=" J_T differentiated from the forward solution. The source's vector has q4' twice, for a matrix of "
            "two columns; read once." + EXTRACTION,
        ),
        compared(
            "Eq. 20, J_T",
            "entries over cos q2 - sin q2",
            printed_20,
            m.v.T,
            right_20,
            "[[l1 s21 s3, -l6 s34 s2], [-l1 s21 c3, l6 s34 c2]] / sin(q3 - q2)",
        ),
    ]


def _accelerations(m: Motion) -> list[Finding]:
    l1, l2, _, _, l5, l6, _ = LENGTHS
    q1, q2, q3, q4 = m.q.T
    w1, w2, w3, w4 = m.rates.T
    b1, b2, _, b4 = m.accelerations.T
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

    def quotient(forearm: Array, arm: Array, forearm_rate: Array, arm_rate: Array, length: float) -> Array:
        """Eq. 21: derivative of T'.e / (length sin(forearm - arm)); a negative length turns the sine's sign."""
        e, across = along(forearm), along(forearm + 0.5 * np.pi)
        above = np.sum(m.v.T * e, axis=0)
        above_rate = np.sum(m.a.T * e, axis=0) + forearm_rate * np.sum(m.v.T * across, axis=0)
        below = length * np.sin(forearm - arm)
        below_rate = length * np.cos(forearm - arm) * (forearm_rate - arm_rate)
        return (above_rate * below - above * below_rate) / below**2

    ends = [(q2, q1, w2, w1), (q3, q4, w3, w4)]
    truth = np.stack([b1, b4])
    return [
        compared(
            "Eq. 21, derivative of eq. 17",
            "quotient rule over l2 sin(q1 - q2) and l1 sin(q3 - q4)",
            np.stack([quotient(*end, length) for end, length in zip(ends, (-l2, l1), strict=True)]),
            truth,
            np.stack([quotient(*end, length) for end, length in zip(ends, (l1, l6), strict=True)]),
            "the denominators of eq. 17 corrected",
        ),
        compared(
            "Eq. 22, joint accelerations",
            "projected on the driven arms",
            printed,
            truth,
            right,
            "the projection on the forearms, q1'' = [T''.e2 + l1 q1'^2 c(q1 - q2) + l2 q2'^2] / (l1 s(q2 - q1))",
        ),
        compared(
            "Below eq. 22, T''",
            "T'' from q1, q2 and their two derivatives",
            np.stack(
                [
                    -l1 * np.sin(q1) * b1 - l1 * np.cos(q1) * w1**2 - l2 * np.sin(q2) * b2 - l2 * np.cos(q2) * w2**2,
                    l1 * np.cos(q1) * b1 - l1 * np.sin(q1) * w1**2 + l2 * np.cos(q2) * b2 - l2 * np.sin(q2) * w2**2,
                ]
            ),
            m.a.T,
        ),
    ]
