"""What a machine's motors and its tool's mass do to its work, and whether any numbers break it.

    python scripts/machine_limits.py [--task SafflowerPicking] [--seeds 8] [--physics 8] [--limits 0.5 0.7 1 1.4 2]
    python scripts/machine_limits.py --random 10000 [--backend analytic]

The first form prints, for every machine, cycle time and net rate of the task's reference policy with all motor limits
and the tool's mass times a factor; a cell that is not played says which motor refuses. With ``--physics N`` the first N
seeds are played in PyBullet too. The second form makes environments with random limits, masses and friction, a third
of them with drives that err, and plays a few decisions in each that is not refused.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from rich.console import Console
from rich.table import Table

from fieldgym.agents import make_policy, reference_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.kernels.config import ConfigError
from fieldgym.kernels.seeds import DRIVES

LIMITS = (0.5, 0.7, 1.0, 1.4, 2.0)
MASSES = (1.0, 1.5, 2.0, 3.0)
DECISIONS = 6
"""Decisions that are played with random numbers."""
ERRORS = {
    "linear.encoder_m": 0.002,
    "linear.backlash_m": 0.002,
    "linear.stiction_m": 0.001,
    "rotary.encoder_rad": 0.005,
    "rotary.backlash_rad": 0.01,
    "rotary.stiction_rad": 0.003,
    "lag_s": 0.05,
}
"""Largest errors of drives that are tried."""


class Machine(NamedTuple):
    """Where a task's configuration holds its machine's numbers.

    Attributes:
        prefix: of the settings.
        limits: shipped limits of the motors.
        tool: setting and shipped mass of the tool.
        more: further shipped masses and inertias.
        friction: largest values of friction to try.
    """

    prefix: str
    limits: dict[str, float]
    tool: tuple[str, float]
    more: dict[str, float]
    friction: dict[str, float]

    def scaled(self, limit: float, mass: float) -> dict[str, float]:
        """Overrides for factors of the limits and of the tool's mass."""
        name, tool_kg = self.tool
        scaled = {self.prefix + motor: limit * value for motor, value in self.limits.items()}
        return {**scaled, self.prefix + name: mass * tool_kg}

    def random(self, generator: np.random.Generator) -> dict[str, float]:
        """Overrides of about half of the numbers, each by a factor of up to ten, friction up to its largest value."""
        numbers = {**self.limits, **dict([self.tool]), **self.more}
        chosen = {name: value * 10.0 ** generator.uniform(-1.0, 1.0) for name, value in numbers.items()}
        chosen |= {name: value * generator.random() for name, value in self.friction.items()}
        found = {self.prefix + name: float(value) for name, value in chosen.items() if generator.random() < 0.5}
        errors = {name: float(value * generator.random()) for name, value in ERRORS.items()}
        if generator.random() < 1.0 / 3.0:
            found |= {f"scenario.drives.{name}": value for name, value in errors.items()}
        return found


_PRRS = {"slider_mass_kg": 1.6, "yoke_mass_kg": 0.25, "rotor_inertia_kg_m2": 0.004, "link_mass_kg": 0.20}
_PRRS_FRICTION = {
    "slider_friction_n": 50.0,
    "slider_damping_n_s_m": 100.0,
    "swing_friction_n_m": 5.0,
    "swing_damping_n_m_s": 1.0,
}
MACHINES = {
    "SafflowerPicking": Machine(
        "machine.picker.",
        {"arm_torque_limit_n_m": 12.0, "cart_force_limit_n": 250.0},
        ("tool_mass_kg", 1.5),
        {"arm_mass_kg": 0.30, "forearm_mass_kg": 0.35, "cart_mass_kg": 80.0, "rotor_inertia_kg_m2": 0.008},
        {"arm_friction_n_m": 5.0, "arm_damping_n_m_s": 2.0, "cart_friction_n": 100.0},
    ),
    "TrayTransplanting": Machine(
        "machine.",
        {"torque_limit_n_m": 90.0},
        ("arm.masses.platform_kg", 0.8),
        {"arm.masses.arm_kg": 0.9, "arm.masses.forearm_kg": 0.5, "arm.masses.rotor_inertia_kg_m2": 0.012},
        {"friction_n_m": 30.0, "damping_n_m_s": 2.0},
    ),
    "ProduceSorting": Machine(
        "machine.sorter.",
        {"slider_force_limit_n": 120.0, "swing_torque_limit_n_m": 10.0},
        ("platform_mass_kg", 0.9),
        _PRRS,
        _PRRS_FRICTION,
    ),
    "LaserWeeding": Machine(
        "machine.",
        {"leg_force_limit_n": 600.0, "cart_force_limit_n": 1500.0},
        ("platform_mass_kg", 5.0),
        {"cylinder_mass_kg": 1.5, "rod_mass_kg": 0.6, "cart_mass_kg": 250.0},
        {"leg_friction_n": 200.0, "leg_damping_n_s_m": 200.0, "cart_friction_n": 300.0},
    ),
    "HoeWeeding": Machine(
        "machine.",
        {"slider_force_limit_n": 250.0, "swing_torque_limit_n_m": 20.0},
        ("platform_mass_kg", 1.2),
        _PRRS,
        _PRRS_FRICTION,
    ),
}


def played(task: str, overrides: dict[str, float], seeds: int, backend: str) -> tuple[float, float] | str:
    """Mean cycle time in s and net rate in % of the reference policy, or why the machine is refused."""
    env_id = f"fieldgym/{task}-v0"
    easy = {"eyes": "classical", "pictures": "easy"} if "Weeding" in task else {}
    try:
        scores = evaluate(
            partial(make_policy, reference_policy(env_id)),
            env_id,
            DRIVES.take(seeds),
            backend=backend,
            perception="model",
            overrides={**easy, **overrides},
        )
    except ConfigError as error:
        return str(error).split(" = ")[0].rpartition(".")[2]
    return float(scores.scorecard["cycle_time_s"].mean()), 100.0 * float(scores.scorecard["net_rate"].mean())


def cells(task: str, seeds: int, physics: int, limits: Sequence[float]) -> Iterator[tuple[float, float, str]]:
    """Factors of limits and mass, and what came of them in words."""
    machine = MACHINES[task]
    for mass in MASSES:
        for limit in limits:
            overrides = machine.scaled(limit, mass)
            result = played(task, overrides, seeds, "analytic")
            if isinstance(result, str):
                yield limit, mass, result
                continue
            words = f"{result[0]:.3f} s {result[1]:.1f} %"
            if physics:
                planned = result if physics == seeds else played(task, overrides, physics, "analytic")
                driven = played(task, overrides, physics, "pybullet")
                assert not isinstance(planned, str) and not isinstance(driven, str)
                words += f" ({100.0 * (driven[0] / planned[0] - 1.0):+.2f} % {driven[1] - planned[1]:+.2f})"
            yield limit, mass, words


def try_random(task: str, number: int, backend: str) -> Counter[str]:
    """Make ``number`` machines of random numbers: how many were refused, played, and had faults.

    Raises:
        Exception: anything but a refusal in one line, with the numbers that led there.
    """
    machine, counts = MACHINES[task], Counter[str]()
    for seed in range(number):
        generator = np.random.default_rng(seed)
        overrides = machine.random(generator)
        try:
            env: Any = gym.make(
                f"fieldgym/{task}-v0",
                backend=backend,
                perception="perfect",
                overrides=overrides,
                disable_env_checker=True,
            ).unwrapped
        except ConfigError as error:
            if "\n" in str(error):
                raise
            counts["refused"] += 1
            continue
        try:
            _, info = env.reset(seed=seed)
            for _ in range(DECISIONS):
                action = int(generator.choice(np.flatnonzero(info["action_mask"])))
                _, reward, terminated, truncated, info = env.step(action)
                counts["faults"] += bool(info["fault"])
                if not np.isfinite([reward, *info["phases_s"].values(), *info["scorecard"].values()]).all():
                    raise ValueError(f"a number that is none: {info}")
                if terminated or truncated:
                    break
        except Exception as error:
            raise RuntimeError(f"seed {seed}: {overrides}") from error
        finally:
            env.close()
        counts["played"] += 1
    return counts


def main() -> None:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", choices=tuple(MACHINES), action="append")
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--physics", type=int, default=0)
    parser.add_argument("--limits", type=float, nargs="+", default=LIMITS)
    parser.add_argument("--random", type=int, default=0)
    parser.add_argument("--backend", choices=("analytic", "pybullet"), default="analytic")
    options = parser.parse_args()
    console, tasks = Console(width=200), options.task or tuple(MACHINES)
    for task in tasks:
        if options.random:
            start = time.perf_counter()
            counts = try_random(task, options.random // len(tasks), options.backend)
            console.print(f"{task}: {dict(counts)} in {time.perf_counter() - start:.0f} s, {options.backend}")
            continue
        table = Table("tool mass", *(f"motors x{limit:g}" for limit in options.limits), title=task)
        rows: dict[float, list[str]] = {}
        for _, mass, words in cells(task, options.seeds, options.physics, options.limits):
            rows.setdefault(mass, []).append(words)
        for mass, row in rows.items():
            table.add_row(f"x{mass:g}", *row)
        console.print(table)


if __name__ == "__main__":
    main()
