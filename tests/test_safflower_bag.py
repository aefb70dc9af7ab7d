"""A picker whose bag fills up and whose heads wilt: rules, what is shown, policies, a bound, and that others stay."""

import copy
from dataclasses import replace
from itertools import permutations
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym import bounds
from fieldgym.agents import act_single, make_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.agents.policies.safflower_bag import BagHorizon
from fieldgym.agents.policies.search import MOST_WIDTH
from fieldgym.bounds import gatherer, safflower
from fieldgym.bounds.clogging import clogging
from fieldgym.bounds.wilting import STEP_S, Closing, most
from fieldgym.envs.field import FieldError
from fieldgym.envs.safflower.bag_config import Bag, Wilting
from fieldgym.envs.safflower.config import OPEN_STAGES, SCENARIOS, PerceptionModel, SafflowerConfig
from fieldgym.envs.safflower.core import SafflowerCore
from fieldgym.envs.safflower.features import DC, DM, C, candidate_table
from fieldgym.envs.safflower.field import Closings
from fieldgym.envs.safflower.process import collected_share
from fieldgym.envs.safflower.state import T
from fieldgym.envs.task import task
from fieldgym.kernels.config import ConfigError
from fieldgym.kernels.seeds import TUNED
from fieldgym.testing import check_batch

ID = "fieldgym/SafflowerPicking-v0"
SMALL = {
    "scenario.plants": 4,
    "scenario.max_heads": 2,
    "scenario.mean_heads": 2.0,
    "scenario.window_m": 0.15,
    "slots": 8,
}


def made(perception: str = "perfect", backend: str = "analytic", **overrides: Any) -> Any:
    kwargs = {"scenario": "bag", "perception": perception, "disable_env_checker": True}
    return gym.make(ID, backend=backend, overrides=overrides, **kwargs).unwrapped


def first_pick(info: Any, effort: int = 1) -> int:
    """The first legal pick with an effort; -1 where there is none."""
    legal = np.flatnonzero(info["action_mask"][:-2].reshape(-1, 3)[:, effort])
    return 3 * int(legal[0]) + effort if len(legal) else -1


def test_a_bag_fills_up_is_shown_and_emptied():
    env = made(**{"scenario.bag.capacity_g": 1.0, "scenario.bag.clog": 0.0, "scenario.wilting.closes_s": (0.0, 0.0)})
    observation, info = env.reset(seed=4)
    empty, drive = env.action_space.n - 1, env.action_space.n - 2
    assert observation["machine"][DM.bag] == 0.0 and not info["action_mask"][empty] and info["action_mask"][drive]
    held = 0.0
    while held < 1.0:
        observation, _, _, _, info = env.step(first_pick(info))
        held = info["scorecard"]["collected_g"]
        assert observation["machine"][DM.bag] == pytest.approx(held, rel=1e-6) and info["action_mask"][empty]
    assert first_pick(info) == -1
    before = info["scorecard"]
    observation, _, _, _, info = env.step(0)
    assert info["scorecard"]["illegal"] == 1.0
    pose = env.core.state.pose.copy()
    observation, reward, _, _, info = env.step(empty)
    assert observation["machine"][DM.bag] == 0.0 and first_pick(info) >= 0
    after = info["scorecard"]
    seconds = env.core.config.scenario.bag.empty_s
    assert after["phase_suck_s"] - before["phase_suck_s"] == pytest.approx(seconds)
    assert reward == pytest.approx(env.core.config.weights.seconds * seconds)
    assert (env.core.state.pose == pose).all() and after["collected_g"] == before["collected_g"]
    assert not info["action_mask"][empty]
    *_, info = env.step(empty)
    assert info["scorecard"]["illegal"] == after["illegal"] + 1.0 and (env.core.state.pose == pose).all()


def test_the_fuller_the_bag_the_more_of_what_is_cut_drops():
    env = made(**{"scenario.wilting.closes_s": (0.0, 0.0), "process.luck_logit": 0.0})
    _, info = env.reset(seed=4)
    core = env.core
    for fill in (0.0, 0.5, 0.999):
        twin = copy.deepcopy(core)
        twin.state.totals[0, T.bag] = fill * 4.0
        action = first_pick(info, 2)
        plan = twin.plan(np.array([action]))
        twin.apply(plan, twin.nominal(plan))
        gained, dropped = twin.state.totals[0, [T.gained, T.dropped]]
        share = collected_share(twin.tables.efforts[2, 1], 1.0) * (1.0 - 0.45 * fill)
        assert gained / (gained + dropped) == pytest.approx(share, rel=1e-9)
        assert twin.state.totals[0, T.bag] == pytest.approx(fill * 4.0 + gained)


@pytest.mark.parametrize("late_s", [-0.01, 0.01])
def test_a_head_that_has_wilted_when_it_is_done_brings_nothing(late_s):
    env = made()
    _, info = env.reset(seed=4)
    core, action = env.core, first_pick(info)
    plan = core.plan(np.array([action]))
    done_s = core.state.totals[0, 0] + plan.phases_s[0].sum()
    core.state.head_closes_s[0, core.state.track_head[0, plan.report[0]]] = done_s - late_s
    *_, info = env.step(action)
    card = info["scorecard"]
    assert (card["collected_g"] > 0.0) == (card["done"] == 1.0) == (late_s < 0.0)
    assert card["wasted"] == float(late_s > 0.0)
    assert late_s < 0.0 or info["rewards"]["lost"] == 0.0


def test_where_heads_wilt_and_nothing_fills_up_the_planner_picks_by_numbers():
    """What is in a bag that there is not was no number once, and so was every plan."""
    empty: Any = {"scenario.bag.capacity_g": 0.0}
    env = made(**empty)
    observation, _ = env.reset(seed=1)
    policy: Any = make_policy("bag-horizon", env)
    action = act_single(policy, observation)
    seen = {name: part[None] for name, part in observation.items()}
    assert observation["action_mask"][action] and 0.0 < policy.expected(seen, np.array([action]))[0] < 1.0


def test_what_is_shown_of_wilting_is_what_the_camera_can_know():
    perfect, model = made(), made("model")
    for env in (perfect, model):
        observation, _ = env.reset(seed=7)
        table, state = candidate_table(observation), env.core.state
        slots = np.flatnonzero(table[:, C.present])
        report = state.slot_report[0, slots]
        head = state.track_head[0, report]
        closes_s = 100.0 * table[slots, DC.closes] + state.totals[0, 0]
        in_bloom = table[slots][:, [C.fresh, C.late]].any(axis=1)
        assert (table[slots][~in_bloom, DC.closes] == 0.0).all() and in_bloom.sum() > 3
        error_s = (closes_s - state.head_closes_s[0, head])[in_bloom & (table[slots, DC.closes] > 0.0)]
        if env is perfect:
            assert np.abs(error_s).max() < 1e-3
        else:
            assert 1.0 < np.abs(error_s).max() < 400.0
        rows = np.sign(state.head_position[0, head, 1] - 0.5 * env.core.config.machine.picker.five_bar.base_m)
        assert (np.abs(rows - (2.0 * table[slots, DC.row] - 1.0)) < 1.0).mean() > 0.75
        assert set(np.unique(table[slots, DC.row])) == {0.0, 1.0}


def test_late_heads_wilt_in_the_first_half_and_others_in_all_of_the_range():
    env: Any = gym.make_vec(ID, 40, vectorization_mode="vector_entry_point", scenario="bag", perception="perfect")
    env.reset(seed=0)
    state = env.unwrapped.core.state
    for stage, last_s in zip(OPEN_STAGES, (900.0, 470.0), strict=True):
        closes_s = state.head_closes_s[:, :-1][state.head_stage[:, :-1] == stage]
        closes_s = closes_s[closes_s > 0.0]
        assert 40.0 <= closes_s.min() < 60.0 and last_s - 30.0 < closes_s.max() <= last_s
        assert np.mean(closes_s) == pytest.approx(0.5 * (40.0 + last_s), abs=25.0)
    env.close()


def test_a_field_carries_its_closings_and_a_wrong_number_of_them_is_refused_in_one_line():
    env = made("model")
    env.reset(seed=3)
    field = env.core.draw_field(np.random.default_rng(3))
    assert field.closings is not None and len(field.closings) == len(field.heads)
    env.reset(seed=5, options={"field": field})
    held = env.core.state.head_closes_s[0, field.heads.slot]
    assert (held == field.closings.closes_s).all()
    short = replace(field, closings=Closings(np.ones(1), np.ones(1)))
    with pytest.raises(FieldError, match=r"closings 1: 1 rows: this row has \d+ heads, give a row each"):
        env.reset(seed=5, options={"field": short})


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"bag": Bag(), "rows": 4}, "plants = 18: give a multiple of rows = 4"),
        ({"row_gap_m": 0.0}, "row_gap_m = 0.0: give the distance of the 2 rows in m, above 0"),
    ],
)
def test_rows_that_cannot_be_are_refused_in_one_line(wrong, told):
    with pytest.raises(ConfigError, match=told):
        replace(SCENARIOS["bag"], **wrong)
    with pytest.raises(ConfigError, match=r"closes_s = .*: give a first and a last time in s"):
        Wilting(closes_s=(9.0, 3.0))


def test_a_batch_gives_what_single_environments_give():
    check_batch(ID, "bag", "SameStep", 3, 60, perception="model")


def test_only_where_something_is_demanded_it_is_shown():
    plain, bag = gym.make(ID, scenario="row", backend="analytic", perception="model").unwrapped, made()
    names = plain.core.machine_features, plain.core.candidate_features  # type: ignore[attr-defined]
    assert (bag.core.machine_features, bag.core.candidate_features) == (
        (*names[0], "bag"),
        (*names[1], "closes", "row"),
    )
    assert plain.action_space.n + 1 == bag.action_space.n == 3 * 16 + 2  # type: ignore[attr-defined]
    assert plain.core.state.head_closes_s.shape == (1, 0)  # type: ignore[attr-defined]


def test_closing_first_takes_what_wilts_soonest_of_what_can_be_done_in_time():
    env = made("model")
    observation, info = env.reset(seed=9)
    policy = make_policy("closing-first", env)
    table = candidate_table(observation)
    work_s = 7.304 + 0.5 + 2 * 0.04785 / 0.030 + 2.0
    left_s, took_s = 100.0 * table[:, DC.closes], 4.0 * table[:, C.travel] + work_s
    able = np.flatnonzero(info["action_mask"][1:-2:3].astype(bool) & (left_s >= took_s) & (table[:, C.bud] == 0.0))
    able = [k for k in able if table[k, C.fresh] or table[k, C.late]]
    assert len(able) > 3
    # What would wilt before it is done is left: the second best, once the best has a second.
    for best in sorted(able, key=lambda k: left_s[k])[:2]:
        assert policy.act({name: values[None] for name, values in observation.items()}) == [3 * best + 1]
        table[best, DC.closes] = 0.01
    # A full bag is emptied as long as something is wanted.
    observation["machine"][DM.bag] = 1.0
    assert policy.act({name: values[None] for name, values in observation.items()}) == [env.action_space.n - 1]
    observation["candidates"][:] = 0.0
    assert policy.act({name: values[None] for name, values in observation.items()}) == [env.action_space.n - 2]


def test_the_planner_knows_what_order_and_bag_are_worth():
    def scores(name):
        def make(env):
            return make_policy(name, env)

        return evaluate(make, ID, TUNED.take(40, 50), scenario="bag", perception="model")

    own, paper = scores("best"), scores(task(ID).reference)
    assert (100.0 * (own.scorecard["net_rate"] - paper.scorecard["net_rate"])).mean() > 5.0
    assert (own.returns - paper.returns).mean() > 0.2 * paper.returns.mean()


def test_no_policy_beats_the_bound_on_the_bag():
    seeds = list(TUNED.take(4, 90))
    found: list[Any] = [bounds.instance(ID, seed, scenario="bag", perception="model").bound() for seed in seeds]
    for name in task(ID).lineups["bag"]:
        scores = evaluate(lambda env, name=name: make_policy(name, env), ID, seeds, scenario="bag", perception="model")
        for i, bound in enumerate(found):
            assert scores.scorecard["net_rate"][i] <= bound.net_rate + 1e-9, name
            assert scores.returns[i] <= bound.episode_return + 1e-9, name
            assert scores.scorecard["cycle_time_s"][i] >= bound.cycle_time_s or not scores.scorecard["done"][i]
            assert not bound.proven
            # Who knows the luck gets far more, and no more than the bound.
            assert scores.returns[i] + 0.2 < bound.found.episode_return <= bound.episode_return, name
            assert scores.scorecard["net_rate"][i] < bound.found.net_rate <= bound.net_rate, name
            assert bound.gap < 0.3


def test_the_environment_pays_what_was_found(monkeypatch):
    env, seed, tried = made("model"), 3, []
    carried_out = gatherer.carried_out

    def written(core: Any, decisions: Any, tracks: Any, efforts: int) -> Any:
        tried.append((decisions.tolist(), tracks, carried_out(core, decisions, tracks, efforts)))
        return tried[-1][2]

    monkeypatch.setattr(gatherer, "carried_out", written)
    monkeypatch.setattr(gatherer, "CHANGES", 4000)
    known: Any = bounds.instance(ID, seed, scenario="bag", perception="model")
    bound: Any = known.bound()
    emptied, onward = 0, env.action_space.n - 2
    for decisions, tracks, (grams, value) in tried:
        (_, info), total, over = env.reset(seed=seed), 0.0, False
        for did in decisions:
            slots = np.flatnonzero(env.core.state.slot_report[0] == tracks[did // 3]) if did >= 0 else [0]
            action = 3 * int(slots[0]) + did % 3 if did >= 0 else onward + (did == -1)
            assert info["action_mask"][action] and not over
            _, reward, terminated, truncated, info = env.step(action)
            over, total, emptied = terminated or truncated, total + float(reward), emptied + (did == -1)
        assert over and total == pytest.approx(value) and info["scorecard"]["collected_g"] == pytest.approx(grams)
    assert emptied > len(tried)
    assert bound.found.episode_return == max(value for *_, (_, value) in tried)
    assert bound.found.net_rate == pytest.approx(max(grams for *_, (grams, _) in tried) / known.total_g)
    alone: Any = bounds.instance(ID, seed, scenario="bag", perception="model", carried_out=False).bound()
    assert alone.found is None and (alone.net_rate, alone.expected) == (bound.net_rate, bound.expected)
    decisions, account = gatherer.sought(known.core[1], np.random.default_rng(0).random((4000, 5)), gatherer.WARM)
    # The rules pay what the search reckons with.
    assert carried_out(known.core[0], decisions, known.core[2], 3)[1] == pytest.approx(account)


def test_what_a_bag_lets_drop_is_no_less_than_its_picks_cost():
    env: Any = gym.make_vec(ID, 1, vectorization_mode="vector_entry_point", scenario="bag", perception="model")
    config, paid = env.unwrapped.core.config, np.zeros(2)
    known: Any = None
    for seed in range(12):
        env.reset(seed=seed)
        core, rng, saved = env.unwrapped.core, np.random.default_rng(seed), (0.02, 0.1, 0.3)[seed % 3]
        state = core.state
        known = safflower.instance_of(core)
        place = {track: i for i, track in enumerate(known.core[2].tolist())}
        sides = [clogging(side, known.least_g, saved) for side in known.clogs]
        costs = [np.concatenate(side.costs) for side in sides]
        clean = [np.concatenate([stop.gain for stop in stops]) for stops in (known.stops, known.hoped)]
        lost, cost, bags, over = np.zeros(2), np.zeros(2), 1, False
        while not over:
            onward, bag_g, before_g = 3 * config.slots, state.totals[0, T.bag], state.totals[0, T.gained]
            legal = np.flatnonzero(core.observe()["action_mask"][0][:onward])
            luck = rng.random()
            action = int(rng.choice(legal)) if len(legal) and luck < 0.85 else onward + int(luck > 0.9 and bag_g > 0.0)
            track, effort = int(state.slot_report[0, min(action // 3, config.slots)]), action % 3
            plan = core.plan(np.array([action]))
            result = core.apply(plan, core.nominal(plan))
            over, gained = result.terminated[0] or result.truncated[0], state.totals[0, T.gained] - before_g
            bags += action == onward + 1
            if gained > 0.0:
                head = state.track_head[0, [track]]
                error, mass = state.head_position[0, head] - state.track_target[0, [track]], known.core[1].mass_g

                def share(dropped: float, odds: float, fill: float = bag_g / config.scenario.bag.capacity_g) -> float:
                    return collected_share(dropped + (1.0 - dropped) * config.scenario.bag.clog * fill, odds)

                i = place[track]
                mean = safflower._gains(config, error, mass[[i]], None, share)[0, effort]
                lost += [clean[0][i, effort] - gained, clean[1][i, effort] - mean]
                cost += [costs[0][i, effort], costs[1][i, effort]]
        assert (lost >= cost - bags * saved - 1e-9).all()
        paid = np.maximum(paid, (cost - bags * saved) / lost)
    # They are no small part of it, at random as these paths are.
    assert (paid > 0.25).all()
    nothing = [0.0 * least for least in known.least_g]
    free: Any = replace(known, clogs=(nothing, nothing)).bound()
    own: Any = known.bound()
    assert free.episode_return > own.episode_return + 0.5 and free.found == own.found
    assert free.expected.episode_return > own.expected.episode_return + 0.5


def schedule(jobs: Any, order: Any, efforts: Any, begin_s: float) -> float:
    """What picking in an order at one stop brings, by the second each takes."""
    clock_s, worth = begin_s, 0.0
    for job, effort in zip(order, efforts, strict=True):
        clock_s += jobs.takes_s[job, effort]
        worth += jobs.worth[job, effort] if clock_s <= jobs.closes_s[job] else 0.0
    return worth


@pytest.mark.parametrize("seed", range(6))
def test_shares_of_picks_bring_at_least_what_trying_everything_finds(seed):
    rng = np.random.default_rng(seed)
    worth = np.sort(rng.uniform(0.2, 1.0, (4, 2)), axis=1)
    jobs = Closing(worth, np.sort(rng.uniform(8.0, 16.0, (4, 2)), axis=1), rng.uniform(10.0, 60.0, 4), 1.0)
    found = max(
        schedule(jobs, order, efforts, 1.0)
        for count in range(5)
        for order in permutations(range(4), count)
        for efforts in np.ndindex(*[2] * count)
    )
    bound = most([jobs], 1.0, 500.0, 16.0, 0.0)
    assert found - 1e-9 <= bound <= found + 1.0
    if seed == 0:
        loose = jobs._replace(closes_s=np.full(4, 400.0))
        assert most([loose], 1.0, 500.0, 16.0, 0.0) == pytest.approx(worth[:, 1].sum(), abs=1e-9)
        second = 0.01
        each = (worth - second * jobs.takes_s).max(axis=1)
        paid = most([loose], 1.0, 500.0, 16.0, second)
        assert paid == pytest.approx(each[each > 0.0].sum() - second * 1.0, abs=2.0 * STEP_S * second + 1e-9)


def toy(seed: int, time_limit_s: float) -> SafflowerCore:
    """Two small pots with three reports in all, a bag that holds little more than a head, and heads that wilt soon."""
    bag, wilting = Bag(capacity_g=0.4, empty_s=6.0, clog=0.3), Wilting(closes_s=(14.0, 60.0))
    scenario = replace(SCENARIOS["pots"], plants=2, max_heads=2, bag=bag, wilting=wilting, time_limit_s=time_limit_s)
    for number in range(100):
        core = SafflowerCore(SafflowerConfig(scenario=scenario, slots=4), PerceptionModel.perfect(), 1)
        core.reset_rows(np.array([0]), [np.random.default_rng(1000 * seed + number)])
        if int(core.state.first[0, -1]) == 3:
            return core
    raise AssertionError("no toy has so many reports")


@pytest.mark.parametrize(("seed", "time_limit_s"), [(2, 80.0), (1, 24.0)])
def test_the_bound_is_no_lower_than_what_trying_everything_finds(seed, time_limit_s, best_by_trying):
    core = toy(seed, time_limit_s)
    bound = safflower.instance_of(core).bound()
    most_return, rate, cycle_s = best_by_trying(core)
    assert 0.0 < rate - 1e-9 <= bound.net_rate < 1.0
    assert most_return - 1e-9 <= bound.episode_return < most_return + 0.5
    assert bound.found is not None and bound.found.episode_return == pytest.approx(most_return)
    assert bound.found.net_rate == pytest.approx(rate)
    assert bound.cycle_time_s <= cycle_s + 1e-9


def test_a_planner_keeps_to_its_budget_by_the_narrowest_search():
    env: Any = gym.make_vec(ID, 8, scenario="bag", vectorization_mode="vector_entry_point", perception="model")
    usual, hurried = BagHorizon.make(env, 0), BagHorizon.make(env, 0, budget_ms=0.0)
    narrow, leisurely = BagHorizon.make(env, 0, width=1), BagHorizon.make(env, 0, budget_ms=1e9)
    observation, differs = env.reset(seed=list(TUNED.take(8)))[0], False
    for step in range(40):
        actions = usual.act(observation)
        assert np.array_equal(hurried.act(observation), narrow.act(observation))
        differs |= not np.array_equal(actions, narrow.act(observation))
        if step == 5:
            widest = BagHorizon.make(env, 0, width=MOST_WIDTH)
            assert np.array_equal(leisurely.act(observation), widest.act(observation))
        observation = env.step(actions)[0]
    assert differs
