"""The sorter's way through a pick, and what its fingers get when an item has gone already."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.envs.sorting.columns import PHASE
from fieldgym.envs.sorting.motions import PickMotion
from fieldgym.envs.sorting.rules import foresee_worlds, grip_worlds
from fieldgym.motion.orientation import LEVEL, axes

ID = "fieldgym/ProduceSorting-v0"


def picks(count: int) -> list[tuple[Any, Any, Any]]:
    """The rules before each of some picks that hold, the plan, and the seconds of its phases."""
    env: Any = gym.make_vec(ID, 1, vectorization_mode="vector_entry_point", perception="perfect")
    env.reset(seed=3)
    core, found = env.unwrapped.core, []
    while len(found) < count:
        mask = core.observe()["action_mask"][0]
        able = np.flatnonzero(mask[:-1])
        plan = core.plan(np.array([able[-1] if len(able) else len(mask) - 1]))
        if len(able):
            found.append((core, plan, dict(zip(core.phase_names, plan.phases_s[0].tolist(), strict=True))))
        core.apply(plan, core.nominal(plan))
    return found


@pytest.mark.parametrize("held", [True, False])
def test_a_pick_goes_from_where_it_begins_over_the_item_to_its_bin_or_to_rest(held):
    for core, plan, phases in picks(3):
        motion, v = PickMotion(core.config, plan), core.config.belt.speed_m_s
        start, meet, grip, goal = (np.asarray(part[0]) for part in (plan.start, plan.meet, plan.grip, plan.bin))
        level, stop_s = core.config.machine.travel_level_m, core.config.machine.stop_s
        over = phases["approach"]
        down = over + phases["descend"]
        up = down + phases["grip"]
        lifted = up + phases["lift"]
        end = lifted + (phases["carry"] if held else stop_s)
        assert motion.duration_s(held) == pytest.approx(end) and motion.closing_s == pytest.approx(down)
        rest_x = meet[0] + v * (lifted - over) + 0.5 * v * stop_s
        last = [*goal, level] if held else [rest_x, meet[1], level]
        times = np.array([0.0, over, down, up, lifted, end])
        places = [
            [start[0], start[1], level],
            [meet[0], meet[1], level],
            [grip[0], grip[1], grip[2]],
            [grip[0] + v * phases["grip"], grip[1], grip[2]],
            [meet[0] + v * (lifted - over), meet[1], level],
            last,
        ]
        way = motion.sample(times, held)
        assert way.position == pytest.approx(np.array(places), abs=1e-9)
        turns = [plan.start_turn[0], *[plan.turn[0]] * 4, LEVEL if held else plan.turn[0]]
        for turn, known in zip(way.turn, turns, strict=True):
            assert abs(float(np.dot(turn, known))) == pytest.approx(1.0, abs=1e-9)
        # At rest at both ends, at the belt's speed from over the item until it is lifted.
        h = 1e-5
        later, sooner = (motion.sample(times[1:-1] + step, held).position for step in (h, -h))
        assert (later - sooner) / (2.0 * h) == pytest.approx(np.array([[v, 0.0, 0.0]] * 4), abs=1e-4)
        for at, way_h in ((0.0, h), (end, -h)):
            moved = motion.sample(np.array([at + way_h]), held).position - motion.sample(np.array([at]), held).position
            assert np.abs(moved).max() < 1e-8
        # Between them nothing jumps, and the middle of the approach is the middle of its quintic share.
        fine = motion.sample(np.linspace(0.0, end, 2000), held).position
        assert np.abs(np.diff(fine, axis=0)).max() < 3.0 * end / 2000 * 1.875
        middle = motion.sample(np.array([0.5 * over]), held).position[0]
        own, ramp = meet[0] - start[0] - 0.5 * v * over, v * over * 0.5**4 * (2.5 + 0.5 * (0.5 - 3.0))
        assert middle[:2] == pytest.approx([start[0] + 0.5 * own + ramp, 0.5 * (start[1] + meet[1])], abs=1e-9)


def test_an_item_that_is_gone_is_not_held_a_second_time():
    core, plan, _ = picks(1)[0]
    state, item = core.state, core.state.report_item[0, plan.report[0]]
    x_axis, z_axis = axes(plan.turn)[..., 0], axes(plan.turn)[..., 2]
    both = np.concatenate([x_axis, z_axis], axis=-1)
    assert both == pytest.approx(plan.axes, abs=1e-12)
    state.totals[0, 0] -= float(plan.phases_s[0].sum())
    for free in (True, False):
        state.item_free[0, item] = free
        held = grip_worlds(core.rules()[0], state, plan, plan.grip, plan.axes).held[0]
        assert bool(held) == bool(foresee_worlds(state, plan.report).held[0]) == free
    lost = grip_worlds(core.rules()[0], state, plan, plan.grip, plan.axes).lost[0]
    assert not lost and PHASE.wait == 0
