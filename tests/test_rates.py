"""What scorecards come to in a grower's units, recomputed from the phases and the machine's dynamics."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.agents import make_policy
from fieldgym.agents.rollout import begin, decisions
from fieldgym.benchmark import rates, suites, tables
from fieldgym.benchmark.episode import run_episode
from fieldgym.benchmark.suites import Condition, Episode
from fieldgym.envs import env_ids, task
from fieldgym.envs.rates import driving_power_w, motor_power_w, straight_power_w
from fieldgym.envs.weeding.tools.laser.motors import paths
from fieldgym.motion import QUINTIC
from fieldgym.motion.efforts import law_columns
from fieldgym.simulation.dynamics import prrs_dynamics, weeder_dynamics


class Sled:
    """A mass on a level rail."""

    viscous = (0.0,)

    def efforts(self, position, velocity, acceleration, gravity_m_s2=9.81):
        return 3.0 * np.asarray(acceleration)

    def rates(self, position, velocity):
        return np.asarray(velocity)


def test_motors_give_what_goes_into_speed_and_friction():
    start, stroke, time_s = np.zeros((2, 1)), np.array([[0.4], [-1.2]]), np.array([0.5, 2.0])
    top = QUINTIC.peak_velocity * np.abs(stroke[:, 0]) / time_s
    work_j = 0.5 * 3.0 * top**2
    assert straight_power_w(Sled(), start, stroke, time_s) == pytest.approx(work_j.sum() / 2.5, rel=2e-3)
    # Dry friction of 5 N is overcome all the way; while braking, the motor gives the less the more the sled pushes.
    with_friction = straight_power_w(Sled(), start, stroke, time_s, (5.0,))
    assert work_j.sum() / 2.5 < with_friction < (work_j + 5.0 * np.abs(stroke[:, 0])).sum() / 2.5
    assert driving_power_w(3.0, 0.4, 0.5, 0.0) == pytest.approx(work_j[0] / 0.5)
    assert driving_power_w(0.0, 0.4, 0.5, 5.0) == pytest.approx(4.0)


def test_a_braking_motor_gives_nothing_back():
    s, v, a = law_columns(QUINTIC)
    there = motor_power_w(Sled(), s[None], v[None], a[None], [1.0])
    assert there > 0.0
    back = motor_power_w(Sled(), s[None], v[None], 0.0 * a[None], [1.0])
    assert back == 0.0


@pytest.mark.parametrize("env_id", env_ids())
def test_rates_add_up(env_id: str):
    spec = task(env_id)
    where = Condition(env_id, spec.headline, "analytic", "model")
    record = run_episode(Episode(where, spec.reference, 3))
    card, derived, told = record["scorecard"], rates.derived(record), rates.rates_of(where)
    assert "error" not in record
    hours = card["duration_s"] / 3600.0
    moving_j = sum(power * card[f"phase_{phase}_s"] for phase, power in told.motor_w.items())
    tool_j = card["joules_per_weed"] * card["done"] if "joules_per_weed" in card else 0.0
    assert min(told.motor_w.values()) > 0.0
    assert derived[rates.EACH_J] == pytest.approx((tool_j + moving_j) / card["done"])
    assert derived[rates.EACH_S] == pytest.approx(card["done"] / card["duration_s"])
    done = {
        "ha": card.get("ha_per_h", 0.0) * hours,
        "m of row": 15 * 0.45,
        "trays": card.get("healthy", 0.0) / 72,
        "items": card["done"],
    }
    assert derived[rates.WORK] * hours == pytest.approx(done[told.unit])
    assert (rates.AREA_KWH in derived, rates.LOSS in derived) == ((told.unit == "ha"),) * 2
    if told.unit == "ha":
        assert derived[rates.AREA_KWH] * done["ha"] * 3.6e6 == pytest.approx(tool_j + moving_j)
        assert derived[rates.LOSS] == card["crop_loss_percent"]
    [row] = tables.summarise([record], suites.suite("full").cases)
    shown = [column.title for column in tables.field_columns([row])]
    assert f"{told.unit}/h" in shown and len(shown) == (6 if told.unit == "ha" else 4)


@pytest.mark.parametrize("name", ["LaserWeeding", "HoeWeeding"])
def test_the_estimate_is_near_the_power_of_the_moves_of_an_episode(name: str):
    env: Any = gym.make(f"fieldgym/{name}-v0", backend="analytic", perception="model")
    observation, _ = begin(env, 3)
    core, moves = env.unwrapped.core, []
    for _ in decisions(env, make_policy("fifo", env, seed=0), observation):
        plan = core.planned
        if plan.kind[0] < 3 and plan.phases_s[0, 0] > 0.0:
            place = [plan.cart[0], 0.0, 0.0]
            moves.append((plan.start[0] - place, plan.target[0] - plan.start[0], plan.phases_s[0, 0]))
    start, stroke, time_s = map(np.array, zip(*moves, strict=True))
    if name == "LaserWeeding":
        machine = weeder_dynamics(core.config.parameters)
        power_w = motor_power_w(machine, *paths(core.config.reach, start, stroke), time_s)
    else:
        parameters = core.config.parameters
        pose, way = np.zeros((2, len(start), 6))
        pose[:, [0, 1]], way[:, [0, 1]] = start[:, [0, 2]], stroke[:, [0, 2]]
        pose[:, 2] = core.config.process.clearance_m - parameters.lowest_tip_m
        power_w = straight_power_w(prrs_dynamics(parameters), pose, way, time_s)
    told = rates.rates_of(Condition(f"fieldgym/{name}-v0", "load-1.25", "analytic", "model"))
    assert told.motor_w["move"] == pytest.approx(power_w, rel=0.2)
