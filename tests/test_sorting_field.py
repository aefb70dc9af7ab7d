"""Streams of produce: how they are drawn, and that a stream is a value that plays the same wherever it comes from."""

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldgym.bounds.sorting import instance_of
from fieldgym.envs.field import ABSENT, FieldError
from fieldgym.envs.field_files import read_field, write_field
from fieldgym.envs.sorting.columns import ITEM, Item
from fieldgym.envs.sorting.config import REFERENCE_CYCLE_S, SCENARIOS, PerceptionModel, SortingConfig
from fieldgym.envs.sorting.core import SortingCore
from fieldgym.envs.sorting.drawing import Stream, centre_height_m, delayed_s, draw_items, gap_s
from fieldgym.envs.sorting.field import Items, ProduceField, Reports, Sensor
from fieldgym.kernels.config import override
from fieldgym.kernels.sfc import SEEDS
from fieldgym.motion.orientation import axes, tilted

ID = "fieldgym/ProduceSorting-v0"


@pytest.mark.parametrize("name", SCENARIOS)
def test_streams_have_the_load_that_they_say_and_nothing_overlaps(name):
    config = SortingConfig(scenario=SCENARIOS[name])
    rng = np.random.default_rng(5)
    n = config.scenario.max_items
    items = np.zeros((200, n + 1, len(Item._fields)))
    draw_items(Stream.of(config), items, rng.random((200, SEEDS)))
    items = items[:, :n]
    exists = np.isfinite(items[..., ITEM.passing_s])
    mean = exists.sum(axis=1).mean() * REFERENCE_CYCLE_S / config.scenario.stream_s
    # A stream begins with an item more often than not: clumped streams hold a little more than their rate says.
    assert mean == pytest.approx(config.scenario.load, rel=0.03 if config.scenario.clump == 1.0 else 0.08)
    assert not exists[:, -1].any()
    x, y = (np.where(exists, items[..., column], np.nan) for column in (ITEM.passing_s, ITEM.across_m))
    x = x * config.belt.speed_m_s
    length, grade = items[..., ITEM.length_m], items[..., ITEM.grade]
    for back in range(1, 4):
        apart = np.hypot(x[:, back:] - x[:, :-back], y[:, back:] - y[:, :-back])
        touching = 0.5 * (length[:, back:] + length[:, :-back])
        assert not (apart < touching - 1e-9).any()
    produce = config.produce
    long, tuber = length >= produce.ware_from_m, grade < 2
    assert np.array_equal((grade == 0)[exists], (tuber & long)[exists])
    assert np.array_equal((grade == 2)[exists], (~tuber & (items[..., ITEM.ripeness] >= produce.ripe_from))[exists])


def test_clumps_keep_the_rate_and_bunch_the_gaps():
    rng = np.random.default_rng(0)
    draws = np.stack([rng.standard_exponential(100_000), rng.random(100_000)], axis=1).tolist()
    streams = [Stream.of(SortingConfig(scenario=SCENARIOS[name])) for name in ("load-1.25", "clumped-1.25")]
    one, other = (np.array([gap_s(stream, *draw) for draw in draws]) for stream in streams)
    assert one.mean() == pytest.approx(other.mean(), rel=0.02)
    assert one.std() == pytest.approx(one.mean(), rel=0.02) and other.std() > 1.5 * other.mean()


def test_items_wait_for_the_one_in_front_and_pass_on_the_delay():
    # Three in one lane within a second of each other, one beside them.
    lane = np.zeros((4, len(Item._fields)))
    lane[:, ITEM.passing_s], lane[:, ITEM.across_m], lane[:, ITEM.length_m] = (
        (0.0, 0.1, 0.2, 0.3),
        (0.0, 0.0, 0.0, 0.1),
        0.06,
    )
    for i in range(4):
        lane[i, ITEM.passing_s] = delayed_s(lane, i, 0.06)
    assert lane[:, ITEM.passing_s] == pytest.approx([0.0, 1.0, 2.0, 0.3])


@settings(deadline=None)
@given(st.floats(-1.5, 1.5), st.floats(0.0, 0.6), st.floats(-3.0, 3.0), st.floats(0.6, 1.0), st.floats(0.6, 1.0))
def test_an_item_touches_the_belt(yaw, tilt, azimuth, width, thick):
    half = 0.03 * np.array([1.0, width, width * thick])
    turned = axes(tilted(tilt, azimuth, yaw))
    up = np.linspace(0.0, np.pi, 181)[:, None]
    around = np.linspace(0.0, 2.0 * np.pi, 361)
    ball = np.stack([np.sin(up) * np.cos(around), np.sin(up) * np.sin(around), np.cos(up) + 0.0 * around], axis=-1)
    lowest = ((half * ball) @ turned.T)[..., 2].min()
    height = centre_height_m(0.06, width, width * thick, yaw, tilt, azimuth)
    assert height == pytest.approx(-lowest, abs=2e-5)


@pytest.mark.parametrize("scenario", ["load-1.25", "clumped-1.25"])
def test_the_stream_does_not_depend_on_the_camera_and_steps_draw_no_chance(scenario):
    streams = []
    for perception in ("perfect", "model"):
        env = gym.make(ID, backend="analytic", scenario=scenario, perception=perception).unwrapped
        env.reset(seed=3)
        core = env.get_wrapper_attr("core")
        streams.append((core.items.copy(), core.state.item_truth.copy()))
        state = env.np_random.bit_generator.state
        for _ in range(5):
            env.step(0)
        assert env.np_random.bit_generator.state == state
    assert all(np.array_equal(a, b) for a, b in zip(*streams, strict=True))


def episode(env: Any, seed: int, decisions: int, **options: Any) -> list[Any]:
    """Everything that an episode shows for actions that depend on the seed alone."""
    rng = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed, options=options)
    shown: list[Any] = []
    for _ in range(decisions):
        mask = np.atleast_2d(observation["action_mask"])
        choice = np.where(mask > 0, rng.random(mask.shape), -1.0).argmax(axis=1)
        observation, reward, over, cut, info = env.step(choice if np.ndim(reward_of(env)) else int(choice[0]))
        shown += [*observation.values(), reward, over, cut, *info["rewards"].values(), *info["phases_s"].values()]
        shown += [*info["scorecard"].values()]
        if np.all(np.asarray(over) | np.asarray(cut)):
            break
    return shown


def reward_of(env: Any) -> Any:
    """An array for a batch, a number for a single environment."""
    return np.zeros(env.num_envs) if hasattr(env, "num_envs") else 0.0


def equal(one: list[Any], other: list[Any]) -> bool:
    return len(one) == len(other) and all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def round_trip(tmp_path: Any, perception: str, seeds: range, decisions: int) -> None:
    """Drawn, taken apart, saved, read, put together and loaded: the same episodes, alone and side by side."""
    env: Any = gym.make(ID, backend="analytic", perception=perception).unwrapped
    fields, singles = [], []
    for seed in seeds:
        singles.append(episode(env, seed, decisions))
        write_field(env.field, tmp_path / f"{seed}.csv")
        fields.append(read_field(tmp_path / f"{seed}.csv", ProduceField))
        assert fields[-1] == env.field
    # The world has played something else in between; what that has left does not count.
    other: Any = gym.make(ID, backend="analytic", perception=perception).unwrapped
    for seed, field, single in zip(seeds, fields, singles, strict=True):
        assert equal(episode(other, seed, decisions, field=field), single)
    make: Any = gym.make_vec
    batch = make(
        ID, len(fields), vectorization_mode="vector_entry_point", perception=perception, autoreset_mode="Disabled"
    )
    drawn = episode(batch.unwrapped, seeds[0], decisions)
    assert equal(episode(batch.unwrapped, seeds[0], decisions, fields=fields), drawn)


@pytest.mark.parametrize("perception", ["model", "perfect"])
def test_a_stream_that_was_saved_plays_the_same(tmp_path, perception):
    round_trip(tmp_path, perception, range(10), 60)


@pytest.mark.slow
@pytest.mark.long
def test_two_hundred_streams_that_were_saved_play_the_same(tmp_path):
    round_trip(tmp_path, "model", range(200), 300)


def test_a_shorter_stream_leaves_nothing_of_the_one_before():
    core = SortingCore(SortingConfig(), PerceptionModel.measured(), 1)
    core.reset_rows(np.array([0]), [np.random.default_rng(0)])
    few = replace(Items.empty(2), passing_s=[3.0, 6.0], across_m=[0.0, 0.05], grade=[0, 1])
    loaded(core, ProduceField(few))
    assert np.isinf(core.items[0, 2:]).all() and not core.state.item_truth[0, 2:].any()
    assert not core.state.item_free[0, 2:].any() and core.scores()[0][core.score_names.index("total")] == 2


def loaded(core: SortingCore, *fields: ProduceField, seed: int = 0) -> list[ProduceField]:
    """Complete fields and put them into the first worlds."""
    whole = [core.complete(field, np.random.default_rng(seed)) for field in fields]
    core.load(np.arange(len(whole)), core.stack(whole))
    return whole


def three() -> ProduceField:
    """What a person writes down: when, where, and which grade."""
    return ProduceField(replace(Items.empty(3), passing_s=[2.0, 4.0, 9.0], across_m=[0.0, 0.08, -0.1], grade=[0, 1, 2]))


def test_what_is_not_said_is_filled():
    config = SortingConfig()
    core = SortingCore(config, PerceptionModel.measured(), 1)
    whole = core.complete(three(), np.random.default_rng(5))
    items = whole.items
    assert items.length_m == pytest.approx([0.0705, 0.0525, 0.054]) and items.width == pytest.approx([0.71, 0.71, 0.96])
    assert items.thickness == pytest.approx(items.width * 0.79) and items.ripeness[2] == 0.75
    assert items.up_m == pytest.approx(0.5 * items.length_m * items.thickness) and not items.tilt_rad.any()
    for name in ("grip_luck", "way_luck", "slip_along_m", "slip_across_m"):
        assert len(set(getattr(items, name).tolist())) == 3
    assert np.abs(items.slip_along_m).max() < 4.0 * config.belt.slip_sigma_m
    again = core.complete(three(), np.random.default_rng(5))
    assert again == whole and core.complete(whole, np.random.default_rng(6)) == whole
    assert core.complete(three(), np.random.default_rng(6)) != whole


def test_reports_are_made_by_the_camera_that_is_there():
    perfect, model, camera = (
        SortingCore(SortingConfig(), perception, 1)
        for perception in (PerceptionModel.perfect(), PerceptionModel.measured(), None)
    )
    exact, seen, none = (core.complete(three(), np.random.default_rng(1)) for core in (perfect, model, camera))
    assert exact.reports is not None and seen.reports is not None and none.reports is None
    for name in ("passing_s", "across_m", "up_m", "length_m", "grade"):
        assert np.array_equal(getattr(exact.reports, name), getattr(exact.items, name))
    assert not np.array_equal(seen.reports.across_m, seen.items.across_m[seen.reports.item])
    # Those of another camera are made anew, one's own and those that do not say whose they are stay.
    made = perfect.complete(seen, np.random.default_rng(1)).reports
    assert made is not None and np.array_equal(made.across_m, seen.items.across_m)
    assert model.complete(seen, np.random.default_rng(2)) == seen
    assert seen.camera is not None
    told = replace(seen, camera=replace(seen.camera, code=np.array([ABSENT])))
    kept = perfect.complete(told, np.random.default_rng(1)).reports
    assert kept is not None and np.array_equal(kept.across_m, seen.reports.across_m)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"across_m": [0.0, 0.3, 0.0]}, "items 2: across_m = 0.3 m: outside the belt, give -0.14 to 0.14 m"),
        ({"passing_s": [2.0, 4.0, 900.0]}, "items 3: passing_s = 900 s: outside the episode, give -3.66667 to"),
        ({"passing_s": [-20.0, 4.0, 9.0]}, "items 1: passing_s = -20 s"),
        ({"passing_s": [4.0, 4.0, 9.0], "across_m": [0.0, 0.0, 0.0]}, "items 2: lies where items 1 does"),
        ({"grade": [0, ABSENT, 1]}, "items 2: grade is missing"),
        ({"length_m": [60.0, np.nan, np.nan]}, "items 1: length_m = 60 m: give 0.005 to 0.3 m"),
        ({"passing_s": [np.nan, 4.0, 9.0]}, "items 1: passing_s is missing"),
    ],
)
def test_what_does_not_fit_is_named(changes, words):
    core = SortingCore(SortingConfig(), PerceptionModel.measured(), 1)
    with pytest.raises(FieldError) as caught:
        core.complete(replace(three(), items=replace(three().items, **changes)), np.random.default_rng(0))
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_too_many_are_named():
    core = SortingCore(SortingConfig(), PerceptionModel.perfect(), 1)
    field = core.draw_field(np.random.default_rng(0))
    small = SortingCore(override(SortingConfig(), {"scenario.stream_s": 20.0}), PerceptionModel.perfect(), 1)
    with pytest.raises(FieldError, match=r"items \d+: the scenario has room for \d+ items: raise load or stream_s"):
        small.complete(field, np.random.default_rng(0))
    assert field.reports is not None
    double = [np.concatenate([values, values]) for values in field.reports.arrays().values()]
    with pytest.raises(FieldError, match="the scenario has room for"):
        core.complete(replace(field, reports=Reports(*double)), np.random.default_rng(0))
    wrong = replace(field.reports, item=np.full(len(field.reports), 5000))
    with pytest.raises(FieldError, match="item = 5000: give 0 to"):
        core.complete(replace(field, reports=wrong), np.random.default_rng(0))
    with pytest.raises(FieldError, match="camera has 0 rows"):
        core.complete(replace(field, camera=Sensor.empty(0)), np.random.default_rng(0))


@pytest.mark.parametrize("toy", ProduceField.toy(), ids=lambda toy: toy.name)
def test_toys_have_the_optimum_that_they_say(toy):
    config = override(SortingConfig(), toy.overrides)
    core = SortingCore(config, PerceptionModel.perfect(), 1)
    loaded(core, toy.field)
    bound = instance_of(core).bound()
    assert bound.proven
    assert (bound.net_rate, bound.episode_return) == pytest.approx((toy.net_rate, toy.episode_return))
