"""Chapter of the seedling transplanting paper: its two motion laws, its rate, its inverse kinematics."""

from __future__ import annotations

from functools import partial
from typing import cast

import numpy as np
from scipy.optimize import brentq

from ..mechanisms import TranslationalFiveBar
from ..motion import QUINTIC, SEPTIC, Gate, GateStyle, OverlappedGate, PolynomialLaw, gate_corners
from . import transplanting_figures as draw
from .findings import Chapter, Figure, Finding, number, statement, undeterminable
from .transplanting_formulas import kinematics, laws

PAPER = (
    "Qi C., Hu J., Ma J., Zhang J.: Solving motion law by numerical simulation on bowl seeding transplanting robot. "
    "CCTA 2011, pp. 103-111, doi 10.1007/978-3-642-27275-2_11."
)

STROKE_M, RISE_M = 0.600, 0.150
VELOCITY, ACCELERATION = 4.5, 60.0
PER_MINUTE = 100.0
"""Section 2.1: working space 600 x 150 mm, 4.5 m/s, 60 m/s2, 100 transplants a minute."""

START, END, LEVEL = (-0.300, -0.660), (0.300, -0.660), -0.510
"""The gate of section 3.3 in the window of ``TranslationalFiveBar.transplanter``."""


def chapter() -> Chapter:
    """The transplanting paper's numbers and statements."""
    machine = TranslationalFiveBar.transplanter()
    findings = [*_constants(), *laws(), *_laws(), _rate(), *kinematics(machine), _window(machine), _motors(machine)]
    gates = {
        "quintic, stop at corners": _gate("stop-quintic"),
        "minimum time, stop at corners": _gate("stop-fastest"),
        "circular corners, r = 100 mm": _gate("blended", 0.05),
        "free path after 30 mm straight": _gate("time-optimal", 0.03),
    }
    motions = {name: gate.motion(START, END, LEVEL) for name, gate in gates.items()}
    figures = [
        Figure(
            "laws",
            "Figs 4 to 7 drawn again: displacement, speed, acceleration and saltus (jerk) of both laws for S = 600 mm "
            "and a = 60 m/s2, with the durations of eqs 5 and 10.",
            partial(draw.laws, {law.name: law for law in (QUINTIC, SEPTIC)}, STROKE_M, ACCELERATION, VELOCITY),
        ),
        Figure(
            "gate",
            "Fig. 3 drawn again in the machine's window, with three ways of passing the corners, and the machine at "
            "the start.",
            partial(draw.gate_paths, machine, motions),
        ),
        Figure(
            "rates",
            "Transplants a minute, out and back over the full gate without time to grip, for each way of moving.",
            partial(draw.rates, dict(_ways()), PER_MINUTE),
        ),
        Figure(
            "motor-speeds",
            "Fig. 8 drawn again: speeds of both motors over the gate path, quintic law with stops, for the assumed "
            "link lengths.",
            partial(draw.motor_curves, machine, motions["quintic, stop at corners"], "speed"),
        ),
        Figure(
            "motor-accelerations",
            "Fig. 9 drawn again: accelerations of both motors over the same path.",
            partial(draw.motor_curves, machine, motions["quintic, stop at corners"], "acceleration"),
        ),
        Figure(
            "motor-torques",
            "Not in the paper: motor torques on the same path with the payload of 0.3 kg and the assumed link masses.",
            partial(draw.motor_curves, machine, motions["quintic, stop at corners"], "torque"),
        ),
    ]
    return Chapter("transplanting", "Seedling transplanter, translational five-bar", PAPER, findings, figures)


def _gate(style: str, straight_m: float = 0.0) -> Gate:
    return Gate(cast("GateStyle", style), VELOCITY, ACCELERATION, straight_m=straight_m)


def _constants() -> list[Finding]:
    tau = np.linspace(0.0, 1.0, 2_000_001)
    found = []
    rows = ((QUINTIC, "Eqs 1 and 5", 5.7735, 5e-5), (SEPTIC, "Eqs 6 and 10", 7.51, 5e-3))
    for law, place, printed, tolerance in rows:
        measured = float(np.max(np.abs(law.shape(tau)[2])))
        found.append(
            number(
                f"{place}, constant of the {law.name} law",
                printed,
                measured,
                tolerance,
                "",
                why=f"Largest |d2s/dtau2| on a grid; in closed form {law.peak_acceleration:.6f} "
                f"({'10 / sqrt 3' if law is QUINTIC else '84 sqrt 5 / 25'}).",
            )
        )
    return found


def _duration(law: PolynomialLaw, stroke_m: float) -> float:
    """Eqs 5 and 10: without the limit on the speed."""
    return float(law.duration(stroke_m, np.inf, ACCELERATION))


def _laws() -> list[Finding]:
    times = {law.name: _duration(law, STROKE_M) for law in (QUINTIC, SEPTIC)}
    gates = {law.name: times[law.name] + 2.0 * _duration(law, RISE_M) for law in (QUINTIC, SEPTIC)}
    limited = {name: float(_gate(f"stop-{name}").durations(RISE_M, STROKE_M, RISE_M)) for name in times}
    states = {
        law.name: law.sample(np.linspace(1e-6, 1.0 - 1e-6, 200_001) * times[law.name], STROKE_M, times[law.name])
        for law in (QUINTIC, SEPTIC)
    }
    speed = {name: float(np.max(state.velocity)) for name, state in states.items()}
    saltus = {name: float(np.max(np.abs(state.jerk))) for name, state in states.items()}
    step = {name: float(np.abs(state.jerk[0])) for name, state in states.items()}
    first_peak = {name: float(np.argmax(state.acceleration)) / 200_000 * times[name] for name, state in states.items()}
    within = QUINTIC.duration(STROKE_M, VELOCITY, ACCELERATION)
    return [
        number(
            "Section 2.4 and conclusion 3, time saved by the quintic law",
            0.07,
            times["septic"] - times["quintic"],
            0.005,
            "s",
            corrected=gates["septic"] - gates["quintic"],
            why=f"Not over one stroke of 600 mm. Two readings give the same {gates['septic'] - gates['quintic']:.4f} "
            f"s, and the paper does not say which it means: the gate path of 150, 600 and 150 mm "
            f"({gates['quintic']:.4f} against {gates['septic']:.4f} s), and 600 mm out and back "
            f"({2.0 * times['quintic']:.4f} against {2.0 * times['septic']:.4f} s), since two strokes of 150 mm take "
            "as long as one of 600. With the speed limit kept too the gate path saves "
            f"{limited['septic'] - limited['quintic']:.3f} s.",
        ),
        statement(
            "Section 2.1 with eqs 5 and 10, speed",
            "the manipulator's speed stays below 4.5 m/s",
            max(speed.values()) <= VELOCITY,
            f"The durations of eqs 5 and 10 ask for {speed['quintic']:.2f} m/s (quintic) and {speed['septic']:.2f} m/s "
            f"(septic) over 600 mm.",
            corrected=bool(QUINTIC.peak_velocity * STROKE_M / within <= VELOCITY * (1.0 + 1e-12)),
        ),
        statement(
            "Section 2.4, order in time",
            "the quintic law arrives at its greatest displacement, velocity and acceleration in shorter time",
            times["quintic"] < times["septic"] and first_peak["quintic"] < first_peak["septic"],
            f"Duration {times['quintic']:.4f} against {times['septic']:.4f} s, greatest speed after half of it, first "
            f"greatest acceleration after {first_peak['quintic']:.4f} against {first_peak['septic']:.4f} s.",
        ),
        statement(
            "Section 2.4 and Fig. 7, saltus",
            "the quintic law's saltus is more stable and smaller",
            saltus["quintic"] < saltus["septic"],
            f"Peak {saltus['quintic']:.0f} against {saltus['septic']:.0f} m/s3; at the ends the quintic's jumps from 0 "
            f"to {step['quintic']:.0f} m/s3, the septic's starts from {step['septic']:.0f}.",
        ),
        statement(
            "Section 2.2, requirements",
            "rest at both ends, continuous first and second derivatives, limited third one",
            all(
                max(abs(float(values[end])) / float(np.max(np.abs(values))) for end in (0, -1)) < 1e-4
                for state in states.values()
                for values in (state.velocity, state.acceleration)
            )
            and all(np.isfinite(value) for value in saltus.values()),
            "Both laws: speed and acceleration tend to zero at both ends, the saltus is finite.",
        ),
    ]


def _ways() -> list[tuple[str, float]]:
    """Round trips a minute over the full gate, no time to grip."""
    ways = [
        ("septic law, stop at corners", _gate("stop-septic")),
        ("quintic law, stop at corners", _gate("stop-quintic")),
        ("minimum time, stop at corners", _gate("stop-fastest")),
        *((f"circular corners, r = {r} mm", _gate("blended", RISE_M - 1e-3 * r)) for r in (50, 100, 125, 150)),
        *((f"free path after {h} mm straight", _gate("time-optimal", 1e-3 * h)) for h in (50, 30, 0)),
    ]
    rates = [(name, 30.0 / float(gate.durations(RISE_M, STROKE_M, RISE_M))) for name, gate in ways]
    corners = gate_corners(START, END, LEVEL)
    for per_axis, name in ((False, "limits on the tool"), (True, "limits on each axis")):
        gate = OverlappedGate.under_limits(corners, VELOCITY, ACCELERATION, 0.5, per_axis=per_axis)
        rates.append((f"quintic law, lifts half overlapped, {name}", 30.0 / gate.duration_s))
    return rates


def _rate() -> Finding:
    """The one claim about 100 transplants a minute, under every way to read and to reach it."""
    rates = dict(_ways())
    quintic = _gate("stop-quintic")

    def excess(stroke: float, rise: float) -> float:
        return float(quintic.durations(rise, stroke, rise)) - 30.0 / PER_MINUTE

    reach = {rise: 1e3 * cast("float", brentq(excess, 1e-6, 1.0, args=(rise,))) for rise in (0.150, 0.050, 0.025)}
    there_and_back = rates["quintic law, stop at corners"]
    others = ", ".join(f"{name} {rate:.1f}" for name, rate in rates.items() if name != "quintic law, stop at corners")
    return undeterminable(
        "Section 2.1 and conclusion 3, 100 transplants a minute",
        PER_MINUTE,
        "What is counted and over which strokes it is an average is not printed. Without time to grip the chosen "
        f"quintic law with stops makes {there_and_back:.1f} round trips over the full gate a minute, "
        f"{2.0 * there_and_back:.1f} motions one way, and 100 round trips over "
        + ", ".join(f"{stroke:.0f} mm with a lift of {1e3 * rise:.0f} mm" for rise, stroke in reach.items())
        + f". Round trips a minute over the full gate by ways of moving that the paper does not propose: {others}.",
        alternatives=[there_and_back, 2.0 * there_and_back],
        tolerance=0.5,
        unit="per minute",
    )


def _window(machine: TranslationalFiveBar) -> Finding:
    grid = machine.window_grid(121, 31)
    condition, smallest, _ = machine.conditioning(grid)
    forearms = float(np.rad2deg(np.min(machine.transmission_angles(grid)[..., 2])))
    return statement(
        "Section 2.1, working space",
        "600 x 150 mm",
        bool(np.all(machine.reachable(grid))),
        f"Reached by e = 150, l1 = 360, l2 = 640 mm below y = -510 mm (assumed, the paper prints no lengths): "
        f"condition number at most {np.max(condition):.3f}, forearms at least {forearms:.1f} deg off one line, at most "
        f"{VELOCITY / np.min(smallest):.1f} rad/s at 4.5 m/s.",
    )


def _motors(machine: TranslationalFiveBar) -> Finding:
    """Peak motor speed over the gate for link lengths that all serve the window."""
    motion = _gate("stop-quintic").motion(START, END, LEVEL)
    state = motion.sample(np.linspace(0.0, motion.duration_s, 1001))
    peaks = {}
    for l1, l2 in ((0.30, 0.66), (0.36, 0.64), (0.42, 0.62), (0.48, 0.62)):
        other = TranslationalFiveBar(
            machine.motor_offset_m,
            l1,
            l2,
            machine.window_m,
            arm_range_rad=machine.arm_range_rad,
            min_forearm_angle_rad=machine.min_forearm_angle_rad,
            min_elbow_angle_rad=machine.min_elbow_angle_rad,
        )
        if np.all(other.reachable(machine.window_grid(61, 16))):
            peaks[l1, l2] = float(np.max(np.abs(other.joint_rates(state.position, state.velocity))))
    own = machine.joint_accelerations(state.position, state.velocity, state.acceleration)
    return undeterminable(
        "Fig. 8, peak motor speed over the gate",
        "curve only",
        "The link lengths are not printed, and all of these serve the window: "
        + ", ".join(f"{1e3 * l1:.0f} + {1e3 * l2:.0f} mm {peak:.1f} rad/s" for (l1, l2), peak in peaks.items())
        + f". The assumed machine peaks at {np.max(np.abs(own)):.0f} rad/s2.",
        alternatives=list(peaks.values()),
        tolerance=0.1,
        unit="rad/s",
    )
