"""Other packages' environments, timed in processes of their own: what is not installed or fails says so in a line.

Give them an environment of their own (``--peers-python``), with ``mujoco<3.4`` for Gymnasium-Robotics 1.4.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from fieldgym.scripts.speed_lines import Line

_STEPS = """
import json, sys, time
import gymnasium as gym
import {module}
{register}
budget_s = float(sys.argv[1])
def rate(env):
    env.reset(seed=0)
    env.action_space.seed(0)
    for _ in range(5):
        env.step(env.action_space.sample())
    actions = [env.action_space.sample() for _ in range(64)]
    best, end = 0.0, time.perf_counter() + budget_s
    while time.perf_counter() < end:
        start, steps = time.thread_time(), 0
        while time.thread_time() - start < 0.2:
            _, _, done, cut, _ = env.step(actions[steps % 64])
            steps += 1
            if done or cut:
                env.reset()
        best = max(best, steps / (time.thread_time() - start))
    return best
out = {{"steps": rate(gym.make({env!r}))}}
try:
    env = gym.make({env!r}, render_mode="rgb_array")
    env.reset(seed=0)
    env.render()
    times = []
    for _ in range(5):
        env.step(env.action_space.sample())
        start = time.thread_time()
        picture = env.render()
        times.append(time.thread_time() - start)
    out["frame_ms"] = 1e3 * min(times)
    out["size"] = list(picture.shape[:2])
except Exception as error:
    out["frame_error"] = f"{{type(error).__name__}}: {{error}}".splitlines()[0][:60]
{more}
print(json.dumps(out))
"""

_PANDA_IK = """
robot = gym.make({env!r}).unwrapped.robot
import numpy as np
pose, turn, best = np.array([0.4, 0.1, 0.3]), np.array([1.0, 0.0, 0.0, 0.0]), 0.0
for _ in range(5):
    start = time.thread_time()
    for i in range(200):
        robot.inverse_kinematics(link=11, position=pose + 1e-3 * (i % 7), orientation=turn)
    best = max(best, 200 / (time.thread_time() - start))
out["ik"] = best
"""

_JUMANJI = """
import json, sys, time
import jax, jumanji
env = jumanji.make("BinPack-v2")
step, (state, _) = jax.jit(env.step), jax.jit(env.reset)(jax.random.PRNGKey(0))
action = env.action_spec.generate_value()
state, _ = step(state, action)
best, end = 0.0, time.perf_counter() + float(sys.argv[1])
while time.perf_counter() < end:
    start = time.perf_counter()
    for _ in range(100):
        state, _ = step(state, action)
    jax.block_until_ready(state)
    best = max(best, 100 / (time.perf_counter() - start))
print(json.dumps({"steps": best}))
"""


def _gymnasium(module: str, env: str, register: bool, more: str = "") -> str:
    call = f"gym.register_envs({module})" if register else ""
    return _STEPS.format(module=module, env=env, register=call, more=more.format(env=env) if more else "")


PEERS = {
    "panda-gym, PandaPickAndPlace": _gymnasium("panda_gym", "PandaPickAndPlace-v3", True, _PANDA_IK),
    "Gymnasium-Robotics, FetchPickAndPlace": _gymnasium("gymnasium_robotics", "FetchPickAndPlace-v4", True),
    "PyFlyt, QuadX-Hover": _gymnasium("PyFlyt.gym_envs", "PyFlyt/QuadX-Hover-v4", False),
    "HighwayEnv, highway": _gymnasium("highway_env", "highway-v0", True),
    "Jumanji, BinPack": _JUMANJI,
}
"""A program a peer, which prints its figures as JSON: steps a second, a frame's milliseconds, poses a second."""


def peers(quick: bool, python: Path | None = None) -> Iterator[Line]:
    """Steps, frames and inverse kinematics of what is installed, and how many times that this package does.

    Args:
        quick: shorter.
        python: interpreter that has the peers; this one by default.
    """
    from fieldgym.envs import env_ids
    from fieldgym.mechanisms import FiveBar
    from fieldgym.scripts.speed_decisions import batch_decisions, single_decisions
    from fieldgym.scripts.speed_lines import best_of

    first = env_ids()[0]
    own = {
        "single": single_decisions(first, quick, backend="analytic"),
        "batch": batch_decisions(first, 1024, quick),
        "PyBullet": single_decisions(first, quick, backend="pybullet", perception="perfect"),
        "frame": _own_frame_ms(first),
    }
    bar = FiveBar.safflower()
    own["ik"] = 1.0 / best_of(lambda: [bar.inverse((0.29, -0.40)) for _ in range(2_000)], 7) * 2_000
    yield Line("ours, single", own["single"], "steps/s", note=first.removeprefix("fieldgym/"))
    yield Line("ours, batch of 1,024", own["batch"], "steps/s")
    yield Line("ours, the machine in PyBullet", own["PyBullet"], "steps/s")
    yield Line("ours, a picture of 640 x 480", own["frame"], "ms")
    yield Line("ours, inverse kinematics one by one", own["ik"], "poses/s")
    for name, code in PEERS.items():
        figures = _run(code, 0.5 if quick else 2.0, str(python or sys.executable))
        if isinstance(figures, str):
            yield Line(f"{name}: {figures}", None, "")
            continue
        steps = figures["steps"]
        note = f"ours {own['single'] / steps:,.0f} x, {own['batch'] / steps:,.0f} x, {own['PyBullet'] / steps:.2g} x"
        yield Line(name, steps, "steps/s", note=note)
        if "frame_ms" in figures:
            height, width = figures["size"]
            share = figures["frame_ms"] / own["frame"]
            yield Line("  a picture", figures["frame_ms"], "ms", note=f"{width} x {height}, {share:.2g} of ours")
        elif "frame_error" in figures:
            yield Line(f"  a picture: {figures['frame_error']}", None, "")
        if "ik" in figures:
            yield Line(
                "  inverse kinematics", figures["ik"], "poses/s", note=f"ours {own['ik'] / figures['ik']:,.0f} x"
            )


def _own_frame_ms(env_id: str) -> float:
    import gymnasium as gym

    from fieldgym.scripts.speed_lines import best_of

    env = gym.make(env_id, backend="analytic", render_mode="rgb_array")
    env.reset(seed=0)
    seconds = best_of(env.render, 7)
    env.close()
    return 1e3 * seconds


def _run(code: str, budget_s: float, python: str) -> dict | str:
    """The peer's figures, or why there are none."""
    try:
        done = subprocess.run(
            [python, "-c", code, str(budget_s)], capture_output=True, text=True, timeout=90.0, check=False
        )
    except subprocess.TimeoutExpired:
        return "took more than 90 s"
    lines = done.stdout.strip().splitlines()
    if done.returncode == 0 and lines:
        return json.loads(lines[-1])
    reason = (done.stderr.strip() or f"ended with {done.returncode}").splitlines()[-1]
    return "not installed" if reason.startswith("ModuleNotFoundError") else reason[:70]
