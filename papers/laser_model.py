"""The laser paper's model put to the test: mobility, orientation, singularity and statics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..mechanisms import ThreeUPSRPU
from ..mechanisms.rotations import rotation_from_euler
from ..mechanisms.three_ups_rpu import WEEDING_BOX
from ..mechanisms.three_ups_rpu_geometry import Attachments
from .findings import Finding, number, statement

Array = NDArray[np.float64]

LOAD_N = np.array([20.0, 0.0, -100.0, 0.0, 0.0, 0.0])
"""Assumed wrench of the statics rows: 10 kg of platform and laser, braked at 2 m/s2; the paper computes no forces."""
LOAD = "100 N of weight and 20 N along X"


@dataclass(frozen=True)
class Case:
    """One of the paper's two motions over ten seconds; the source's text states no range, and Fig. 5 is not in it.

    Attributes:
        name: "case 1" or "case 2".
        time_s: shape (n,).
        poses: shape (n, 4), metres and radians.
        rates: shape (n, 4), constant; the pose accelerations are zero.
    """

    name: str
    time_s: Array
    poses: Array
    rates: Array


class Curves(NamedTuple):
    """Curves of the four legs, shape (n, 4) each, in the millimetres of Fig. 5."""

    lengths: Array
    velocities: Array
    accelerations: Array


def cases(samples: int = 2001) -> tuple[Case, Case]:
    """Eqs 18 and 19 over t in [0, 10] s, with Z_o read as a height above H."""
    time = np.linspace(0.0, 10.0, samples)
    home = ThreeUPSRPU.published().home_pose
    motions = (
        ("case 1", np.array([0.005, 0.005, 0.0, 0.0])),
        ("case 2", np.array([0.0, 0.0, 1.0, 1.0]) * math.pi / 90),
    )
    first, second = (
        Case(name, time, home + time[:, None] * rates, np.broadcast_to(rates, (samples, 4))) for name, rates in motions
    )
    return first, second


def curves(machine: ThreeUPSRPU, case: Case) -> Curves:
    """Lengths, velocities and accelerations of the legs (eqs 4, 8 and 13)."""
    lengths = machine.inverse(case.poses)
    rates = machine.joint_rates(case.poses, case.rates)
    accelerations = machine.joint_accelerations(case.poses, case.rates, np.zeros(4))
    return Curves(1e3 * lengths, 1e3 * rates, 1e3 * accelerations)


def curves_of_eq_4(at: Attachments, case: Case) -> Curves:
    """The same for eq. 4 with R = Rx(alpha) Ry(beta) and Y_o = 0, from the vectors B_i - A_i and their derivatives.

    Args:
        at: A_i and B_i of the layout.
        case: its pose rates are constant, so that only R bends the legs' vectors.
    """
    x, z, alpha, beta = case.poses.T
    vx, vz, alpha_rate, beta_rate = (rate[:, None, None] for rate in case.rates.T)
    turn = rotation_from_euler(np.stack([alpha, 0.0 * alpha, 0.0 * alpha], axis=-1))
    turn = turn @ rotation_from_euler(np.stack([0.0 * beta, beta, 0.0 * beta], axis=-1))
    about_x, about_y = (np.cross(np.eye(3), axis) for axis in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    first = alpha_rate * about_x @ turn + beta_rate * turn @ about_y
    second = alpha_rate**2 * about_x @ about_x @ turn + beta_rate**2 * turn @ about_y @ about_y
    second = second + 2.0 * alpha_rate * beta_rate * about_x @ turn @ about_y
    vector, rate, bend = (np.einsum("nij,kj->nki", matrix, at.platform) for matrix in (turn, first, second))
    vector = vector + np.stack([x, 0.0 * x, z], axis=-1)[:, None] - at.base
    rate = rate + np.concatenate([vx, 0.0 * vx, vz], axis=-1)
    lengths = np.linalg.norm(vector, axis=-1)
    rates = np.sum(vector * rate, axis=-1) / lengths
    accelerations = (np.sum(rate * rate, axis=-1) + np.sum(vector * bend, axis=-1) - rates**2) / lengths
    return Curves(1e3 * lengths, 1e3 * rates, 1e3 * accelerations)


def mobility(exact: ThreeUPSRPU, printed: ThreeUPSRPU, first: Case, second: Case) -> list[Finding]:
    """Freedoms, joints, axes, orientation and origin of the model."""
    terms = 2 * 3 + 4 * 1 + 3 * 3 + 2 * 1 + 1 * 1
    counted = 3 * 2 + 4 * 1 + 4 * 3 + 1 * 1
    free = 6 - np.linalg.matrix_rank(exact.jacobian(second.poses)[:, 4:])
    # Eqs 2-19 are written in O-XYZ. The robot is described in P-XYZ, whose Y is its direction of travel.
    to_robot = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rows = exact.jacobian(exact.home_pose)[4:]
    robot_rows = np.concatenate([rows[:, :3] @ to_robot.T, rows[:, 3:] @ to_robot.T], axis=-1)
    free_axes = np.flatnonzero(np.abs(robot_rows).max(axis=0) < 1e-12)
    lean = np.abs(printed.chains(second.poses).rotation[:, 1, 0])
    straight = np.abs(exact.chains(second.poses).rotation[:, 1, 0])
    start = exact.home_pose * [1.0, 0.0, 1.0, 1.0]
    return [
        number(
            "Eq. 1, degrees of freedom",
            4.0,
            6 * (10 - 12 - 1) + terms,
            0.0,
            "",
            why=f"The two constraint rows of G leave {free.min()} to {free.max()} freedoms along case 2 as well.",
        ),
        statement(
            "Text above eq. 1, joints",
            "three universal and four spherical joints",
            6 * (10 - 12 - 1) + counted == 4,
            f"That count gives {6 * (10 - 12 - 1) + counted} degrees of freedom; four universal and three spherical "
            "joints (the terms of eq. 1) give 4.",
            corrected=6 * (10 - 12 - 1) + terms == 4,
        ),
        statement(
            "Robot description, movements",
            "movements along Y and Z and rotations about X and Y of P-XYZ, whose Y is the direction of travel",
            list(free_axes) == [1, 2, 3, 4],
            "At the home pose the constraints leave exactly these four. Eqs 2-19 use another named frame, O-XYZ, "
            "turned by 90 deg about Z, in which they are X and Z, and Y and X.",
        ),
        statement(
            "Eqs 2-4, orientation",
            "R = Rx(alpha) Ry(beta) with the RPU leg of Fig. 2",
            bool(lean.max() < 1e-12),
            "The universal joint keeps the platform's x normal to the revolute axis Y. In case 2 their cosine grows to "
            f"{lean.max():.3f} with Rx Ry and stays at {straight.max():.0e} with Ry Rx, which is the correction.",
            corrected=bool(straight.max() < 1e-12),
        ),
        statement(
            "Eqs 18-19, Z_o",
            "Z_o is the height of eq. 4",
            bool(np.isclose(start[1], exact.home_height_m)),
            f"At t = 0 Z_o = 0 would put the platform into the base's plane, with legs of "
            f"{1e3 * exact.inverse(start)[0]:.0f} mm; measured from H = 600 mm they are "
            f"{1e3 * exact.inverse(exact.home_pose)[0]:.2f} mm.",
            corrected=bool(np.isclose(first.poses[0, 1], exact.home_height_m)),
        ),
    ]


def models(printed: Curves, exact: Curves, time: Array) -> Finding:
    """How far the printed orientation is from the mechanism's."""
    apart = [np.abs(a - b).max(axis=1) for a, b in zip(printed, exact, strict=True)]
    at = time[np.argmax(apart[0])]
    return statement(
        "Eq. 4 in case 2",
        "eq. 4 as printed gives the mechanism's lengths",
        bool(apart[0].max() < 1e-3),
        f"Rx Ry with Y_o = r_b sin(alpha) sin(beta) against Ry Rx with Y_o = 0: up to {apart[0].max():.2f} mm "
        f"(at {at:.1f} s), {apart[1].max():.3f} mm/s and {apart[2].max():.3f} mm/s2. In case 1 they are the same.",
        corrected=True if _closes_on_the_leg() < 1e-12 else None,
    )


def _closes_on_the_leg() -> float:
    """Largest error in metres of the corrected eq. 4 on RPU legs built joint by joint: swing, slide, two turns."""
    machine, rng = ThreeUPSRPU.published(), np.random.default_rng(0)
    swing, first, second = rng.uniform(-0.6, 0.6, (3, 500))
    length = rng.uniform(0.5, 0.8, 500)
    beta = swing + first
    # B_4 = A_4 + length along the swung leg; the platform's centre lies r_b along its x from there.
    x = -machine.base_radius_m + length * np.sin(swing) + machine.platform_radius_m * np.cos(beta)
    z = length * np.cos(swing) - machine.platform_radius_m * np.sin(beta)
    return float(np.abs(machine.inverse(np.stack([x, z, second, beta], axis=-1))[:, 3] - length).max())


def singularity(exact: ThreeUPSRPU, first: Case, second: Case) -> list[Finding]:
    """Where G has no inverse."""
    one, two = exact.singularity(first.poses), exact.singularity(second.poses)
    ranks = np.linalg.matrix_rank(exact.jacobian(first.poses), tol=1e-9)
    # Adding zero turns -0 into 0.
    twist = np.round(exact.null_twist(first.poses[-1]), 9) + 0.0
    return [
        statement(
            "Eqs 10, 16 in case 1",
            "V = G^-1 (v_l, 0, 0) gives the platform's velocity",
            not one.singular.any(),
            f"Singular at {one.singular.sum()} of {one.singular.size} samples: rank {ranks.min()} to {ranks.max()}, "
            f"smallest singular value at most {one.smallest.max():.0e} (angles by r_b). At t = 10 s the locked legs "
            f"leave v = ({twist[0]:.2f}, {twist[1]:.0f}, {twist[2]:.2f}) m/s with omega = "
            f"({twist[3]:.0f}, {twist[4]:.0f}, {twist[5]:.0f}) rad/s, a turn about the Y-parallel where all legs meet.",
        ),
        statement(
            "Eqs 10, 16 in case 2",
            "V = G^-1 (v_l, 0, 0) gives the platform's velocity",
            not two.singular.any(),
            f"Singular at t = 0; the smallest singular value then grows to {two.smallest[200]:.4f} at 1 s and "
            f"{two.smallest[-1]:.4f} at 10 s.",
        ),
    ]


def statics(exact: ThreeUPSRPU, first: Case, second: Case) -> list[Finding]:
    """Eq. 17 along both cases, and who carries the constraints."""
    weeder = ThreeUPSRPU.weeder()
    one, two, eased = (
        machine.statics(case.poses, LOAD_N) for machine, case in ((exact, first), (exact, second), (weeder, second))
    )
    known = np.asarray(np.isfinite(two).all(axis=-1))
    work = np.sum(two[:, :4] * exact.joint_rates(second.poses, second.rates), axis=-1)
    work = work + np.sum(LOAD_N * exact.twist(second.poses, second.rates), axis=-1)
    sizes = np.sum(np.abs(two[:, :4] * exact.joint_rates(second.poses, second.rates)), axis=-1)
    push = 100.0
    aside = weeder.statics(weeding_grid(), [0.0, push, 0.0, 0.0, 0.0, 0.0])
    force, couple = np.abs(aside[:, 4]).max(), np.abs(aside[:, 5]).max()
    return [
        statement(
            "Eq. 17 in case 1",
            "leg forces and reactions follow from -(G^T)^-1 (F, M)",
            bool(np.isfinite(one).all()),
            f"They exist at {np.isfinite(one).all(axis=-1).sum()} of {len(one)} samples: no leg forces balance a load "
            "that works along the null twist.",
        ),
        statement(
            "Eq. 17 in case 2, t > 0",
            "leg forces and reactions follow from -(G^T)^-1 (F, M)",
            bool(known[1:].all() and np.all(np.abs(work[1:]) < 1e-9 * sizes[1:])),
            f"They exist at {known.sum()} of {len(two)} samples; virtual work left: {np.abs(work[known]).max():.0e} W. "
            f"Under an assumed {LOAD} the largest leg force is {_force(two, second, 0.1)} N at 0.1 s, "
            f"{_force(two, second, 1.0)} N at 1 s and {_force(two, second, 10.0)} N at 10 s; weeder() needs "
            f"{_force(eased, second, 0.1)}, {_force(eased, second, 1.0)} and {_force(eased, second, 10.0)} N.",
        ),
        statement(
            "Robot description, leg loads",
            "each active leg bears only the force along its own axis",
            bool(max(force, couple) < 1e-9),
            f"The RPU leg carries the constraints: up to {force:.0f} N across and {couple:.1f} N m under "
            f"{push:.0f} N along Y on weeder() over the weeding box. Legs 1 to 3 bear axial forces only.",
        ),
    ]


def weeding_grid() -> Array:
    """Poses over the weeding box with its corners, shape (n, 4)."""
    axes = [np.linspace(low, high, count) for (low, high), count in zip(WEEDING_BOX, (9, 5, 9, 9), strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 4)


def _force(statics: Array, case: Case, time_s: float) -> str:
    row = int(np.argmin(np.abs(case.time_s - time_s)))
    return f"{np.abs(statics[row, :4]).max():.0f}"
