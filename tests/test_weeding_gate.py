"""The statistical tool camera corrects to what the rendered one would: plants near where it was told to look."""

from dataclasses import replace

import numpy as np

from fieldgym.envs.dice import draw_blocks
from fieldgym.envs.weeding.config import SCENARIOS, CartConfig
from fieldgym.envs.weeding.drawing import Strip, draw_plants
from fieldgym.envs.weeding.perception import TOOL_GATE_M, PerceptionModel
from fieldgym.envs.weeding.sighting import Cameras, draw_tracks, within_gate

SCENARIO = SCENARIOS["load-1.0"]


def test_the_gate_is_a_circle_and_what_lies_on_it_is_inside():
    turn = np.linspace(0.0, 2.0 * np.pi, 25)
    edge = TOOL_GATE_M * np.column_stack([np.cos(turn), np.sin(turn)])
    assert within_gate(TOOL_GATE_M, 0.0)
    assert all(within_gate(*place) for place in ((1.0 - 1e-9) * edge).tolist())
    assert not any(within_gate(*place) for place in ((1.0 + 1e-9) * edge).tolist())


def test_a_track_beyond_the_gate_is_worked_on_where_it_is_and_one_within_where_the_plant_is_seen():
    model = replace(PerceptionModel.measured("classical", "easy"), drift_share=0.03)
    law, cameras = Strip.of(SCENARIO), Cameras.of(SCENARIO, CartConfig(), model)
    lengths = (*law.random_numbers, *cameras.random_numbers(SCENARIO.max_weeds))
    blocks = draw_blocks([np.random.default_rng(seed) for seed in range(40)], lengths)
    plants = draw_plants(law, blocks[0], blocks[1])
    tracks = draw_tracks(cameras, plants, blocks[2], blocks[3])
    there = np.arange(tracks.report.shape[1]) < tracks.count[:, None]
    moved = np.hypot(*(tracks.aim - tracks.report)[there].T)
    # Half of the strips' drifts lie beyond 0.67 sigma of 19 mm: both kinds are common.
    assert moved.max() <= TOOL_GATE_M and 0.2 < np.mean(moved == 0.0) < 0.8
    far = replace(model, drift_share=0.4)
    tracks = draw_tracks(Cameras.of(SCENARIO, CartConfig(), far), plants, blocks[2], np.full_like(blocks[3], 1.0))
    assert np.array_equal(tracks.aim, tracks.report)
