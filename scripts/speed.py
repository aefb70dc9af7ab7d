"""How fast the package is, in one run: imports, kinematics, decisions, frames.

    python scripts/speed.py [--quick]

Every figure is the best of several repetitions (the machine's own noise only ever slows a repetition down), and what
is compared is measured side by side in the same run.
"""

from __future__ import annotations

import argparse
import importlib
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from rich.console import Console
from rich.table import Table

import fieldgym
from fieldgym.agents import act_single, make_policy, reference_policy
from fieldgym.envs import env_ids
from fieldgym.mechanisms import FiveBar, ThreePRRS, ThreeUPSRPU, TranslationalFiveBar
from fieldgym.scripts.speed_scenes import picture_scenes

SAFFLOWER = "fieldgym/SafflowerPicking-v0"
LASER = "fieldgym/LaserWeeding-v0"
FRONT_PICTURES = 60
LINES: list[tuple[str, str, str]] = []


def best_of(action: Callable[[], object], repetitions: int = 7) -> float:
    """Shortest time of an action, seconds."""
    action()
    times = []
    for _ in range(repetitions):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return min(times)


def import_times() -> None:
    """Fresh interpreters, so that nothing is cached in the process; NumPy and Gymnasium are most of it."""

    def start(code: str) -> float:
        return best_of(lambda: subprocess.run([sys.executable, "-c", code], check=True), 9)

    bare = start("pass")
    gymnasium, whole = start("import gymnasium") - bare, start("import fieldgym") - bare
    LINES.append(("import fieldgym", f"{whole:.3f} s", f"of which gymnasium {gymnasium:.3f} s; limit 0.3 s"))


def kinematics(quick: bool) -> None:
    """Inverse kinematics of the five-bar beside PyBullet's numeric solver on the same machine."""
    bar = FiveBar.safflower()
    low, high = bar.workspace(samples=20_000).points.min(axis=0), bar.workspace(samples=20_000).points.max(axis=0)
    generator = np.random.default_rng(0)
    rates = {}
    for batch in (1, 1_000, 1_000_000):
        points = generator.uniform(low, high, (batch, 2))
        repeats = max(1, 3_000 // batch)
        seconds = best_of(lambda p=points, n=repeats: [bar.inverse(p) for _ in range(n)], 5 if quick else 11)
        rates[batch] = batch * repeats / seconds
        LINES.append((f"five-bar inverse, batch {batch:,}", f"{rates[batch] / 1e6:.3f} million/s", ""))
    for name, machine, poses in other_mechanisms(generator):
        seconds = best_of(lambda m=machine, p=poses: m.inverse(p), 3 if quick else 7)
        LINES.append((f"{name} inverse, batch {len(poses):,}", f"{len(poses) / seconds / 1e6:.3f} million/s", ""))
    numeric = pybullet_inverse_rate(bar, 100 if quick else 400)
    LINES.append(
        (
            "PyBullet calculateInverseKinematics, one leg",
            f"{numeric / 1e6:.4f} million/s",
            f"five-bar is {rates[1_000_000] / numeric:,.0f} times that in batches, {rates[1] / numeric:.1f} one by one",
        )
    )
    newton = pinocchio_inverse_rate(50 if quick else 200)
    figure, note = "not installed", "pip install pin"
    if newton is not None:
        figure = f"{newton / 1e6:.4f} million/s"
        note = f"five-bar is {rates[1_000_000] / newton:,.0f} times that in batches"
    LINES.append(("Pinocchio, Newton steps, one leg", figure, note))


def other_mechanisms(generator: np.random.Generator) -> list[tuple[str, Any, np.ndarray]]:
    """The other machines with a million poses each, spread over their working boxes."""
    batch = 1_000_000

    def spread(low: list[float], high: list[float]) -> np.ndarray:
        return generator.uniform(low, high, (batch, len(low)))

    tilt = np.deg2rad(14.0)
    sorter_low, sorter_high = [-0.1, -0.1, 0.0, -0.2, -0.2, -0.7], [0.1, 0.1, 0.1, 0.2, 0.2, 0.7]
    return [
        ("translational five-bar", TranslationalFiveBar.transplanter(), spread([-0.3, -0.66], [0.3, -0.51])),
        ("3UPS-RPU", ThreeUPSRPU.weeder(), spread([-0.1, 0.5, -tilt, -tilt], [0.1, 0.7, tilt, tilt])),
        ("3-PRRS", ThreePRRS.sorter(), spread(sorter_low, sorter_high)),
    ]


def pinocchio_inverse_rate(calls: int) -> float | None:
    """Poses a second of damped Newton steps with Pinocchio on one leg of the picker; None where it is not installed."""
    try:
        pinocchio: Any = importlib.import_module("pinocchio")
    except ImportError:
        return None
    from fieldgym.simulation.assets import asset_path

    with asset_path("urdf/picker/picker.urdf") as path:
        model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    frame = model.getFrameId("forearm1", pinocchio.FrameType.BODY)
    tip = pinocchio.SE3(np.eye(3), np.array([0.0, FiveBar.safflower().forearm_m[0], 0.0]))
    # A turning joint may count as cosine and sine: poses are reached by turning, not by writing angles.
    turn = np.zeros(model.nv)
    turn[model.joints[model.getJointId("arm1")].idx_v] = -2.0
    turn[model.joints[model.getJointId("forearm1")].idx_v] = 1.2
    start = pinocchio.integrate(model, pinocchio.neutral(model), turn)
    pinocchio.framesForwardKinematics(model, data, start)
    home = (data.oMf[frame] * tip).translation.copy()

    def solve() -> None:
        for i in range(calls):
            q = start.copy()
            target = home + np.array([0.0, 0.02, 0.01 * (i % 5)])
            for _ in range(50):
                pinocchio.computeJointJacobians(model, data, q)
                pinocchio.updateFramePlacements(model, data)
                placed = data.oMf[frame] * tip
                gap = target - placed.translation
                if np.linalg.norm(gap) < 1e-9:
                    break
                full = pinocchio.getFrameJacobian(model, data, frame, pinocchio.LOCAL_WORLD_ALIGNED)
                arm = placed.translation - data.oMf[frame].translation
                jacobian = full[:3] - np.cross(arm, full[3:].T).T
                step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-9 * np.eye(3), gap)
                q = pinocchio.integrate(model, q, step)

    return calls / best_of(solve, 3)


def pybullet_inverse_rate(bar: FiveBar, calls: int) -> float:
    """Poses a second of PyBullet's numeric inverse on one leg; the closed loop would need two and their match."""
    from fieldgym.simulation.client import pybullet
    from fieldgym.simulation.picker import PickerMachine

    with PickerMachine() as machine:
        link = pybullet.getNumJoints(machine.body_id, physicsClientId=machine.client.id) - 1
        target = machine.tool_world()

        def solve() -> None:
            for i in range(calls):
                pybullet.calculateInverseKinematics(
                    machine.body_id, link, target + 1e-4 * (i % 7), physicsClientId=machine.client.id
                )

        return calls / best_of(solve, 3)


def single_decisions(env_id: str, quick: bool, **settings: Any) -> float:
    """Decisions a second of a single environment as ``gym.make`` gives it, resets included, the policy's time not."""
    env = gym.make(env_id, **settings)
    policy = make_policy(reference_policy(env_id), env)
    decisions = (60 if quick else 150) if settings["backend"] == "pybullet" else (1_000 if quick else 3_000)
    observation, _ = env.reset(seed=0)
    rates = []
    for _ in range(3 if quick else 7):
        spent = 0.0
        for _ in range(decisions):
            action = act_single(policy, observation)
            start = time.perf_counter()
            observation, _, end, cut, _ = env.step(action)
            if end or cut:
                observation, _ = env.reset()
            spent += time.perf_counter() - start
        rates.append(decisions / spent)
    env.close()
    return max(rates)


def vector_decisions(env_id: str, worlds: int, quick: bool) -> float:
    """Decisions a second of the vector environment, resets included, the policy's time not."""
    env = gym.make_vec(env_id, num_envs=worlds, vectorization_mode="vector_entry_point")
    policy = make_policy(reference_policy(env_id), env)
    observation, _ = env.reset(seed=0)
    steps, stepping = max(60 if quick else 200, 2_000 // worlds), []
    for _ in range(steps):
        actions = policy.act(observation)
        start = time.perf_counter()
        observation, *_ = env.step(actions)
        stepping.append(time.perf_counter() - start)
    # Sums over stretches of steps keep the resets in; the best stretch is the least disturbed one.
    stretch = [sum(stepping[i : i + steps // 5]) for i in range(0, steps - steps // 5 + 1, steps // 5)]
    return worlds * (steps // 5) / min(stretch)


def decisions(quick: bool) -> None:
    """Every environment: one world, a batch, and the machine in PyBullet without its camera."""
    for env_id in env_ids():
        name = env_id.removeprefix("fieldgym/")
        figures = (
            ("single, analytic", lambda e=env_id: single_decisions(e, quick, backend="analytic")),
            *(
                (f"batch of {n:,}", lambda e=env_id, n=n: vector_decisions(e, n, quick))
                for n in ((1, 64, 1024) if env_id == SAFFLOWER else (1024,))
            ),
            ("PyBullet", lambda e=env_id: single_decisions(e, quick, backend="pybullet", perception="perfect")),
        )
        for what, measure in figures:
            LINES.append((f"{name}, {what}", f"{measure():,.0f} decisions/s", ""))


def camera_frames() -> None:
    """The picker's camera: one rendered RGB-D look, and one look with its heads found."""
    from fieldgym.perception import blooms

    for scenario in ("pots", "row"):
        env: Any = gym.make(SAFFLOWER, backend="analytic", perception="camera", scenario=scenario).unwrapped
        env.reset(seed=0)
        look = env.view.look()
        render_s = best_of(env.view.look, 15)
        detect_s = best_of(lambda frame=look: blooms.detect(frame), 15)
        height, width = look.depth_m.shape
        note = f"{width} x {height}: render {1e3 * render_s:.0f} ms, detect {1e3 * detect_s:.0f} ms"
        LINES.append((f"camera frame, {scenario}", f"{1e3 * (render_s + detect_s):.0f} ms", note))
        env.close()


def front_camera() -> None:
    """The weeders' front camera on a strip as it is driven: one picture rendered, and its plants found."""
    from fieldgym.perception import weeds

    for scenario in ("load-1.25", "dense"):
        env: Any = gym.make(LASER, backend="analytic", perception="camera", scenario=scenario)
        policy = make_policy("edf", env)
        observation, _ = env.reset(seed=3)
        for _ in range(15):
            observation, *_ = env.step(act_single(policy, observation))
        scene, cart_m = env.unwrapped.view.camera_scene(), float(env.unwrapped.core.state.cart[0])
        renders, detects = [], []
        for picture in range(FRONT_PICTURES):
            began = time.perf_counter()
            frame = scene.look_front(cart_m + 0.06 * picture)
            seen = time.perf_counter()
            weeds.detect(frame)
            renders.append(seen - began)
            detects.append(time.perf_counter() - seen)
        together = 1e3 * np.add(renders, detects)
        note = f"{scene.front.width} x {scene.front.height}, median of {FRONT_PICTURES}: "
        note += f"render {1e3 * np.median(renders):.0f} ms, detect {1e3 * np.median(detects):.0f} ms, "
        note += f"slowest tenth {np.percentile(together, 90):.0f} ms"
        LINES.append((f"front camera frame, {scenario}", f"{np.median(together):.0f} ms", note))
        env.close()


def pictures(quick: bool) -> None:
    """Frames of every camera and pictures for people, each beside PyBullet's software renderer on the same scene."""
    for name, target_ms, draw, tiny in picture_scenes():
        own_s = best_of(draw, 7 if quick else 31)
        theirs_s = best_of(tiny, 2 if quick else 5)
        note = f"target {target_ms:g} ms; PyBullet {1e3 * theirs_s:.1f} ms, {theirs_s / own_s:.0f} times as long"
        LINES.append((name, f"{1e3 * own_s:.2f} ms", note))


def tracking() -> None:
    """Tracking and closure on the fastest motion that the task commands."""
    from fieldgym.simulation.picker import measure_tracking

    report = measure_tracking()
    LINES.append(
        (
            "picker, fastest gate: largest errors",
            f"tracking {1e3 * report.arm_error_m:.3f} mm, closure {1e3 * report.closure_error_m:.3f} mm",
            "limit 0.3 mm",
        )
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="fewer repetitions")
    quick = parser.parse_args().quick
    console = Console()
    with console.status("measuring") as status:
        for name, measure in (
            ("imports", import_times),
            ("kinematics", lambda: kinematics(quick)),
            ("decisions", lambda: decisions(quick)),
            ("camera frames", camera_frames),
            ("the weeders' front camera", front_camera),
            ("pictures", lambda: pictures(quick)),
            ("tracking", tracking),
        ):
            status.update(f"measuring: {name}")
            measure()
    table = Table("what", "figure", "note", title=f"fieldgym {fieldgym.__version__}")
    for line in LINES:
        table.add_row(*line)
    console.print(table)


if __name__ == "__main__":
    main()
