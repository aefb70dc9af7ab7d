"""Produce that is packed to order: lines and cut-offs, bins that fill and are swapped, what is shown."""

import copy
from dataclasses import replace
from itertools import permutations
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.agents import make_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.agents.policies.base import act_single
from fieldgym.agents.policies.search import Taken, with_one
from fieldgym.agents.policies.sorting_orders import OrderHorizon, extend, wanted
from fieldgym.envs.core import NominalExecutor
from fieldgym.envs.field import FieldError
from fieldgym.envs.field_files import read_field, write_field
from fieldgym.envs.sorting.columns import CANDIDATE, candidate_table
from fieldgym.envs.sorting.config import SCENARIOS, PerceptionModel, ScenarioConfig, SortingConfig
from fieldgym.envs.sorting.core import SortingCore
from fieldgym.envs.sorting.field import Items, Orders, ProduceField
from fieldgym.envs.sorting.order_columns import BOOK, LINES_SHOWN, STRIDE
from fieldgym.envs.sorting.order_config import OrderConfig
from fieldgym.kernels.config import ConfigError, override
from fieldgym.kernels.seeds import TUNED

ID = "fieldgym/ProduceSorting-v0"
WARE, SEED, RIPE, GREEN = range(4)
VALUES = SortingConfig().produce.value


def packed(grades: list[int], wants: list[tuple[int, int, float]], gap_s: float = 2.0, **orders: Any) -> SortingCore:
    """Items in line, one every ``gap_s``, reported as they are, all held; wants are grade, count, cut-off."""
    book = OrderConfig(**{"shipments": 6, "every_s": 20.0, **orders})
    config = replace(SortingConfig(), scenario=ScenarioConfig(1.0, orders=book))
    core = SortingCore(config, PerceptionModel.perfect(), 1)
    n = len(grades)
    still = {"grip_luck": 0.0, "way_luck": 0.99, "slip_along_m": 0.0, "slip_across_m": 0.0, "across_m": 0.0}
    items = replace(
        Items.empty(n),
        passing_s=gap_s * np.arange(n) + 1.0,
        grade=np.array(grades),
        **{name: np.full(n, value) for name, value in still.items()},
    )
    field = ProduceField(items, orders=Orders(*np.array(wants).T))
    whole = core.complete(field, np.random.default_rng(0))
    core.load(np.array([0]), core.stack([whole]))
    return core


def decide(core: SortingCore, action: int) -> tuple[dict[str, float], dict[str, float]]:
    """Rewards and seconds of a decision."""
    plan = core.plan(np.array([action]))
    result = core.apply(plan, NominalExecutor(core).execute(plan))
    rewards = dict(zip(core.reward_names, result.rewards[0].tolist(), strict=True))
    return rewards, dict(zip(core.phase_names, result.phases_s[0].tolist(), strict=True))


def scores(core: SortingCore) -> dict[str, float]:
    return dict(zip(core.score_names, core.scores()[0].tolist(), strict=True))


def shown(core: SortingCore) -> dict[str, float]:
    return dict(zip(core.machine_features, core.observe()["machine"][0].tolist(), strict=True))


def test_items_fill_the_line_that_is_due_first_and_the_rest_is_surplus():
    # The second ripe line is written first: what is due first is filled first, here by the only item in time for it.
    core = packed([RIPE, RIPE, WARE, RIPE, RIPE], [(RIPE, 2, 60.0), (RIPE, 1, 2.0), (SEED, 3, 60.0)])
    paid = [decide(core, 0)[0]["placed"] for _ in range(5)]
    value, rest = VALUES[RIPE], 0.2
    assert paid == pytest.approx([value, value, rest * VALUES[WARE], value, rest * value])
    card = scores(core)
    assert card["total"] == 6 and card["done"] == 3 and card["surplus"] == 2 and card["missed"] == 3
    assert card["net_rate"] == pytest.approx(0.5) and card["lines_full"] == pytest.approx(2.0 / 3.0)
    assert card["value_rate"] == pytest.approx(3.0 * value / (3.0 * value + 3.0 * VALUES[SEED]))


def test_after_its_cut_off_a_line_takes_nothing():
    core = packed([RIPE, RIPE], [(RIPE, 1, 0.5), (WARE, 1, 60.0)])
    assert decide(core, 0)[0]["placed"] == pytest.approx(0.2 * VALUES[RIPE])
    # To the very moment it does.
    on_time = packed([RIPE, RIPE], [(RIPE, 1, float(core.time_s[0]))])
    assert decide(on_time, 0)[0]["placed"] == pytest.approx(VALUES[RIPE])
    late = packed([RIPE, RIPE], [(RIPE, 1, float(core.time_s[0]) - 1e-9)])
    assert decide(late, 0)[0]["placed"] == pytest.approx(0.2 * VALUES[RIPE])


def test_whoever_comes_with_an_item_waits_until_an_empty_bin_stands_there():
    core = packed([RIPE, RIPE, RIPE, GREEN], [(RIPE, 9, 90.0)], gap_s=1.0, bin_holds=2, swap_s=10.0)
    release_s = core.config.grip.release_s
    assert [decide(core, 0)[1]["release"] for _ in range(2)] == pytest.approx([release_s, release_s])
    full_s = float(core.time_s[0])
    assert shown(core)["ripe_fill"] == 0.0 and shown(core)["ripe_ready"] == pytest.approx(2.5)
    other = copy.deepcopy(core)
    cycle = candidate_table(core.observe())[0, 0, CANDIDATE.cycle] * 2.0
    _, phases = decide(core, 0)
    assert phases["release"] > release_s and sum(phases.values()) == pytest.approx(cycle, abs=1e-5)
    assert float(core.time_s[0]) == pytest.approx(full_s + 10.0 + release_s)
    assert scores(core)["swaps"] == 1 and shown(core)["ripe_fill"] == pytest.approx(0.5)
    # Another grade's bin is there.
    assert decide(other, 1)[1]["release"] == pytest.approx(release_s)


def test_wrong_items_fill_a_bin_and_no_line():
    core = packed([RIPE, RIPE], [(RIPE, 2, 60.0), (GREEN, 2, 60.0)])
    core.state.report_grade[0, core.state.slot_report[0, 0]] = GREEN
    rewards, _ = decide(core, 0)
    assert rewards["misplaced"] < 0.0 and rewards["placed"] == 0.0
    seen = shown(core)
    assert seen["green_fill"] == pytest.approx(1.0 / 6.0) and seen["ripe_fill"] == 0.0
    assert seen["ripe_left_1"] == seen["green_left_1"] == pytest.approx(2.0 / 6.0)


def test_what_is_shown_of_a_book_follows_from_the_decisions():
    env: Any = gym.make(ID, scenario="orders", backend="analytic", perception="model").unwrapped
    observation, info = env.reset(seed=3)
    book, core, rng = env.field.orders, env.core, np.random.default_rng(0)
    left, over, surplus = book.count.copy(), False, 0
    while not over:
        now, seen = float(core.time_s[0]), observation["machine"][BOOK:].reshape(4, STRIDE)
        table = candidate_table(observation)
        for grade in range(4):
            open_lines = [k for k in range(len(left)) if book.grade[k] == grade and left[k] and book.due_s[k] >= now]
            wanted = [(left[k] / 6.0, (book.due_s[k] - now) / 20.0) for k in open_lines[:LINES_SHOWN]]
            wanted += [(0.0, 0.0)] * (LINES_SHOWN - len(wanted))
            assert seen[grade, 2:] == pytest.approx(np.ravel(wanted), abs=1e-6)
            for item in table[(table[:, CANDIDATE.present] > 0) & (table[:, CANDIDATE.ware + grade] > 0)]:
                done_s = now + 2.0 * item[CANDIDATE.cycle]
                taken = any(book.due_s[k] >= done_s for k in open_lines)
                assert item[CANDIDATE.value] == pytest.approx(VALUES[grade] * (1.0 if taken else 0.2), rel=1e-6)
        observation, _, over, _, info = env.step(int(rng.choice(np.flatnonzero(observation["action_mask"]))))
        if info["rewards"]["placed"]:
            grade = int(core.planned.grade[0])
            able = [
                k for k in range(len(left)) if book.grade[k] == grade and left[k] and book.due_s[k] >= core.time_s[0]
            ]
            surplus += not able
            if able:
                left[able[0]] -= 1
            assert info["rewards"]["placed"] == pytest.approx(VALUES[grade] * (1.0 if able else 0.2))
        card = info["scorecard"]
        assert card["done"] == book.count.sum() - left.sum() and card["surplus"] == surplus
        assert card["lines_full"] == pytest.approx(np.mean(left == 0))
    assert surplus > 3 and (left < book.count).sum() > 2


def test_books_are_drawn_as_they_say_and_every_camera_has_the_same():
    config = SortingConfig(scenario=SCENARIOS["orders"])
    core: Any = SortingCore(config, PerceptionModel.perfect(), 1)
    book = np.array([core.draw([np.random.default_rng(seed)]).orders[0] for seed in range(300)])
    assert set(np.unique(book[..., 1])) == {4, 5, 6, 7, 8}
    assert book[..., 1].mean() == pytest.approx(6.0, abs=0.1)
    assert np.bincount(book[..., 0].astype(int).ravel()) / book[..., 0].size == pytest.approx(
        np.full(4, 0.25), abs=0.03
    )
    pairs = book[..., 0].reshape(-1, 2)
    assert (pairs[:, 0] != pairs[:, 1]).all()
    assert (book[..., 2] == np.array([22.0, 44.0, 66.0, 88.0]).repeat(2)).all()
    eyes: Any = SortingCore(config, PerceptionModel.measured(), 1)
    other = eyes.draw([np.random.default_rng(5)])
    assert np.array_equal(other.orders[0], book[5])


def test_a_stream_with_its_book_is_a_value(tmp_path):
    env: Any = gym.make(ID, scenario="orders", backend="analytic", perception="model").unwrapped
    env.reset(seed=4)
    field = env.field
    write_field(field, tmp_path / "four.csv")
    again: Any = read_field(tmp_path / "four.csv", ProduceField)
    assert again == field and np.array_equal(again.orders.count, field.orders.count)

    def play(**options: Any) -> list[float]:
        observation, _ = env.reset(seed=4, options=options)
        policy, total, over = make_policy("value-per-second", env), [], False
        while not over:
            observation, reward, over, _, _ = env.step(act_single(policy, observation))
            total.append(reward)
        return total

    first = play()
    env.reset(seed=9)
    assert play(field=again) == first
    # A stream without a book gets the one of its seed.
    env.reset(seed=4, options={"field": replace(field, orders=None)})
    assert env.field.orders is not None and len(env.field.orders) == 8
    batch: Any = gym.make_vec(ID, 3, vectorization_mode="vector_entry_point", scenario="orders", perception="model")
    batch.reset(options={"fields": [field] * 3})
    assert (batch.unwrapped.core.state.line_count == field.orders.count[None]).all()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: override(SortingConfig(), {"scenario.orders.count": (5, 4)}), "give the smaller one first"),
        (lambda: override(SortingConfig(), {"scenario.orders.shipments": 8}), "the last leaves after 176 s"),
        (lambda: override(SortingConfig(), {"scenario.orders.lines": 5}), r"\[1, 4\]"),
        (lambda: override(SortingConfig(), {"scenario.orders.bin_holds": 0}), r"\[1, 10000\]"),
    ],
)
def test_bad_orders_are_named_in_a_line(make, words):
    with pytest.raises(ConfigError, match=words) as told:
        make()
    assert "\n" not in str(told.value)


def test_books_that_do_not_fit_are_refused_in_a_line():
    core = packed([RIPE], [(RIPE, 1, 60.0)], shipments=1, lines=2)
    plain = SortingCore(SortingConfig(), PerceptionModel.perfect(), 1)
    field = plain.unstack(plain.draw([np.random.default_rng(0)]))[0]
    for rules, lines, words in (
        (plain, 1, "the scenario has none"),
        (core, 0, "give at least one"),
        (core, 3, "room for 2 orders"),
    ):
        book = Orders(np.zeros(lines, int), np.ones(lines, int), np.full(lines, 9.0))
        with pytest.raises(FieldError, match=words) as told:
            rules.complete(replace(field, orders=book), np.random.default_rng(0))
        assert "\n" not in str(told.value)


def test_where_nothing_is_ordered_nothing_of_it_is_there():
    core = SortingCore(SortingConfig(), PerceptionModel.measured(), 1)
    assert core.state.line_left.size == core.state.bin_ready_s.size == core.state.tallies.size == 0
    assert len(core.machine_features) == BOOK and "lines_full" not in core.score_names
    assert core.draw([np.random.default_rng(0)]).orders is None


def sequences(env: Any, decisions: int) -> tuple[Any, Any]:
    """The planner's problem somewhere in an episode, and the rules that stand there."""
    observation, _ = env.reset(seed=6)
    policy = make_policy("fifo", env)
    for _ in range(decisions):
        observation = env.step(act_single(policy, observation))[0]
    planner = OrderHorizon(env.core.config, by_value=True)
    batched = {name: values[None] for name, values in observation.items()}
    gain = candidate_table(batched).astype(float)[..., CANDIDATE.ware : CANDIDATE.ware + 4] @ np.array(VALUES)
    return planner.problem(batched, planner._picks(batched, gain, 0.0)), env.core


def test_a_sequence_brings_what_the_planner_reckons():
    """Picks in a row, as planned and as the rules carry them out: when they end, and what they are paid."""
    orders = {"scenario.orders.bin_holds": 2, "scenario.orders.swap_s": 6.0, "scenario.orders.count": (1, 3)}
    env: Any = gym.make(ID, scenario="orders", backend="analytic", perception="perfect", overrides=orders).unwrapped
    tried, surplus, waits = 0, 0, 0
    for decisions in (4, 8, 12, 16, 20):
        problem, core = sequences(env, decisions)
        problem = problem._replace(worth=np.ones_like(problem.worth), surplus=0.2)
        # Every grip holds.
        core.state.report_held[:], core.state.report_lost[:] = True, False
        slots = [k for k in range(12) if problem.picks.present[0, k]]
        for order in list(permutations(slots[:6], 3))[::4]:
            rules, clock, x, y, z, taken = copy.deepcopy(core), 0.0, 0.0, 0.0, 0.0, Taken(0, 0, 0)
            left = {k: int(core.state.slot_report[0, k]) for k in order}
            for number, k in enumerate(order):
                step = extend(problem, 0, x, y, z, clock, k, 0, taken, number == 0)
                where = np.flatnonzero(rules.state.slot_report[0] == left[k])
                if not step.possible or not len(where) or not rules.observe()["action_mask"][0, where[0]]:
                    break
                began = float(rules.time_s[0])
                rewards, phases = decide(rules, int(where[0]))
                assert step.clock_s - clock == pytest.approx(float(rules.time_s[0]) - began, abs=0.06)
                assert step.gain == pytest.approx(rewards["placed"], abs=1e-6)
                tried, surplus = tried + 1, surplus + (0.0 < rewards["placed"] < 0.25)
                waits += phases["release"] > 0.2
                taken, x, y, z, clock = with_one(taken, k, 0), step.x, step.y, step.z, step.clock_s
    assert tried > 60 and surplus > 5 and waits > 5


def test_items_of_a_sequence_fill_lines_one_after_the_other():
    lines = {"left": [1.0, 2.0, 0.0], "due_s": [5.0, 50.0, 0.0], "worth": [0.9, 0.5, 0.0]}
    problem: Any = SimpleNamespace(**{name: np.array([[values]]) for name, values in lines.items()}, surplus=0.2)
    share = getattr(wanted, "py_func", wanted)
    assert [share(problem, 0, 0, ahead, 4.0) for ahead in range(4)] == [0.9, 0.5, 0.5, 0.2]
    assert [share(problem, 0, 0, 0, time_s) for time_s in (5.0, 6.0, 50.0, 51.0)] == [0.9, 0.5, 0.5, 0.2]


def test_planning_for_orders_delivers_more_than_the_queue():
    seeds = TUNED.take(12, 3000)

    def card(name: str) -> Any:
        return evaluate(lambda env: make_policy(name, env), ID, seeds, scenario="orders", perception="model").scorecard

    queue, greedy, planned = (card(name)["net_rate"] for name in ("fifo", "value-per-second", "receding-horizon-value"))
    assert (planned - queue).mean() > 0.06 and (planned - greedy).mean() > 0.0
