"""Figures of the transplanting chapter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from ..mechanisms import TranslationalFiveBar
from ..motion import PathMotion, PolynomialLaw, StoppedPath

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

PAYLOAD_KG = 0.3


def laws(
    shapes: dict[str, PolynomialLaw], stroke_m: float, acceleration: float, velocity: float, canvas: Canvas
) -> None:
    """Displacement, speed, acceleration and saltus of the laws."""
    canvas.set_size_inches(8.0, 5.6)
    panels = canvas.subplots(2, 2).ravel()
    titles = ("displacement (m)", "speed (m/s)", "acceleration (m/s$^2$)", "saltus (m/s$^3$)")
    for name, law in shapes.items():
        duration = float(law.duration(stroke_m, np.inf, acceleration))
        # Just inside the ends, so that the quintic's saltus shows its steps.
        time = np.linspace(1e-9, 1.0 - 1e-9, 801) * duration
        state = law.sample(time, stroke_m, duration)
        for axes, values in zip(panels, state, strict=True):
            axes.plot(np.r_[0.0, time, duration], np.r_[0.0 * values[0], values, values[-1]], label=name)
    for axes, title in zip(panels, titles, strict=True):
        axes.set(xlabel="time (s)", ylabel=title)
    panels[1].axhline(velocity, color="r", ls="--", lw=1, label="limit 4.5 m/s")
    for axes in panels[:2]:
        axes.legend(fontsize=8)


def gate_paths(machine: TranslationalFiveBar, motions: dict[str, StoppedPath | PathMotion], canvas: Canvas) -> None:
    """Window, machine and paths."""
    canvas.set_size_inches(7.6, 6.2)
    axes = canvas.subplots()
    (left, bottom), (right, top) = np.array(machine.window_m) * 1e3
    axes.plot([left, right, right, left, left], [bottom, bottom, top, top, bottom], "--", color="0.5", lw=1)
    pose = machine._pose(np.array([left, bottom]) * 1e-3)
    for leg, offset in enumerate((machine.motor_offset_m, -machine.motor_offset_m)):
        line = 1e3 * np.stack([[offset, 0.0], pose.elbow[leg], pose.wrist[leg]])
        axes.plot(line[:, 0], line[:, 1], "k-o", lw=2, ms=4)
    for name, motion in motions.items():
        path = 1e3 * motion.sample(np.linspace(0.0, motion.duration_s, 801)).position
        axes.plot(path[:, 0], path[:, 1], label=f"{name}, {motion.duration_s:.3f} s")
    axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    canvas.legend(loc="outside lower center", ncols=2, fontsize=8)


def rates(per_minute: dict[str, float], target: float, canvas: Canvas) -> None:
    """Bars of the round trips a minute."""
    canvas.set_size_inches(8.0, 4.6)
    axes = canvas.subplots()
    names, values = list(per_minute), np.array(list(per_minute.values()))
    rows = np.arange(len(names))
    axes.barh(rows, values, color=np.where(values >= target, "tab:green", "tab:gray"))
    axes.axvline(target, color="r", ls="--", lw=1)
    plate = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
    for place, value in enumerate(per_minute.values()):
        axes.text(value + 1.0, place, f"{value:.1f}", va="center", fontsize=8, bbox=plate)
    axes.set(yticks=rows, yticklabels=names, xlabel="transplants a minute", xlim=(0, 1.1 * values.max()))
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")


def motor_curves(
    machine: TranslationalFiveBar,
    motion: StoppedPath | PathMotion,
    what: Literal["speed", "acceleration", "torque"],
    canvas: Canvas,
) -> None:
    """One quantity of both motors over a motion."""
    time = np.linspace(0.0, motion.duration_s, 1201)
    p, v, a = motion.sample(time)
    if what == "speed":
        values, label = machine.joint_rates(p, v), "motor speed (rad/s)"
    elif what == "acceleration":
        values, label = machine.joint_accelerations(p, v, a), "motor acceleration (rad/s$^2$)"
    else:
        values, label = machine.inverse_dynamics(p, v, a, PAYLOAD_KG), "motor torque (N m)"
    axes = canvas.subplots()
    for motor in range(2):
        axes.plot(time, values[:, motor], label=f"motor {motor + 1}")
    if isinstance(motion, StoppedPath):
        for corner in np.cumsum(motion.leg_s)[:-1]:
            axes.axvline(corner, color="0.6", lw=0.8, ls=":")
    axes.set(xlabel="time (s)", ylabel=label)
    axes.legend()
