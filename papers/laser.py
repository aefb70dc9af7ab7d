"""Chapter of the laser weeding paper: what its text says about Figure 5, and its model put to the test."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ..mechanisms import ThreePRRS, ThreeUPSRPU
from . import laser_figures as draw
from . import laser_formulas
from . import laser_model as model
from .findings import Chapter, Figure, Finding, statement
from .laser_model import Array, Case, Curves, cases, curves, curves_of_eq_4

PAPER = (
    "Wang X., Huang J., Zhao D., Guo H., Li C., Zhang B.: Kinematics and statics analysis of a novel 4-DOF parallel "
    "mechanism for laser weeding robot. College of Engineering, China Agricultural University, Beijing."
)
PRINTED = "Rx Ry with the Y_o that the RPU leg asks of eq. 4"
FLAT = "Rx Ry with Y_o = 0, as eqs 18-19 list none"
EXACT = "the RPU leg's Ry Rx"
"""Readings of case 2: two of the paper's own model, and the mechanism's."""


def chapter() -> Chapter:
    """The laser paper's statements, each tested by computation, and its Figure 5 in both orientation models."""
    exact, printed = ThreeUPSRPU.published(), ThreeUPSRPU.published(paper_orientation=True)
    first, second = cases()
    found = {
        PRINTED: curves(printed, second),
        FLAT: curves_of_eq_4(exact.attachments, second),
        EXACT: curves(exact, second),
    }
    findings = [
        *model.mobility(exact, printed, first, second),
        *laser_formulas.formulas(exact, printed, second),
        *_case_one(curves(exact, first), curves(printed, first)),
        *_case_two(found, second.time_s),
        model.models(found[PRINTED], found[EXACT], second.time_s),
        *model.singularity(exact, first, second),
        *model.statics(exact, first, second),
        *_general(exact, curves(exact, first), found[EXACT]),
    ]
    return Chapter("laser", "Laser weeder, 3UPS-RPU", PAPER, findings, _figures(exact, printed, first, second))


def _case_one(exact: Curves, printed: Curves) -> list[Finding]:
    length, rate, acceleration = exact
    same = max(float(np.abs(a - b).max()) for a, b in zip(exact, printed, strict=True))
    between = all(_strictly_between(curve[1:]) for curve in (length, rate, acceleration))
    apart = max(float(np.abs(curve[:, 0] - curve[:, 2]).max()) for curve in exact)
    place = "Fig. 5"
    return [
        statement(
            f"{place}(a), start",
            "the lengths are initially the same",
            bool(np.ptp(length[0]) < 1e-9),
            f"All four are {length[0, 0]:.3f} mm at t = 0. In case 1 both orientation models give the same curves "
            f"(largest difference {same:.0e}).",
        ),
        statement(
            f"{place}(a), order",
            "leg 4 becomes the longest, leg 2 the shortest",
            _ordered(length[1:], 1, 3),
            f"l2, l1 = l3, l4 at t = 10 s: {length[-1, 1]:.3f}, {length[-1, 0]:.3f}, {length[-1, 3]:.3f} mm.",
        ),
        statement(
            f"{place}(b), order",
            "the velocity of leg 4 is the largest, of leg 2 always the smallest",
            _ordered(rate, 1, 3),
            f"v2, v1, v4: {rate[0, 1]:.4f}, {rate[0, 0]:.4f}, {rate[0, 3]:.4f} mm/s at t = 0 and "
            f"{rate[-1, 1]:.4f}, {rate[-1, 0]:.4f}, {rate[-1, 3]:.4f} mm/s at 10 s.",
        ),
        statement(
            f"{place}(c), order and sign",
            "the acceleration of leg 2 is the largest, of leg 4 the smallest, all above zero",
            _ordered(acceleration, 3, 1) and bool(acceleration.min() > 0.0),
            f"a4 falls from {acceleration[0, 3]:.4f} to {acceleration[-1, 3]:.4f} mm/s2, "
            f"a2 from {acceleration[0, 1]:.4f} to {acceleration[-1, 1]:.4f} mm/s2.",
        ),
        statement(
            f"{place}(a-c), legs 1 and 3",
            "legs 1 and 3 are always consistent and lie between legs 2 and 4",
            bool(apart < 1e-9 and between),
            f"They differ by at most {apart:.0e} (mm, mm/s, mm/s2) and lie between the others for t > 0.",
        ),
        statement(
            f"{place}(b, c), change",
            "velocity and acceleration change all the time",
            _always_changes(rate) and _always_changes(acceleration),
            "No two neighbours of 2001 samples are equal in any leg.",
        ),
    ]


def _case_two(found: dict[str, Curves], time: Array) -> list[Finding]:
    """What the paper says of case 2, in its own model under both readings of Y_o and in the mechanism's."""

    def row(panel: str, claim: str, holds: Callable[[Curves], bool], why: Callable[[Curves], str]) -> Finding:
        outcomes = {name: holds(sample) for name, sample in found.items()}
        texts = [
            f"{name}: {'holds' if outcomes[name] else 'does not hold'} ({why(sample)})"
            for name, sample in found.items()
        ]
        # The paper's claim is about its own model; the mechanism's is the correction.
        return statement(
            f"Fig. 5({panel})",
            claim,
            outcomes[PRINTED] or outcomes[FLAT],
            "; ".join(texts) + ".",
            corrected=outcomes[EXACT],
        )

    def slopes(sample: Curves) -> Array:
        return np.abs(np.gradient(sample.accelerations, time, axis=0))

    return [
        row(
            "d",
            "the lengths are initially the same; legs 1 and 2 become shorter, 3 and 4 longer",
            lambda sample: bool(
                np.ptp(sample.lengths[0]) < 1e-9
                and np.all(np.diff(sample.lengths[:, :2], axis=0) < 0.0)
                and np.all(np.diff(sample.lengths[:, 2:], axis=0) > 0.0)
            ),
            lambda sample: "l1..l4 at 10 s " + ", ".join(f"{value:.3f}" for value in sample.lengths[-1]) + " mm",
        ),
        row(
            "e, first half",
            "the velocities of legs 1 and 2 gradually increase",
            lambda sample: bool(np.all(np.diff(sample.velocities[:, :2], axis=0) > 0.0)),
            lambda sample: "v1 and v2 from {:.3f} to {:.3f} and {:.3f} mm/s".format(
                sample.velocities[0, 0], *sample.velocities[-1, :2]
            ),
        ),
        row(
            "e, second half",
            "the velocities of legs 3 and 4 continually decrease",
            lambda sample: bool(np.all(np.diff(sample.velocities[:, 2:], axis=0) < 0.0)),
            lambda sample: "largest at {:.2f} and {:.2f} s".format(*time[np.argmax(sample.velocities[:, 2:], axis=0)]),
        ),
        row(
            "f, first half",
            "the accelerations of legs 1 and 2 are always greater than zero",
            lambda sample: bool(np.all(sample.accelerations[:, :2] > 0.0)),
            lambda sample: "at least {:.4f} and {:.4f} mm/s2".format(*sample.accelerations[:, :2].min(axis=0)),
        ),
        row(
            "f, second half",
            "the accelerations of legs 3 and 4 are always less than zero",
            lambda sample: bool(np.all(sample.accelerations[:, 2:] < 0.0)),
            lambda sample: " and ".join(
                f"a{leg + 1} {_positive_until(time, sample.accelerations[:, leg])}" for leg in (2, 3)
            ),
        ),
        row(
            "f, slopes",
            "the slopes of legs 2 and 4 are larger than those of legs 1 and 3",
            lambda sample: bool(np.all(slopes(sample)[:, [1, 3]] > slopes(sample)[:, [0, 2]])),
            lambda sample: "leg 2 steeper than 1 in {:.0%}, 4 than 3 in {:.0%} of the time".format(
                *np.mean(slopes(sample)[:, [1, 3]] > slopes(sample)[:, [0, 2]], axis=0)
            ),
        ),
        row(
            "e, f, change",
            "velocity and acceleration shift at all times",
            lambda sample: _always_changes(sample.velocities) and _always_changes(sample.accelerations),
            lambda sample: "no two neighbours of 2001 samples are equal in any leg",
        ),
    ]


def _general(exact: ThreeUPSRPU, one: Curves, two: Curves) -> list[Finding]:
    box = model.weeding_grid()
    # Both signs of the determinant on a connected box: a singular surface passes through it.
    weeder = ThreeUPSRPU.weeder()
    published, eased = exact.singularity(box), weeder.singularity(box)
    condition = weeder.conditioning(box).number.max()
    other, moved = _mirrored_sliders()
    jumps = [_jump_ratio(curve) for sample in (one, two) for curve in sample]
    return [
        statement(
            "Abstract, legs 1 and 3",
            "their consistency in pure translation is unique to the proposed mechanism",
            not other < 1e-12,
            "Another mechanism of this package has it: in translations along X and Z of its mirror plane the 3-PRRS of "
            f"six freedoms moves sliders 2 and 3 alike, to {other:.0e} m over {moved} poses, and turns their drives "
            "alike but for the sign. It follows from the mirror symmetry about a plane that the translation keeps to.",
        ),
        statement(
            "Text on Fig. 5, stability",
            "steady movement that satisfies the laser's stability requirements",
            bool(published.smallest.min() > 0.05 and _signs(published.determinant) == "one sign"),
            "Over |x| <= 0.10 m, z 0.5..0.7 m, tilts +-14 deg the published layout passes through singular poses, "
            f"where its actuators do not hold it: det G takes {_signs(published.determinant)}. weeder(), with the same "
            f"radii and topology, takes {_signs(eased.determinant)} there; condition number at most {condition:.2f} "
            "(angles by r_b).",
            found=f"smallest singular value {abs(published.smallest.min()):.3f}; weeder() {eased.smallest.min():.3f}",
        ),
        statement(
            "Text on Fig. 5, smoothness",
            "the curves have no sudden changes or breakpoints",
            bool(max(jumps) < 0.6),
            "Halving the time step halves the largest step between neighbours in all six panels (ratio at most "
            f"{max(jumps):.3f}), as for curves without jumps.",
        ),
    ]


def _mirrored_sliders() -> tuple[float, int]:
    """Largest difference of sliders 2 and 3 of a 3-PRRS in level translations in its mirror plane, and poses tried."""
    machine = ThreePRRS.sorter()
    x, z = np.meshgrid(np.linspace(-0.2, 0.2, 41), np.linspace(0.0, 0.1, 11))
    poses = np.zeros((x.size, 6))
    poses[:, 0], poses[:, 2] = x.ravel(), z.ravel()
    joints = machine.inverse(poses[machine.reachable(poses)])
    apart = max(np.abs(joints[:, 1] - joints[:, 2]).max(), np.abs(joints[:, 4] + joints[:, 5]).max())
    return float(apart), len(joints)


def _figures(exact: ThreeUPSRPU, printed: ThreeUPSRPU, first: Case, second: Case) -> list[Figure]:
    time = first.time_s
    pairs = [(curves(exact, case), curves(printed, case)) for case in (first, second)]
    weeder = ThreeUPSRPU.weeder()
    forces = [machine.statics(second.poses, model.LOAD_N)[:, :4] for machine in (exact, weeder)]
    smallest = [[machine.singularity(case.poses).smallest for case in (first, second)] for machine in (exact, weeder)]
    return [
        Figure(
            "fig5-case1",
            "Fig. 5(a-c): lengths, velocities and accelerations in case 1; legs 1 and 3 coincide, and so do the two "
            "orientation models",
            partial(draw.legs, time=time, exact=pairs[0][0], printed=pairs[0][1], panels="abc"),
        ),
        Figure(
            "fig5-case2",
            "Fig. 5(d-f): the same in case 2, with the RPU leg's orientation Ry Rx (solid) and the printed Rx Ry "
            "(dashed; dotted with Y_o = 0)",
            partial(
                draw.legs,
                time=time,
                exact=pairs[1][0],
                printed=pairs[1][1],
                panels="def",
                flat=curves_of_eq_4(exact.attachments, second),
            ),
        ),
        Figure(
            "model-difference",
            "Printed minus exact orientation model in case 2",
            partial(draw.differences, time=time, exact=pairs[1][0], printed=pairs[1][1]),
        ),
        Figure(
            "singular-values",
            "Smallest singular value of G (angles by r_b) along both cases, and over x and beta at z = 0.6 m, "
            "alpha = 0, for the published layout and weeder()",
            partial(draw.singular_values, time=time, smallest=smallest, machines=(exact, weeder)),
        ),
        Figure(
            "null-twist",
            "Why the level published platform is loose: all leg lines meet in one point, and the platform turns about "
            "the Y-parallel through it; weeder()'s side legs miss it",
            partial(draw.null_twist, machines=(exact, weeder)),
        ),
        Figure(
            "leg-forces",
            f"Leg forces under {model.LOAD} (assumed) in case 2; those of the published layout exceed every bound "
            "towards t = 0",
            partial(draw.forces, time=time, forces=forces),
        ),
    ]


def _ordered(curve: Array, smallest: int, largest: int) -> bool:
    """Whether one leg's curve lies below all others everywhere, and another one above."""
    below, above = (curve[:, [leg]] - np.delete(curve, leg, axis=1) for leg in (smallest, largest))
    return bool(np.all(below < 0.0) and np.all(above > 0.0))


def _strictly_between(curve: Array) -> bool:
    low, high = np.minimum(curve[:, 1], curve[:, 3]), np.maximum(curve[:, 1], curve[:, 3])
    return all(bool(np.all((low < curve[:, leg]) & (curve[:, leg] < high))) for leg in (0, 2))


def _always_changes(curve: Array) -> bool:
    # Relative to the curve's size, so that rounding does not count as change.
    return bool(np.all(np.abs(np.diff(curve, axis=0)) > 1e-12 * np.abs(curve).max()))


def _positive_until(time: Array, curve: Array) -> str:
    above = curve > 0.0
    if not above.any():
        return "is negative throughout"
    last = int(np.flatnonzero(above)[-1])
    if last + 1 == len(time):
        return "is positive at the end"
    share = curve[last] / (curve[last] - curve[last + 1])
    return f"is positive until {time[last] + share * (time[last + 1] - time[last]):.2f} s"


def _signs(values: Array) -> str:
    return "both signs" if values.min() < 0.0 < values.max() else "one sign"


def _jump_ratio(curve: Array) -> float:
    return float((np.abs(np.diff(curve, axis=0)).max(axis=0) / np.abs(np.diff(curve[::2], axis=0)).max(axis=0)).max())
