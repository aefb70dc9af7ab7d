"""Crop leaves that lasers burn and hoes stir: the share of a disc under another, and strips made by hand."""

from dataclasses import replace
from math import pi, sqrt
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import fieldgym  # noqa: F401
from fieldgym.envs.core import NominalExecutor
from fieldgym.envs.weeding.config import SCENARIOS, RewardWeights
from fieldgym.envs.weeding.field import strip
from fieldgym.envs.weeding.perception import PerceptionModel
from fieldgym.envs.weeding.tools.hoe.config import HoeWeedingConfig
from fieldgym.envs.weeding.tools.hoe.env import hoe_core
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.env import laser_core
from fieldgym.envs.weeding.tools.laser.process import LaserProcess, ProcessConfig
from fieldgym.kernels.config import ConfigError
from fieldgym.kernels.discs import covered_share

COUNTS = replace(SCENARIOS["load-1.25"], leaves_count=True)
PRICE = RewardWeights(leaves=-2.0)
TOOLS = {"laser": (laser_core, WeedingConfig), "hoe": (hoe_core, HoeWeedingConfig)}


def lens_m2(cover, disc, distance):
    """Area that two discs share: the height of the lower of their edges, summed up along the line of their middles."""

    def height(x):
        return 2.0 * sqrt(max(min(disc * disc - x * x, cover * cover - (x - distance) ** 2), 0.0))

    crossing = (distance * distance + disc * disc - cover * cover) / (2.0 * distance) if distance else 0.0
    low, high = max(-disc, distance - cover), min(disc, distance + cover)
    middle = [min(max(crossing, low), high)]
    return quad(height, low, high, points=middle, limit=400, epsabs=1e-13)[0] if high > low else 0.0


@pytest.mark.parametrize("cover, disc", [(0.0042, 0.055), (0.027, 0.055), (0.027, 0.090), (0.05, 0.02), (0.02, 0.02)])
def test_the_lens_in_closed_form_is_the_integral_over_it(cover, disc):
    for share in (0.0, 0.2, 0.5, 0.8, 0.95, 1.0, 1.2):
        distance = abs(cover - disc) + share * (cover + disc - abs(cover - disc))
        by_hand = lens_m2(cover, disc, distance) / (pi * disc * disc)
        assert covered_share(cover, disc, distance) == pytest.approx(by_hand, abs=1e-7)
    assert covered_share(0.0, disc, 0.0) == covered_share(0.0, disc, disc) == 0.0


def loaded(tool, crops, crop_luck=0.999, **changes):
    """A core on a strip with weeds at its beginning, 25 mm apart, beside crop plants that take a lot."""
    make, config = TOOLS[tool]
    core = make(config(**{"scenario": COUNTS, "weights": PRICE, **changes}), PerceptionModel.perfect())
    field = strip([(0.10, 0.0), (0.125, 0.0)], crops, crop_luck=crop_luck)
    core.load(np.zeros(1, np.int64), core.stack([core.complete(field, np.random.default_rng(0))]))
    return core


def work(core, mode):
    """Wait for the first candidate and work on it; gives the reward for leaves, and their loss so far."""
    action = 3 * core.config.slots
    while True:
        if core.option_legal(0, mode):
            action = mode
        plan = core.plan(np.array([action]))
        result = core.apply(plan, NominalExecutor(core).execute(plan))
        if action == mode:
            score = dict(zip(core.score_names, core.scores()[0].tolist(), strict=True))
            return float(result.rewards[0, core.reward_names.index("leaves")]), score


def burnt_by_hand(process, energy_j):
    """Where the beam brings as much per area as leaves take, found in its profile."""
    spot = process.spot_radius_m

    def spare(r):
        return 2.0 * energy_j / (pi * spot**2) * np.exp(-2.0 * r * r / spot**2) - process.leaf_tolerance_j_m2

    found: Any = brentq(spare, 0.0, 0.1, xtol=1e-15)
    return float(found)


# Under a work whole, in part and not at all, on both sides; the last stands too far on.
CROPS = [(0.03, 0.10), (0.10, 0.012), (0.13, -0.045), (0.146, 0.001), (0.40, 0.0)]


@pytest.mark.parametrize("tool, radius", [("laser", None), ("laser", 0.02), ("hoe", None), ("hoe", 0.08)])
@pytest.mark.parametrize("mode", [0, 2])
def test_a_work_takes_the_share_of_each_plants_leaves_that_lies_under_it(tool, radius, mode):
    scenario = replace(COUNTS, leaf_radius_m=radius)
    core = loaded(tool, CROPS, scenario=scenario)
    process, leaf = core.config.process, radius or 0.055
    if tool == "laser":
        hit = burnt_by_hand(process, process.dose_j[mode])
        assert 0.003 < hit < 0.006
    else:
        hit = process.stir_radius_m[mode] + process.blade_radius_m
    expected = 0.0
    lost = np.zeros(len(CROPS))
    for x in (0.10, 0.125):
        shares = [lens_m2(hit, leaf, np.hypot(a - x, b)) / (pi * leaf * leaf) for a, b in CROPS]
        after = np.minimum(lost + shares, 1.0)
        reward, scores = work(core, mode)
        assert reward == pytest.approx(-2.0 * (after - lost).sum(), rel=1e-5)
        expected, lost = after.sum(), after
        assert scores["leaf_loss"] == pytest.approx(expected / len(CROPS), rel=1e-5) and scores["damaged"] == 0.0
    assert np.count_nonzero(lost) >= 2 and lost[-1] == 0.0
    assert core.state.leaf_lost[0, : len(CROPS)] == pytest.approx(lost, rel=1e-5, abs=1e-12)


def test_no_plant_loses_more_than_all_of_its_leaves_and_a_dead_one_none():
    small = replace(COUNTS, leaf_radius_m=0.012)
    core = loaded("hoe", [(0.112, 0.0)], scenario=small)
    # Both stirs cover all of it, and it lives: 27 mm about places 12 and 13 mm away.
    first, second = work(core, 2), work(core, 2)
    assert first[0] == -2.0 and second[0] == 0.0
    assert first[1]["leaf_loss"] == second[1]["leaf_loss"] == 1.0 and second[1]["damaged"] == 0.0
    core = loaded("hoe", [(0.112, 0.0)], crop_luck=0.001)
    first, second = work(core, 2), work(core, 2)
    assert first[1]["damaged"] == second[1]["damaged"] == 1.0
    assert first[0] == pytest.approx(-2.0 * (0.027 / 0.055) ** 2) and second[0] == 0.0
    # Another strip begins whole.
    field = strip([(0.10, 0.0)], [(0.112, 0.0)])
    core.load(np.zeros(1, np.int64), core.stack([core.complete(field, np.random.default_rng(0))]))
    assert not core.state.leaf_lost.any() and not core.state.totals.any()


def test_plants_beyond_the_strips_ends_do_not_count():
    core = loaded("hoe", [(-0.001, 0.05), (0.12, 0.06)], scenario=replace(COUNTS, leaf_radius_m=0.2))
    assert core.state.crops_in_strip[0] == 1.0
    assert work(core, 2)[1]["leaf_loss"] == pytest.approx((0.027 / 0.2) ** 2)


def test_a_beam_that_no_leaf_minds_burns_none():
    tough = ProcessConfig(leaf_tolerance_j_m2=2.0 * 75.0 / (pi * 0.003**2))
    assert LaserProcess(tough).work.leaf_m[:2] == (0.0, 0.0) and LaserProcess(tough).work.leaf_m[2] > 0.0


def test_leaves_are_worth_something_in_the_field_alone():
    assert [name for name, one in SCENARIOS.items() if one.leaves_count] == ["field"]
    with pytest.raises(ConfigError, match=r"leaves"):
        RewardWeights(leaves=0.5)
    env: Any = gym.make("fieldgym/HoeWeeding-v0", scenario="field", perception="perfect", backend="analytic")
    _, info = env.reset(seed=1)
    paid = 0.0
    for _ in range(80):
        *_, info = env.step(int(np.flatnonzero(info["action_mask"])[0]))
        paid += info["rewards"]["leaves"]
    score, core = info["scorecard"], env.unwrapped.core
    assert paid < 0.0 and -paid == pytest.approx(score["leaf_loss"] * core.state.crops_in_strip[0])
