"""Small parts of the rules, as plain Python, against the formula or the plain meaning of what they say they give."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from test_laws_bound_parts import stream_of

from fieldgym.bounds import belt
from fieldgym.envs.safflower import drawing as heads
from fieldgym.envs.safflower import process as picking
from fieldgym.envs.safflower.config import SafflowerConfig
from fieldgym.envs.sorting import timing as sorting_timing
from fieldgym.envs.sorting.columns import PHASE
from fieldgym.envs.sorting.config import PerceptionModel, SortingConfig
from fieldgym.envs.sorting.core import SortingCore
from fieldgym.envs.sorting.motions import PickMotion
from fieldgym.envs.transplanting.timing import gate_motion
from fieldgym.envs.weeding import drawing as weeds
from fieldgym.envs.weeding import rules
from fieldgym.envs.weeding.state import PAD, N, T
from fieldgym.kernels.config import override
from fieldgym.motion import Gate


def plain(kernel: Any) -> Any:
    """A kernel as Python; what it calls stays as it is."""
    return getattr(kernel, "py_func", kernel)


@pytest.fixture
def patches(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(weeds, "patch_density", plain(weeds.patch_density))
    return SimpleNamespace(density=plain(weeds.patch_density), place=plain(weeds.patched))


def test_patches_are_between_one_and_their_contrast_and_hold_their_share_of_the_weeds(patches):
    for contrast, patch_m, phase in ((20.0, 3.0, 0.3), (4.0, 1.7, 0.0), (1.5, 9.0, 0.9)):
        strip = SimpleNamespace(contrast=contrast, patch_m=patch_m, size_m=(12.0, 1.0))
        shares = np.linspace(0.0, 1.0, 4001)
        density = np.array([patches.density(strip, phase, share) for share in shares])
        assert density.min() == pytest.approx(1.0, abs=0.05) and density.max() == pytest.approx(contrast, rel=0.05)
        # One patch to the next in straight lines: thinnest half way.
        crest = (math.ceil(phase) - phase) * patch_m / 12.0
        assert patches.density(strip, phase, crest) == pytest.approx(contrast)
        assert patches.density(strip, phase, crest + 0.5 * patch_m / 12.0) == pytest.approx(1.0)
        before = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
        for share in (0.0, 0.1, 0.37, 0.5, 0.83, 0.999):
            place = patches.place(strip, phase, share)
            assert np.interp(place, shares, before / before[-1]) == pytest.approx(share, abs=5e-3)
    even = SimpleNamespace(contrast=1.0, patch_m=3.0, size_m=(12.0, 1.0))
    assert patches.place(even, 0.3, 0.42) == 0.42


def test_the_last_digits_of_a_number_are_another_number():
    for whole, rest in ((0, 0.25), (17, 0.5), (65535, 0.875)):
        assert plain(weeds.fine)((whole + rest) / 65536.0) == rest


def test_filaments_drop_less_the_longer_they_are_sucked():
    process = override(SafflowerConfig(), {"process.suction_decay_s": 0.25}).process
    for time_s in (0.0, 0.1, 0.4):
        assert picking.dropped_share(process, time_s) == pytest.approx(process.suction_loss * math.exp(-4.0 * time_s))


def test_beyond_its_table_the_arm_reaches_what_is_said_there():
    reach = heads.Reach(np.array([-0.3, -0.2, -0.1]), np.array([0.1, 0.3, 0.2]))
    for level, width in ((-0.31, 7.0), (-0.3, 0.1), (-0.25, 0.2), (-0.1, 0.2), (-0.09, 8.0)):
        assert plain(heads.half_width_m)(reach, level, 7.0, 8.0) == pytest.approx(width)
    # A pot's head above the table stands as near as the table's last width asks, one below as its first.
    growth: Any = SimpleNamespace(reach=reach, motor_height_m=0.0)
    for up_m, half in ((-0.31, 0.1), (-0.09, 0.2)):
        _, across = plain(heads.in_pot)(growth, 9.0, 1, 0, 0.5, 1.0, up_m)
        assert across == pytest.approx(half - heads._REACH_RESERVE_M)


def test_a_sorter_s_way_is_shorter_by_its_slack_and_takes_its_least(monkeypatch):
    monkeypatch.setattr(sorting_timing, "stroke_s", plain(sorting_timing.stroke_s))
    way, stroke = plain(sorting_timing.way_s), plain(sorting_timing.stroke_s)
    for along, across, slack in ((0.3, 0.4, 0.0), (0.3, 0.4, 0.1), (-0.3, 0.4, 0.6)):
        expected = max(stroke(max(math.hypot(along, across) - slack, 0.0), 2.0, 0.1), 0.2)
        assert way(along, across**2, slack, 2.0, 0.1, 0.2) == pytest.approx(expected)


def test_a_pick_without_a_word_is_the_first_world_s():
    config = SortingConfig()
    rows: Any = np.arange(1.0, 3.0)
    plan: Any = SimpleNamespace(
        phases_s=rows[:, None] * np.arange(1.0, 9.0),
        **{name: rows[:, None] * np.ones(4) for name in ("start", "start_turn", "meet", "grip", "turn", "bin")},
    )
    for row, motion in ((0, PickMotion(config, plan)), (1, PickMotion(config, plan, 1))):
        assert motion.approach_s == plan.phases_s[row, PHASE.approach]


def test_what_the_camera_makes_up_lies_on_the_belt():
    config = SortingConfig()
    core = SortingCore(config, replace(PerceptionModel.measured(), recall=0.0, false_per_item=0.5), 1)
    made_up = core.draw_field(np.random.default_rng(5)).reports.across_m
    half_m = config.belt.item_half_width_m
    assert len(made_up) > 9 and np.abs(made_up).max() <= half_m and np.abs(made_up).max() > 0.7 * half_m


def test_a_gate_without_room_for_a_round_corner_has_none():
    """Whatever is shorter than the straight piece, down to nothing."""
    for across in (0.0, 1e-7):
        for style in ("blended", "time-optimal"):
            gate = Gate(style, 4.5, 60.0, straight_m=0.05)
            way = np.zeros(2), np.array([across, 0.15]), 0.15
            assert gate_motion(gate, *way).duration_s == gate.motion(*way).duration_s
    deep = Gate("blended", 4.5, 60.0, straight_m=0.5)
    way = np.zeros(2), np.array([0.4, 0.15]), 0.15
    assert gate_motion(deep, *way).duration_s == deep.motion(*way).duration_s


def laser() -> Any:
    env: Any = gym.make_vec("fieldgym/LaserWeeding-v0", 1, "vector_entry_point", scenario="ridged")
    env.reset(seed=4)
    return env.unwrapped.core


def test_a_shot_kills_every_crop_plant_within_its_reach_and_no_other():
    core = laser()
    state, tables, work = core.state, core.tables, core.process.work
    first, beside, middle = tables.weeds_end, tables.crop_beside, 6
    assert beside >= 1
    state.plant[0, :, 0] = 50.0 + np.arange(state.plant.shape[1])
    state.plant_tolerance[0] = 1e-9
    state.track_near[0, 0, N.weed], state.track_near[0, 0, N.crop] = 0, middle
    for crop in range(middle - beside - 1, middle + beside + 2):
        kept = state.plant[0, first + crop].copy()
        state.plant[0, first + crop] = 3.0, 0.0
        state.plant_dose[0], state.leaf_lost[0] = 0.0, 0.0
        state.totals[0] = 0.0
        rules.treat(tables, work, state, 0, 0, 0, 3.0, 0.0, 1.0)
        assert state.totals[0, T.killed] == 0.0 and state.totals[0, T.shots] == 1.0
        assert state.totals[0, T.crop] == (1.0 if abs(crop - middle) <= beside else 0.0), crop
        state.plant[0, first + crop] = kept


def test_a_track_where_a_crop_plant_stands_is_no_weed_s():
    core = laser()
    state, weeds_end = core.state, core.weeds_end
    state.plant[0, PAD : weeds_end - PAD, 0] = np.linspace(0.0, 1.0, weeds_end - 2 * PAD)
    for crop in range(2 * PAD):
        state.plant[0, weeds_end + crop, :2] = 3.0 + 0.1 * crop, 0.05
        state.track_aim[0, 0, :2] = 3.0 + 0.1 * crop, 0.05
        core._near(0, 0)
        assert not state.track_real[0, 0]
        assert state.track_near[0, 0, N.weed] == weeds_end - 2 * PAD - 1


def test_a_belt_s_graph_has_every_pick_that_is_known_and_no_other():
    """In whatever order things become known."""
    line, stream = stream_of(1)
    known = np.array([2.0, 0.0, 3.0, 0.5])
    stream, tick_s = stream._replace(known_s=known), 0.5
    first, to, option, _, _, start = belt.expand(line, stream, tick_s)
    # The last place is that of a platform that holds nothing.
    places = len(line.places) + 1
    ticks = (len(first) - 1) // places
    assert first[0] == 0 and first[-1] == len(to) == len(option) and start == ticks * places - 2
    for node in range(ticks * places):
        tick, place = ticks - 1 - node // places, node % places
        expected = []
        for j in range(len(known)):
            then = belt.finish_s(line, stream, j, place, tick * tick_s)
            arrives = min(max(int(then / tick_s), tick + 1), ticks - 1) if math.isfinite(then) else -1
            if known[j] < (tick + 1) * tick_s and arrives > tick:
                expected.append(((ticks - 1 - arrives) * places + int(stream.bin[j]), j))
        edges = slice(first[node], first[node + 1])
        assert list(zip(to[edges].tolist(), option[edges].tolist(), strict=True)) == expected
