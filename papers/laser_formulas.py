"""The laser paper's eqs 5-16 as printed and corrected, held against case 2 and its numerical derivatives."""

from __future__ import annotations

import numpy as np

from ..mechanisms import ThreeUPSRPU
from .findings import EXTRACTION, Finding, statement
from .laser_model import Array, Case

_STEP_S = 1e-2
_SMALL = 1e-12


def formulas(exact: ThreeUPSRPU, printed: ThreeUPSRPU, case: Case) -> list[Finding]:
    """Eqs 5-16 in the paper's order, along case 2."""
    return [*_velocities(exact, case), *_constraints(exact, printed, case), *_accelerations(exact, case)]


def _derivative(before: list[Array]) -> Array:
    """First derivative of five samples ``_STEP_S`` apart, at the middle one, to fourth order."""
    return (8.0 * (before[3] - before[1]) - (before[4] - before[0])) / (12.0 * _STEP_S)


def _near(case: Case) -> list[Array]:
    """The case's poses (n, 4) at five instants about each sample; its rates are constant."""
    return [case.poses + k * _STEP_S * case.rates for k in (-2, -1, 0, 1, 2)]


def _velocities(exact: ThreeUPSRPU, case: Case) -> list[Finding]:
    """Eqs 5-8."""
    chains, near = exact.chains(case.poses), _near(case)
    vectors = chains.platform - chains.base
    lengths = exact.inverse(case.poses)
    n = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    off = np.abs(chains.base + lengths[..., None] * n - chains.platform).max()
    twist = exact.twist(case.poses, case.rates)
    v, omega = twist[:, None, :3], twist[:, None, 3:]
    r = chains.platform - chains.centre[:, None]
    joints = _derivative([exact.chains(pose).platform for pose in near])
    apart = np.abs(v + np.cross(omega, r) - joints).max()
    legs = _derivative([exact.inverse(pose) for pose in near])
    forms = [
        np.sum((v + np.cross(omega, r)) * n, axis=-1),
        np.sum(n * v, axis=-1) + np.sum(np.cross(r, n) * omega, axis=-1),
    ]
    errors = [float(np.abs(form - legs).max()) for form in forms]
    rows = np.concatenate([n, np.cross(r, n)], axis=-1)
    matrix = float(np.abs((rows @ twist[..., None])[..., 0] - legs).max())
    size = float(np.abs(legs).max())
    # Differences of lengths of 0.6 m over hundredths of a second round to 1e-13 m/s.
    exactly = 1e-9 * size
    return [
        statement(
            "Eq. 5, unit vectors",
            "n_i = (B_i - A_i) / l_i",
            bool(off < _SMALL),
            f"A_i + l_i n_i with the lengths of eq. 4 is B_i to {off:.0e} m along case 2.",
        ),
        statement(
            "Eq. 6, velocity of B_i",
            "v_i = v + omega x r_i",
            bool(apart < exactly),
            f"Against the differentiated positions of B_i: at most {apart:.0e} m/s.",
        ),
        statement(
            "Eq. 7, velocity along a leg",
            "v_i . n_i = n_i . v + (r_i x n_i) . omega",
            max(errors) < exactly,
            f"Both sides against the differentiated lengths: at most {max(errors):.0e} m/s of {size:.4f} m/s.",
        ),
        statement(
            "Eq. 8, the four legs",
            "rows (n_i, r_i x n_i) times (v, omega)",
            matrix < exactly,
            f"Against the differentiated lengths: at most {matrix:.0e} m/s.",
        ),
    ]


def _constraints(exact: ThreeUPSRPU, printed: ThreeUPSRPU, case: Case) -> list[Finding]:
    """Eqs 9 and 10."""
    poses, rates = case.poses, case.rates
    twist, jacobian = exact.twist(poses, rates), exact.jacobian(poses)
    along_z = [
        np.abs(np.sum(machine.chains(poses).rotation[..., 2] * machine.twist(poses, rates)[:, 3:], axis=-1)).max()
        for machine in (exact, printed)
    ]
    along_n6 = np.abs(np.sum(jacobian[:, 5, 3:] * twist[:, 3:], axis=-1)).max()
    left = np.concatenate([exact.joint_rates(poses, rates), np.zeros((len(poses), 2))], axis=-1)
    along_z_row = jacobian.copy()
    along_z_row[:, 5, 3:] = exact.chains(poses).rotation[..., 2]
    errors = [np.abs((g @ twist[..., None])[..., 0] - left).max() for g in (along_z_row, jacobian)]
    return [
        statement(
            "Eq. 9, n6 along the platform's z",
            "the constraint couple along z does no work",
            bool(max(along_z) < _SMALL),
            f"The rate of turn about z reaches {along_z[0]:.4f} rad/s in case 2 ({along_z[1]:.4f} rad/s with Rx Ry); "
            f"about n6 = (sin(beta), 0, cos(beta)), normal to both axes of the joint, it is {along_n6:.0e} rad/s.",
            corrected=bool(along_n6 < _SMALL),
        ),
        statement(
            "Eq. 10, (v_l, 0, 0) = G V",
            "G with n6 along the platform's z gives the legs' rates and two zeros",
            bool(errors[0] < _SMALL),
            f"Off by {errors[0]:.4f} rad/s in the last row, by {errors[1]:.0e} with the n6 of the row above. Whether G "
            "can be inverted is in the rows on eqs 10 and 16.",
            corrected=bool(errors[1] < _SMALL),
        ),
    ]


def _accelerations(exact: ThreeUPSRPU, case: Case) -> list[Finding]:
    """Eqs 11-16."""
    poses, rates, near = case.poses, case.rates, _near(case)
    twist, change = exact.twist(poses, rates), exact.twist_rate(poses, rates, np.zeros(4))
    rate = np.abs(_derivative([exact.twist(pose, rates) for pose in near]) - change).max()
    bent = np.einsum("ni,nkij,nj->nk", twist, exact.hessian(poses), twist)
    right = (exact.jacobian(poses) @ change[..., None])[..., 0] + bent
    legs = exact.joint_accelerations(poses, rates, np.zeros(4))
    normal = exact.chains(poses).rotation[..., 2]
    turning = np.cross(twist[:, 3:], normal)
    drift = np.abs(np.sum(normal * change[:, 3:], axis=-1) + np.sum(turning * twist[:, 3:], axis=-1)).max()
    printed_5 = np.abs(right[:, 4] - 2.0 * bent[:, 4]).max()
    curved = _derivative([exact.joint_rates(pose, rates) for pose in near])
    apart = float(np.abs(right[:, :4] - curved).max())
    size = float(np.abs(curved).max())
    x, y = np.random.default_rng(0).normal(size=(2, 100, 3))
    skew = np.array([[[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]] for a, b, c in x])
    product = np.abs((skew @ y[..., None])[..., 0] - np.cross(x, y)).max()
    turned = np.abs(np.swapaxes(skew, -1, -2) + skew).max()
    return [
        statement(
            "Eq. 11, A",
            "A = (a, angular acceleration), the rate of V",
            bool(rate < 1e-9),
            f"Against the differentiated twist of case 2: at most {rate:.0e}.",
        ),
        statement(
            "Eq. 12, skew matrix",
            "x^ y = x x y, and the transpose of x^ is -x^",
            bool(product < _SMALL and turned < _SMALL),
            f"At 100 random pairs: {product:.0e} and {turned:.0e}. The identity between them has lost its symbols in "
            "the source's text and is not judged.",
        ),
        statement(
            "Eq. 13, H_1..H_4",
            "the legs' accelerations follow from G and H_i",
            bool(np.abs(right[:, :4] - legs).max() < _SMALL),
            f"Against the accelerations written out as vectors: at most {np.abs(right[:, :4] - legs).max():.0e} m/s2.",
        ),
        statement(
            "Eq. 14, H_5 = -r4^ n5^",
            "the constraint's acceleration vanishes",
            bool(printed_5 < _SMALL),
            f"Left over in case 2: {1e3 * printed_5:.4f} mm/s2 as printed, {1e3 * np.abs(right[:, 4]).max():.0e} mm/s2 "
            "with H_5 = +r4^ n5^." + EXTRACTION,
            corrected=bool(np.abs(right[:, 4]).max() < _SMALL),
        ),
        statement(
            "Eq. 15, H_6 with n6 along z",
            "the couple's constraint holds to second order",
            bool(drift < _SMALL),
            f"Left over in case 2: {drift:.1e} rad/s2 with n6 along z and its exact derivative, "
            f"{np.abs(right[:, 5]).max():.0e} rad/s2 with the n6 above, whose J has the row (cos(beta), 0, -sin(beta)) "
            "for y and zeros elsewhere. The matrices of the printed J have lost their symbols in the source's text.",
            corrected=bool(np.abs(right[:, 5]).max() < _SMALL),
        ),
        statement(
            "Eq. 16, a_m = G A + V^T H V",
            "the legs' accelerations and two zeros, with H_5 and H_6 as printed",
            bool(max(apart, printed_5, drift) < 1e-9 * size),
            f"The legs' four agree with the differentiated rates to {apart:.0e} m/s2; the zeros are off by "
            f"{printed_5:.1e} m/s2 and {drift:.1e} rad/s2 as printed, by {np.abs(right[:, 4:]).max():.0e} with H_5 and "
            "H_6 of the rows above.",
            corrected=bool(max(apart, float(np.abs(right[:, 4:]).max())) < 1e-9 * size),
        ),
    ]
