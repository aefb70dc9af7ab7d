"""What the picker's planners believe of heads is what is so on average, counted on draws of the laws."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.stats import norm

from fieldgym.agents.policies.picker_belief import PickerBelief
from fieldgym.agents.policies.safflower_bag import BagHorizon
from fieldgym.envs.safflower.bag_config import Wilting
from fieldgym.envs.safflower.config import SCENARIOS, PerceptionModel, SafflowerConfig
from fieldgym.envs.safflower.core import SafflowerCore
from fieldgym.envs.safflower.features import Candidate
from fieldgym.envs.safflower.features import Machine as Picker

BLURRED = PerceptionModel(
    recall=((0.5, 0.9, 0.8, 0.7), (0.5, 0.9, 0.8, 0.7)),
    false_per_stop=3.0,
    bias_m=(0.002, 0.0, 0.003),
    sigma_m=(0.004, 0.006, 0.003),
    stage_confusion=((0.8, 0.1, 0.1, 0.0), (0.1, 0.8, 0.1, 0.0), (0.0, 0.1, 0.8, 0.1), (0.0, 0.0, 0.3, 0.7)),
    size_sigma=0.04,
)


@pytest.mark.parametrize("false, edges_m", [(0.0, (0.0, 0.045, 0.051, 1.0)), (3.0, (0.0, 1.0))])
def test_a_head_bears_what_its_report_promises(false, edges_m):
    eyes = replace(BLURRED, false_per_stop=false)
    config = SafflowerConfig(scenario=replace(SCENARIOS["row"], visit_day=(6.0, 6.0)))
    core = SafflowerCore(config, eyes)
    batch = core.draw([np.random.default_rng(seed) for seed in range(80)])
    heads, tracks = batch.heads, batch.tracks
    assert tracks is not None
    mass = np.concatenate([heads.mass_g, np.zeros((80, 1))], axis=1)
    found = [np.arange(first[-1]) for first in tracks.first]
    stage, size, true = (
        np.concatenate([values[row, own] for row, own in enumerate(found)])
        for values in (tracks.stage, tracks.size_m, np.take_along_axis(mass, tracks.head, axis=1))
    )
    table = np.zeros((len(stage), len(Candidate._fields)))
    table[np.arange(len(stage)), Candidate._fields.index("bud") + stage] = 1.0
    table[:, Candidate._fields.index("size")] = size / 0.05
    believed = PickerBelief(config, eyes).mass(table)
    for reported, (low, high) in product((1, 2), pairwise(edges_m)):
        inside = (stage == reported) & (size >= low) & (size < high)
        assert inside.sum() > 300
        assert true[inside].mean() / 0.377 == pytest.approx(believed[inside].mean(), abs=0.04), (reported, low)


def test_an_effort_gets_its_share_of_a_head():
    config = SafflowerConfig()
    shares, process, rng = PickerBelief(config, BLURRED).shares, config.process, np.random.default_rng(0)
    off = np.array(BLURRED.bias_m) + np.array(BLURRED.sigma_m) * rng.standard_normal((200_000, 3))
    lucky = np.exp(process.luck_logit * rng.standard_normal((2, len(off))))
    radial = (off[:, 0] ** 2 + off[:, 1] ** 2) / process.cut_radius_m**2
    stroke = process.stroke_cut * np.exp(-0.5 * (radial + (off[:, 2] / process.cut_height_m) ** 2))
    for effort, share in enumerate(shares):
        uncut = (1.0 - stroke) ** process.strokes[effort]
        dropped = process.suction_loss * np.exp(-process.suction_s[effort] / process.suction_decay_s)
        cut, kept = (
            (1.0 - rest) * odds / ((1.0 - rest) * odds + rest)
            for rest, odds in zip((uncut, dropped), lucky, strict=True)
        )
        assert share == pytest.approx((cut * kept).mean(), abs=0.002)


@pytest.mark.parametrize("read_s", [30.0, 200.0])
def test_a_head_has_not_wilted_as_often_as_its_reading_promises(read_s):
    scenario = replace(SCENARIOS["bag"], wilting=Wilting((40.0, 900.0), read_s))
    planner = BagHorizon(SafflowerConfig(scenario=scenario), BLURRED)
    closes, rng = np.random.default_rng(1).uniform(40.0, 900.0, 300_000), np.random.default_rng(2)
    read = closes + read_s * rng.standard_normal(len(closes))
    machine, columns = np.zeros((1, 7)), Candidate._fields
    machine[0, Picker._fields.index("time")] = 100.0 / scenario.time_limit_s
    for told in (150.0, 500.0, 850.0):
        table, left = np.zeros((1, 1, len(columns))), np.array([[told - 100.0]])
        table[0, 0, columns.index("fresh")] = 1.0
        late, within = planner._closing_shares(table, machine, left)
        held = closes[np.abs(read - told) < 0.1 * read_s]
        for done_s in (told - 30.0, told, told + 20.0):
            before = norm.cdf((done_s - told) / read_s)
            chance = min(max((late[0, 0] - before) / within[0, 0], 0.0), 1.0)
            assert chance == pytest.approx((held > done_s).mean(), abs=0.03)
