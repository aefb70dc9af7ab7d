"""The 3-PRRS paper's freedoms and eqs 1-6, held against the posed mechanism; some formulas are lost in the source."""

from __future__ import annotations

import numpy as np

from ..mechanisms import ThreePRRS
from ..mechanisms.batching import Array
from ..mechanisms.prrs_legs import RADIAL, TANGENTIAL
from ..mechanisms.rotations import rotation_from_euler
from .findings import Finding, lost, number, statement, undeterminable

_EXACT_M = 1e-12


def equations(machine: ThreePRRS) -> list[Finding]:
    """Degrees of freedom, [T] and eqs 1-6 in the paper's order."""
    poses = _poses(machine)
    return [_mobility(machine, poses), *_rotation(machine), *_loops(machine, poses), *_inverse(machine, poses)]


def _poses(machine: ThreePRRS, count: int = 300) -> Array:
    """Reachable poses (n, 6) with all three angles."""
    rng = np.random.default_rng(0)
    thrown = np.concatenate(
        [
            rng.uniform((-0.03, -0.03, 0.02), (0.03, 0.03, 0.14), (40 * count, 3)),
            rng.uniform(-0.25, 0.25, (40 * count, 3)),
        ],
        axis=-1,
    )
    return thrown[machine.reachable(thrown)][:count]


def _mobility(machine: ThreePRRS, poses: Array) -> Finding:
    links, joints, freedoms = 2 + 3 * 3, 3 * 4, 3 * (1 + 1 + 1 + 3)
    rank = np.linalg.matrix_rank(machine.jacobian(poses))
    return number(
        "Abstract and section 1, degrees of freedom",
        6.0,
        6 * (links - joints - 1) + freedoms,
        0.0,
        "",
        why=f"Kutzbach-Gruebler over {links} links and {joints} joints, of P, R, R and S in every leg. The six driven "
        f"joints' Jacobian has the rank {rank.min()} to {rank.max()} at {len(poses)} poses.",
    )


def _rotation(machine: ThreePRRS) -> list[Finding]:
    """The two ways to read the order of [T]."""
    angle = np.deg2rad(15.0)
    moving = rotation_from_euler(np.full(3, angle))
    about_x, about_y, about_z = rotation_from_euler(angle * np.eye(3))
    fixed = about_x @ about_y @ about_z
    heights = [1e3 * machine.platform_radius_m * float(turn[2, 0]) for turn in (moving, fixed)]
    return [
        undeterminable(
            "Section 1, [T]",
            "turned in the order Z-Y-X; the matrix is lost",
            "Rz Ry Rx about axes that move along, or Rx Ry Rz about fixed ones. At the two orientations of Figs 3 and "
            "4 both are Rx(alpha). Shown is the height of joint a1 over P at alpha = beta = gamma = 15 deg. This "
            "package uses the first.",
            alternatives=heights,
            tolerance=0.1,
            unit="mm",
        ),
    ]


def _loops(machine: ThreePRRS, poses: Array) -> list[Finding]:
    chains = machine.chains(poses)
    r = poses[:, None, :3]
    a = 0.5 * machine.base_diameter_m * RADIAL.T
    b = chains.joints[:, :3, None] * np.array([0.0, 0.0, 1.0])
    d = np.swapaxes(rotation_from_euler(poses[:, 3:]) @ (machine.platform_radius_m * RADIAL), -1, -2)
    # The link as the joints put it: turned about R1 by theta, about R2 by the swing.
    theta, swing = chains.joints[:, 3:, None], chains.swing[..., None]
    down = np.sin(theta) * TANGENTIAL.T - np.cos(theta) * np.array([0.0, 0.0, 1.0])
    f = np.sin(swing) * RADIAL.T + np.cos(swing) * down
    u = np.cos(theta) * TANGENTIAL.T + np.sin(theta) * np.array([0.0, 0.0, 1.0])
    link = machine.link_m
    loop = float(np.abs(a + b + link * f - d - r).max())
    first = np.stack([np.zeros(len(poses)), np.cos(theta[:, 0, 0]), np.sin(theta[:, 0, 0])], axis=-1)
    across = float(np.abs(np.sum(u * (link * f), axis=-1)).max())
    length = float(np.abs(np.linalg.norm(r - a - b + d, axis=-1) - link).max())
    vector = np.abs(np.sum(u * (r - a - b + d), axis=-1)).max()
    return [
        statement(
            "Eq. 1, loop",
            "r = a_i + b_i + l_i f_i - d_i",
            loop < _EXACT_M,
            f"With the link as its two rotations turn it: at most {loop:.0e} m at {len(poses)} poses of three angles.",
        ),
        statement(
            "Below eq. 1, u1",
            "u1 = (0, cos(theta1), sin(theta1))",
            bool(np.abs(first - chains.u[:, 0]).max() < _EXACT_M),
            "The axis of R2 of leg 1, whose R1 lies along X; u2 and u3 are lost in the source's text and taken as u1 "
            "turned by 120 and 240 deg about Z, as its sentence says.",
        ),
        statement(
            "Eq. 2, link across R2",
            "u_i . l_i f_i = 0",
            across < _EXACT_M,
            f"At most {across:.0e} m.",
        ),
        statement(
            "Eq. 3, link length", "l_i = |r - a_i - b_i + d_i|", length < _EXACT_M, f"Off by at most {length:.0e} m."
        ),
        statement(
            "Eq. 4, constraint",
            "u_i . f_i = u_i . (r - a_i - b_i + d_i) = 0",
            bool(vector < _EXACT_M),
            f"At most {vector:.0e} m. The vector in brackets is l_i f_i; as both products vanish the missing length "
            "does no harm.",
        ),
    ]


def _inverse(machine: ThreePRRS, poses: Array) -> list[Finding]:
    arm = np.swapaxes(rotation_from_euler(poses[:, 3:]) @ (machine.platform_radius_m * RADIAL), -1, -2)
    tip = poses[:, None, :3] + arm
    across = np.linalg.norm(tip - 0.5 * machine.base_diameter_m * RADIAL.T, axis=-1)
    # Of |a_i - M_i - L z| = l, (across without its height)^2 + (a_z - L)^2 = l^2.
    level_square = across**2 - tip[..., 2] ** 2
    joints = machine.inverse(poses)
    roots = np.stack(
        [
            np.array([np.roots([1.0, -2.0 * z, z * z + h - machine.link_m**2]) for z, h in zip(*leg, strict=True)])
            for leg in zip(tip[..., 2].T, level_square.T, strict=True)
        ],
        axis=1,
    )
    upper, lower = roots.real.max(axis=-1), roots.real.min(axis=-1)
    off = float(np.abs(upper - joints[:, :3]).max())
    above = bool(np.all(upper > tip[..., 2]) and np.all(lower < tip[..., 2]))
    offset = tip - 0.5 * machine.base_diameter_m * RADIAL.T
    tangential = np.sum(offset * TANGENTIAL.T, axis=-1)
    drop = joints[:, :3] - tip[..., 2]
    closes = float(np.abs(np.cos(joints[:, 3:]) * tangential - np.sin(joints[:, 3:]) * drop).max())
    return [
        statement(
            "Text at eq. 5, roots",
            "every L_i has two roots, and with + the slider is above the platform",
            above and off < 1e-9,
            "The two roots of eq. 3 in L_i found as a polynomial's at "
            f"{len(poses)} poses: one above its spherical joint, one below; the upper one is this package's L_i to "
            f"{off:.0e} m.",
        ),
        lost(
            "Eq. 5, L_i",
            "L_i from eq. 3",
            "Derived again from eq. 3: L_i = a_iz + sqrt(l^2 - rho_i^2), rho_i the level distance of a_i from the "
            "slider's axis; it is the upper root of the row above.",
        ),
        lost(
            "Eq. 6, theta_i",
            "theta_i from eq. 4 with eq. 5",
            "Derived again: tan(theta_i) = (tangential part of a_i - G_i) / (L_i - a_iz). With it eq. 4 holds to "
            f"{closes:.0e} m at {len(poses)} poses.",
        ),
        lost(
            "Section 2 (3), angle of the spherical joints",
            "from the platform's z axis and f_i",
            "Taken as the angle between the two, at most delta.",
        ),
        lost(
            "Section 2 (4), length h_i of the common normal",
            "from l_i and l_(i+1)",
            "Its text is tested in the row on the interior.",
        ),
    ]
