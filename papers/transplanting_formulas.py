"""The transplanting paper's equations, as printed and as corrected, against numerical differentiation."""

from __future__ import annotations

import numpy as np

from ..mechanisms import TranslationalFiveBar
from ..mechanisms.batching import Array
from ..motion import QUINTIC, SEPTIC, PolynomialLaw
from .findings import EXTRACTION, Finding, statement

_EXACT = 1e-6


def laws() -> list[Finding]:
    """Eqs 2-4 and 7-9: speed, acceleration and saltus as printed against numerical derivatives of the displacements."""
    t = np.linspace(0.02, 0.98, 97)
    forms = {
        (QUINTIC, 2): ("Eq. 2, speed", 30 * (t**2 - 2 * t**3 + t**4), None),
        (QUINTIC, 3): ("Eq. 3, acceleration", 60 * (-t - 3 * t**2 + 2 * t**3), 60 * (t - 3 * t**2 + 2 * t**3)),
        (QUINTIC, 4): ("Eq. 4, saltus", 60 * (1 - 6 * t + 6 * t**2), None),
        (SEPTIC, 2): ("Eq. 7, speed", 140 * (t**3 - 3 * t**4 + 3 * t**5 - t**6), None),
        (SEPTIC, 3): ("Eq. 8, acceleration", 420 * (t**2 - 4 * t**3 + 5 * t**4 - 2 * t**5), None),
        (SEPTIC, 4): (
            "Eq. 9, saltus",
            840 * (-t - 6 * t**2 + 10 * t**3 - 5 * t**4),
            840 * (t - 6 * t**2 + 10 * t**3 - 5 * t**4),
        ),
    }
    found = []
    for (law, which), (item, printed, corrected) in forms.items():
        order = which - 1
        h = 1e-3

        def before(x: Array, law: PolynomialLaw = law, order: int = order) -> Array:
            return law.shape(x)[order - 1]

        slope = (8.0 * (before(t + h) - before(t - h)) - (before(t + 2 * h) - before(t - 2 * h))) / (12.0 * h)
        size = float(np.max(np.abs(slope)))
        errors = [float(np.max(np.abs(values - slope))) / size for values in (printed, corrected) if values is not None]
        why = f"Relative error {errors[0]:.2g} against the differentiated curve"
        why += f"; with the leading term +t/T {errors[1]:.1g}." + EXTRACTION if corrected is not None else "."
        found.append(
            statement(
                item,
                "leading term -t/T" if corrected is not None else f"derivative of the {law.name} displacement",
                errors[0] < _EXACT,
                why,
                corrected=errors[1] < _EXACT if corrected is not None else None,
            )
        )
    return found


def kinematics(machine: TranslationalFiveBar) -> list[Finding]:
    """Eqs 11 to 16 as printed and as corrected, at random poses of the window."""
    rng = np.random.default_rng(0)
    poses = rng.uniform(*machine.window_m, (400, 2))
    v, a = rng.normal(size=poses.shape), 20.0 * rng.normal(size=poses.shape)
    h = 1e-4
    near = [machine.inverse(poses + k * h * v + 0.5 * (k * h) ** 2 * a) for k in (-2, -1, 0, 1, 2)]
    theta = near[2]
    rates = (8.0 * (near[3] - near[1]) - (near[4] - near[0])) / (12.0 * h)
    bends = (16.0 * (near[3] + near[1]) - (near[4] + near[0]) - 30.0 * near[2]) / (12.0 * h * h)
    pose = machine._pose(poses)
    e, l1, l2 = machine.motor_offset_m, machine.arm_m, machine.forearm_m

    # A pose of the window where C = B for leg 1.
    y = -0.60
    flat = np.array([[e - l1 + np.sqrt(l2**2 - y**2), y]])
    with np.errstate(all="ignore"):
        printed_12 = [_equation_12(points, e, l1, l2) for points in (poses, flat)]
    off = float(np.max(np.abs(np.angle(np.exp(1j * (printed_12[0] - theta))))))
    gap = float(np.abs(np.angle(np.exp(1j * (printed_12[1][0, 0] - machine.inverse(flat)[0, 0])))))
    back = float(np.max(np.abs(machine.forward(machine.inverse(flat)) - flat)))
    u, w = (np.stack([np.cos(x), np.sin(x)], axis=-1) for x in (pose.arm, pose.forearm))
    turned = np.stack([-u[..., 1], u[..., 0]], axis=-1)
    sign = np.array([[1.0, 0.0], [-1.0, 0.0]])
    loop = float(np.abs(poses[:, None] - sign * e - l1 * u - l2 * w).max())
    plain = w / np.sum(w * turned, axis=-1, keepdims=True)
    along = np.sum(plain * v[:, None], axis=-1)
    # Printed: Q carries a transpose, which turns the sign; 1 / l1 stands in eq. 13 and again in eq. 15.
    forms = {"13 and 15": along / l1**2, "16": -along / l1, "right": along / l1}
    errors = {key: float(np.max(np.abs(values - rates)) / np.max(np.abs(rates))) for key, values in forms.items()}
    passive = (
        np.sum(np.stack([-w[..., 1], w[..., 0]], axis=-1) * (v[:, None] - l1 * turned * rates[..., None]), axis=-1) / l2
    )
    push = np.sum(w * a[:, None], -1) + l1 * rates**2 * np.sum(w * u, -1) + l2 * passive**2
    right = push / (l1 * np.sum(w * turned, -1))
    guess = np.sum(plain * a[:, None], axis=-1) / l1 + rates**2
    size = float(np.max(np.abs(bends)))
    second = [float(np.max(np.abs(values - bends))) / size for values in (guess, right)]
    return [
        statement(
            "Eq. 11, loop",
            "r - sgn(i) e e1 - l1 u_i = l2 w_i",
            loop < 1e-12,
            f"Both legs close to {loop:.0e} m at 400 poses, with sgn 1 and -1 as printed.",
        ),
        statement(
            "Eq. 12, inverse position",
            "a half-angle quotient over C - B gives both angles",
            off < _EXACT and gap < _EXACT,
            f"Right at 400 random poses (error {off:.0e} rad), but 0/0 where C = B: at ({1e3 * flat[0, 0]:.1f}, "
            f"{1e3 * y:.0f}) mm, inside the window, it is off by {gap:.2f} rad. The form without the quotient, "
            "atan2(A, B) - sgn(i) arccos(-C / sqrt(A^2 + B^2)), closes the loop there to "
            f"{back:.0e} m.",
            corrected=back < 1e-12,
        ),
        statement(
            "Eqs 13 and 15, motor speeds",
            "theta' = J v / l1 with J carrying 1 / l1",
            errors["13 and 15"] < _EXACT,
            f"1 / l1 is counted twice: relative error {errors['13 and 15']:.2g}; theta' = J v has "
            f"{errors['right']:.0e}.",
            corrected=errors["right"] < _EXACT,
        ),
        statement(
            "Eq. 16, Q",
            "Q is the transpose of [[0, -1], [1, 0]]",
            errors["16"] < _EXACT,
            f"The transpose turns every speed's sign: relative error {errors['16']:.2g}, without it "
            f"{errors['right']:.0e}." + EXTRACTION,
            corrected=errors["right"] < _EXACT,
        ),
        statement(
            "Eq. 14, motor accelerations",
            "J a = l1 theta'' - l1 f(theta'), f not defined",
            second[0] < _EXACT,
            f"With f the squares of the speeds the relative error is {second[0]:.2g}; theta'' = [w.a + l1 theta'^2 w.u "
            f"+ l2 theta2'^2] / (l1 w.Qu) has {second[1]:.0e}.",
            corrected=second[1] < _EXACT,
        ),
    ]


def _equation_12(poses: Array, e: float, l1: float, l2: float) -> Array:
    sign = np.array([1.0, -1.0])
    x, y = poses[:, :1], poses[:, 1:]
    a, b = -2.0 * l1 * y, -2.0 * l1 * (x - sign * e)
    c = x**2 + y**2 + e**2 + l1**2 - l2**2 - 2.0 * sign * e * x
    quotient = (-a + sign * np.sqrt(a**2 - c**2 + b**2)) / (c - b)
    return 2.0 * np.arctan(np.nan_to_num(quotient))
