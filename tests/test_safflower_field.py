"""The picker's fields: round trips, what is filled in, what is refused, whose reports they hold, toys."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.bounds import safflower
from fieldgym.envs.field import Camera, FieldError
from fieldgym.envs.safflower.config import SCENARIOS, PerceptionModel, SafflowerConfig
from fieldgym.envs.safflower.core import SafflowerCore
from fieldgym.envs.safflower.field import SPREAD_M, Heads, Plants, Reports, SafflowerField
from fieldgym.kernels.config import override

ID = "fieldgym/SafflowerPicking-v0"
TOYS = SafflowerField.toy()


def reports(*columns: Any) -> Reports:
    """Reports from lists, as a user may give them."""
    return Reports(*columns)


def same(a: Any, b: Any) -> bool:
    """Whether two nested results are equal, bit for bit."""
    if isinstance(a, Mapping):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    return np.array_equal(np.asarray(a), np.asarray(b))


def episode(env: Any, start: tuple[Any, Any], seed: int) -> list[Any]:
    """Everything that an episode of random legal actions gives; a batch plays until all worlds are over once."""
    rng, results, over = np.random.default_rng(seed), [*start], False
    while not np.all(over):
        mask = results[-1]["action_mask"] > 0
        action = np.where(mask, rng.random(mask.shape), -1.0).argmax(axis=-1)
        results += env.step(action if mask.ndim > 1 else int(action))
        over |= results[-3] | results[-2]
    return results


def round_trips(scenario: str, fields: int) -> None:
    """Play drawn fields, then the same ones loaded, alone and in a batch."""
    env: Any = gym.make(ID, scenario=scenario, backend="analytic", disable_env_checker=True).unwrapped
    drawn = []
    for seed in range(fields):
        first = episode(env, env.reset(seed=seed), seed)
        drawn.append(env.field)
        again = episode(env, env.reset(seed=1000 + seed, options={"field": drawn[-1]}), seed)
        assert env.field == drawn[-1]
        assert len(first) == len(again) and all(same(a, b) for a, b in zip(first, again, strict=True))
    batch: Any = gym.make_vec(ID, num_envs=fields, scenario=scenario, autoreset_mode="Disabled")
    first = episode(batch, batch.reset(seed=0), 7)
    again = episode(batch, batch.reset(seed=5000, options={"fields": drawn}), 7)
    assert len(first) == len(again) and all(same(a, b) for a, b in zip(first, again, strict=True))


@pytest.mark.parametrize("scenario", ["pots", "row"])
def test_drawn_fields_that_are_loaded_are_the_same_episodes(scenario):
    round_trips(scenario, 10)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("scenario", ["pots", "row"])
def test_two_hundred_drawn_fields_that_are_loaded_are_the_same_episodes(scenario):
    round_trips(scenario, 200)


def core_of(perception: PerceptionModel | None = None, **overrides: Any) -> SafflowerCore:
    """One world; dots in names are written as double underscores."""
    changes = {name.replace("__", "."): value for name, value in overrides.items()}
    return SafflowerCore(override(SafflowerConfig(), changes), perception or PerceptionModel.perfect(), 1)


def heads(*places: tuple[float, float, float], **columns: Any) -> Heads:
    """Fresh heads at world places; the rest is not given."""
    along_m, across_m, up_m = np.array(places).T
    given = {"along_m": along_m, "across_m": across_m, "up_m": up_m, "stage": np.ones(len(places), int)}
    return replace(Heads.empty(len(places)), **given | columns)


def test_places_and_stages_are_enough():
    core, rng = core_of(), np.random.default_rng(0)
    given = SafflowerField(heads((0.0, 0.05, 0.80), (0.45, 0.0, 0.90), (0.5, 0.1, 0.95), stage=[1, 0, 2]))
    whole: Any = core.complete(given, rng)
    again = core.complete(given, np.random.default_rng(0))
    assert whole == again and whole != core.complete(given, np.random.default_rng(1))
    assert whole.heads.mass_g.tolist() == [core.config.head_mass_g, 0.0, core.config.head_mass_g]
    assert whole.heads.plant.tolist() == [0, 1, 1] and whole.heads.slot.tolist() == [0, 1, 2]
    assert (whole.heads.size_m == SPREAD_M).all() and not whole.heads.occluded.any()
    assert len(whole.plants) == 15 and whole.plants.height_m.min() > 0.3
    assert whole.plants.up_m[1] + whole.plants.height_m[1] == pytest.approx(0.95)
    # A bud has no filaments, so a perfect camera does not report it.
    assert whole.reports.head.tolist() == [0, 2] and whole.reports.along_m.tolist() == [0.0, 0.5]
    core.load(np.array([0]), core.stack([whole]))
    assert core.scores()[0, core.score_names.index("total_g")] == pytest.approx(2 * core.config.head_mass_g)


def test_what_is_given_is_kept():
    core, rng = core_of(), np.random.default_rng(0)
    table = heads(
        (0.0, 0.05, 0.80), (0.45, 0.0, 0.90), mass_g=[0.5, 0.1], size_m=[0.05, 0.04], slot=[-1, 0], plant=[1, 0]
    )
    plants = replace(Plants.empty(2), along_m=np.array([0.0, 0.45]), height_m=np.array([0.7, 0.8]))
    whole: Any = core.complete(SafflowerField(table, plants), rng)
    assert whole.heads.slot.tolist() == [1, 0] and whole.heads.plant.tolist() == [1, 0]
    assert whole.heads.mass_g.tolist() == [0.5, 0.1] and whole.plants.height_m.tolist() == [0.7, 0.8]
    core.load(np.array([0]), core.stack([whole]))
    assert core.state.head_mass_g[0, :2].tolist() == [0.1, 0.5] and core.plant_count[0] == 2
    # Reports name heads by their rows, wherever the rules keep those.
    assert core.state.track_head[0, :2].tolist() == [1, 0] and whole.reports.head.tolist() == [0, 1]
    back: Any = core.unstack(core.stack([whole]))[0]
    assert back.heads.mass_g.tolist() == [0.1, 0.5] and same(back.plants.arrays(), whole.plants.arrays())


@pytest.mark.parametrize(
    ("field", "says"),
    [
        (SafflowerField(heads((0.0, 0.0, 0.8), (9.0, 0.0, 0.8))), "heads 2: along_m = 9 m: outside the row, give -0.4"),
        (SafflowerField(heads((0.0, 0.0, 0.8), (0.0, 0.0, 0.8))), "heads 2: along_m = 0 m: another head stands there"),
        (SafflowerField(heads((0.0, 0.0, 800.0))), "heads 1: up_m = 800 m: give 0 to 4 m"),
        (SafflowerField(heads((0.0, 0.0, 0.8), mass_g=[0.3], stage=[0])), "heads 1: mass_g = 0.3 g: only open heads"),
        (SafflowerField(heads((0.0, 0.0, 0.8), plant=[15])), "heads 1: plant = 15: give 0 to 14"),
        (SafflowerField(heads((0.0, 0.0, 0.8), slot=[60])), "heads 1: slot = 60: give 0 to 59"),
        (
            SafflowerField(heads((0.0, 0.0, 0.8), (0.1, 0.0, 0.8), slot=[3, 3])),
            "heads 2: slot = 3: another head",
        ),
        (SafflowerField(heads((np.nan, 0.0, 0.8))), "heads 1: along_m is missing"),
        (
            SafflowerField(heads(*((0.01 * i, 0.0, 0.8) for i in range(61)))),
            "heads 61: the scenario has room for 60",
        ),
        (SafflowerField(Heads.empty(), Plants.empty(16)), "plants 1: along_m is missing"),
        (
            SafflowerField(Heads.empty(), replace(Plants.empty(16), along_m=np.zeros(16))),
            "plants 16: the scenario has room for 15 plants",
        ),
        (
            SafflowerField(heads((0.0, 0.0, 0.8)), reports=reports([0.0], [0.0], [0.8], [1], [0.05], [1])),
            "reports 1: head = 1: there are 1 heads, counted from 0",
        ),
        (
            SafflowerField(heads((0.0, 0.0, 0.8)), reports=reports(*([np.zeros(81)] * 3), *([np.zeros(81, int)] * 3))),
            "reports 81: the scenario has room for 80 reports",
        ),
        (7, "field is a int: this task takes a SafflowerField"),
    ],
)
def test_what_does_not_fit_is_named(field, says):
    with pytest.raises(FieldError) as caught:
        core_of().complete(field, np.random.default_rng(0))
    assert str(caught.value).startswith(says) and "\n" not in str(caught.value)


def test_reports_belong_to_the_camera_that_made_them():
    model, perfect = PerceptionModel.measured("row"), PerceptionModel.perfect()
    config = override(SafflowerConfig(), {"scenario": SCENARIOS["row"]})
    field: Any = SafflowerCore(config, model, 1).draw_field(np.random.default_rng(3))
    codes = [Camera.of(statistics).code.tolist() for statistics in (model, perfect)]
    assert field.camera.code.tolist() == codes[0] != codes[1]
    seen: Any = SafflowerCore(config, model, 1).complete(field, np.random.default_rng(9))
    assert seen == field
    derived: Any = SafflowerCore(config, perfect, 1).complete(field, np.random.default_rng(9))
    assert same(derived.heads.arrays(), field.heads.arrays()) and derived.camera.code.tolist() == codes[1]
    assert sorted(derived.reports.head.tolist()) == np.flatnonzero(field.heads.stage > 0).tolist()
    rendered: Any = SafflowerCore(config, None, 1).complete(field, np.random.default_rng(9))
    assert rendered.reports is None and rendered.camera is None and same(rendered.heads.arrays(), field.heads.arrays())
    # Nothing is reported of a field in which nothing was seen, but a field without reports is looked at.
    unseen = replace(field, reports=Reports.empty())
    looking: Any = SafflowerCore(config, model, 1)
    assert len(looking.complete(unseen, np.random.default_rng(9)).reports) == 0
    assert len(looking.complete(replace(field, reports=None), np.random.default_rng(9)).reports)


def test_a_field_does_not_depend_on_what_is_drawn_beside_it():
    config, model = SafflowerConfig(), PerceptionModel.measured("pots")
    core = SafflowerCore(config, model, 3)
    fields = core.unstack(core.draw([np.random.default_rng(seed) for seed in range(3)]))
    alone = SafflowerCore(config, model, 1)
    assert fields == [alone.draw_field(np.random.default_rng(seed)) for seed in range(3)]
    assert len({field.digest() for field in fields}) == 3


@pytest.mark.parametrize("toy", TOYS, ids=[toy.name for toy in TOYS])
def test_toys_have_the_optimum_that_they_say(toy, best_by_trying):
    config = override(SafflowerConfig(), toy.overrides)
    core = SafflowerCore(config, PerceptionModel.measured("pots"), 1)
    core.load(np.array([0]), core.stack([core.complete(toy.field, np.random.default_rng(0))]))
    bound = safflower.instance_of(core).bound()
    best = best_by_trying(core)
    assert (best.episode_return, best.net_rate) == pytest.approx((toy.episode_return, toy.net_rate), abs=1e-12)
    assert bound.episode_return >= toy.episode_return - 1e-12 and bound.net_rate >= toy.net_rate - 1e-12


def test_the_optimum_of_one_head_is_what_the_papers_formulas_say():
    toy, process = TOYS[0], SafflowerConfig().process
    cut = 1.0 - (1.0 - process.stroke_cut) ** 3
    kept = 1.0 - process.suction_loss * np.exp(-3.0 / process.suction_decay_s)
    assert toy.net_rate == pytest.approx(cut * kept, abs=1e-12)
    # Down 0.1 m, the cart 0.3 m to the head and 0.15 m to the next look; accelerations and speeds are at their limits.
    down = np.sqrt(10.0 / np.sqrt(3.0) * 0.1 / 2.0)
    ahead, on = 15.0 / 8.0 * 0.3 / 0.3, np.sqrt(10.0 / np.sqrt(3.0) * 0.15 / 0.5)
    seconds = 7.304 + down + ahead + 0.5 + 3 * 0.04785 / 0.03 + 3.0 + down + on + 0.5 + 1.0
    grams = 0.4 * cut * kept
    assert toy.episode_return == pytest.approx(grams - 0.25 * (0.4 - grams) - 0.008 * seconds, abs=1e-12)
