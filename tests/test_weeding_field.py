"""A strip as a value: what was drawn plays the same when it is loaded, and what does not fit is refused by name."""

from dataclasses import replace

import numpy as np
import pytest

from fieldgym.envs.field import FieldError
from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.field import Crops, Ground, Reports, WeedField, Weeds, strip
from fieldgym.envs.weeding.perception import PerceptionModel, uncorrected
from fieldgym.envs.weeding.tools.hoe.config import HoeWeedingConfig
from fieldgym.envs.weeding.tools.hoe.env import hoe_core
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.env import laser_core

MAKE = {"laser": (laser_core, WeedingConfig), "hoe": (hoe_core, HoeWeedingConfig)}
EASY = PerceptionModel.measured("classical", "easy")
CAMERAS = {"laser": EASY, "hoe": uncorrected(EASY)}


def core_of(tool, worlds=1, perception=None, **changes):
    make, config = MAKE[tool]
    return make(config(**changes), perception or CAMERAS[tool], worlds)


def episode(core, seed, decisions):
    """Observations, rewards, phases and scores of random legal decisions, each world by its own chance."""
    luck = [np.random.default_rng([seed, row]) for row in range(core.worlds)]
    seen = []
    for _ in range(decisions):
        observation = core.observe()
        # Shots before waiting: what was drawn matters where something is done.
        action = [
            int(rng.choice(np.flatnonzero(m)[:3])) for rng, m in zip(luck, observation["action_mask"], strict=True)
        ]
        plan = core.plan(np.array(action))
        result = core.apply(plan, core.nominal(plan))
        seen.append([*observation.values(), result.rewards, result.phases_s, result.terminated, core.scores()])
    return seen


def same(one, other, row=slice(None)):
    return all(
        a[row].tobytes() == b.tobytes()
        for step, again in zip(one, other, strict=True)
        for a, b in zip(step, again, strict=True)
    )


def plays_again(tool, seeds, decisions):
    """Draw, take apart, put together, load: the batch and its single worlds play what was drawn."""
    rows = np.arange(len(seeds))
    drawn, loaded, single = (core_of(tool, worlds) for worlds in (len(seeds), len(seeds), 1))
    batch = drawn.draw([np.random.default_rng(seed) for seed in seeds])
    drawn.load(rows, batch)
    fields = drawn.unstack(batch)
    loaded.load(rows, loaded.stack(fields[::-1]))  # whatever was there before
    loaded.load(rows, loaded.stack(fields))
    first = episode(drawn, 1, decisions)
    assert same(first, episode(loaded, 1, decisions))
    for row in rows.tolist():
        single.load(np.zeros(1, np.int64), single.stack([fields[row]]))
        luck = np.random.default_rng([1, row])
        for step in first:
            observation = single.observe()
            action = luck.choice(np.flatnonzero(observation["action_mask"][0])[:3])
            plan = single.plan(np.array([action]))
            result = single.apply(plan, single.nominal(plan))
            now = [*observation.values(), result.rewards, result.phases_s, result.terminated, single.scores()]
            assert all(a[row].tobytes() == b[0].tobytes() for a, b in zip(step, now, strict=True))
    return fields


@pytest.mark.parametrize("tool", MAKE)
def test_what_was_drawn_plays_the_same_when_it_is_loaded(tool):
    fields = plays_again(tool, range(10), 120)
    assert len({field.digest() for field in fields}) == 10
    assert all(field.weeds.along_m.size > 40 and field.reports.along_m.size > 40 for field in fields)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("tool", MAKE)
def test_two_hundred_strips_play_the_same_when_they_are_loaded(tool):
    plays_again(tool, range(200), 400)


@pytest.mark.parametrize("tool", MAKE)
def test_completing_a_drawn_field_changes_nothing_and_draws_nothing(tool):
    core = core_of(tool)
    field = core.draw_field(np.random.default_rng(3))
    generator = np.random.default_rng(4)
    before = generator.bit_generator.state
    assert core.complete(field, generator) == field and generator.bit_generator.state == before


def test_rows_may_come_in_any_order():
    core = core_of("laser")
    field = core.draw_field(np.random.default_rng(3))
    turned = replace(
        field,
        **{
            kind: type(table)(**{name: values[::-1] for name, values in table.arrays().items()})
            for kind, table in field.tables()
        },
    )
    assert turned != field and core.complete(turned, np.random.default_rng(0)) == field


def test_places_are_enough():
    core = core_of("laser", perception=PerceptionModel.perfect())
    bare = WeedField(replace(Weeds.empty(3), along_m=np.array([0.5, 0.1, 0.3]), across_m=np.array([0.0, 0.1, -0.1])))
    field = core.complete(bare, np.random.default_rng(0))
    assert field.weeds.along_m.tolist() == [0.1, 0.3, 0.5] and field.weeds.across_m.tolist() == [0.1, -0.1, 0.0]
    assert set(field.weeds.species.tolist()) == {0} and set(field.weeds.stage.tolist()) == {1}
    assert np.all((field.weeds.luck > 0.0) & (field.weeds.look > 0.0)) and len(field.ground) == 1
    # The scenario's row: a plant every 0.16 m, in its place, from before the strip to behind it.
    assert field.crops.along_m == pytest.approx(0.16 * (np.arange(53) - 0.5))
    assert not field.crops.across_m.any() and len(set(field.crops.luck.tolist())) == 53
    assert field.reports.along_m.tolist() == [0.1, 0.3, 0.5] == field.reports.aim_along_m.tolist()
    assert field.reports.crop_gap_m == pytest.approx([np.hypot(0.02, 0.1), np.hypot(0.06, 0.1), 0.06])


def test_reports_are_those_of_the_cameras_that_are_there():
    laser, hoe = core_of("laser"), core_of("hoe")
    field = laser.draw_field(np.random.default_rng(5))
    other = hoe.complete(field, np.random.default_rng(6))
    assert np.array_equal(other.weeds.along_m, field.weeds.along_m)
    assert other.camera.code != field.camera.code and not np.array_equal(other.reports.along_m, field.reports.along_m)
    assert np.array_equal(other.reports.aim_along_m, other.reports.along_m)
    assert other == hoe.complete(field, np.random.default_rng(6)) != hoe.complete(field, np.random.default_rng(7))
    # Without a sign any camera takes them.
    kept = hoe.complete(replace(field, camera=None), np.random.default_rng(6))
    assert np.array_equal(kept.reports.along_m, field.reports.along_m)
    assert laser_core(WeedingConfig(), None).complete(field, np.random.default_rng(0)).reports is None


def test_reports_that_say_little_aim_where_they_are_and_know_what_is_near():
    core = core_of("laser")
    field = strip([(0.1, 0.0), (0.5, 0.1)], crops=[(0.15, 0.0)])
    along, across = np.array([0.12, 0.105]), np.array([0.05, 0.0])
    reports = replace(Reports.empty(2), along_m=along, across_m=across)
    found = core.complete(replace(field, reports=reports), np.random.default_rng(0)).reports
    assert found.along_m.tolist() == found.aim_along_m.tolist() == [0.105, 0.12]
    assert found.behind.tolist() == [1, 0]
    assert found.crop_gap_m == pytest.approx([0.045, np.hypot(0.03, 0.05)])


def weeds(*places):
    return WeedField(replace(Weeds.empty(len(places)), along_m=np.array(places)[:, 0], across_m=np.array(places)[:, 1]))


def crops(*along):
    return replace(weeds((0.1, 0.1)), crops=Crops(np.array(along), np.zeros(len(along)), np.full(len(along), 0.5)))


def reports(across):
    field = strip([(0.1, 0.0)])
    return replace(field, reports=replace(Reports.empty(1), along_m=np.array([0.1]), across_m=np.array([across])))


@pytest.mark.parametrize(
    ("field", "words"),
    [
        (weeds((0.1, 0.0), (8.2, 0.0)), "weeds 2: along_m = 8.2 m: outside the strip, give 0 to 8 m"),
        (weeds((-0.1, 0.0)), "weeds 1: along_m = -0.1 m: outside the strip"),
        (weeds((0.1, 0.0), (0.2, 0.21)), "weeds 2: across_m = 0.21 m: outside the band, give -0.2 to 0.2 m"),
        (weeds((0.1, 0.0), (0.3, 0.0), (0.1, 0.0)), "weeds 3: along_m = 0.1 m: another weed stands there"),
        (weeds((0.1, np.nan)), "weeds 1: across_m is missing"),
        (weeds((100.0, 0.0), (600.0, 0.0)), "weeds 2: along_m = 600 m: give -10 to 510 m"),
        (weeds(*((0.01 * i, 0.0) for i in range(321))), "weeds 321: the scenario has room for 320 weeds"),
        (crops(0.0, 9.0), "crops 2: along_m = 9 m: outside the row, give -0.16 to"),
        (crops(0.1, 0.1), "crops 2: along_m = 0.1 m: another crop plant stands there"),
        (crops(*(0.1 * i for i in range(54))), "crops 54: the scenario has room for 53 crops"),
        (reports(0.3), "reports 1: across_m = 0.3 m: outside the band"),
        (replace(weeds((0.1, 0.0)), ground=Ground(np.array([0.1, 0.2]))), "ground 2: 2 rows"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(field, words):
    with pytest.raises(FieldError) as told:
        core_of("laser").complete(field, np.random.default_rng(0))
    assert words in str(told.value) and "\n" not in str(told.value)


def test_a_field_of_another_scenario_is_refused_or_fits():
    """The short strip of ``dense`` takes what lies on it, and nothing of an eight metre strip beyond."""
    long = core_of("laser").draw_field(np.random.default_rng(0))
    short = core_of("laser", scenario=SCENARIOS["dense"])
    with pytest.raises(FieldError, match="outside the strip"):
        short.complete(long, np.random.default_rng(0))
    drawn = short.draw_field(np.random.default_rng(0))
    core = core_of("laser")
    core.load(np.zeros(1, np.int64), core.stack([core.complete(drawn, np.random.default_rng(0))]))
    assert core.state.weeds[0] == len(drawn.weeds)
