"""Produce packed to order: bounds against trying everything, with the luck known and with whatever it may be."""

from dataclasses import replace
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
import pytest

from fieldgym import bounds
from fieldgym.agents import make_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.bounds import grips, packer, packing, sorting
from fieldgym.envs.core import NominalExecutor
from fieldgym.envs.sorting.columns import TOTAL, TRUTH
from fieldgym.envs.sorting.config import GRADES, SCENARIOS, PerceptionModel, SortingConfig
from fieldgym.envs.sorting.core import SortingCore
from fieldgym.envs.sorting.field import Items, Orders, ProduceField
from fieldgym.envs.sorting.order_config import OrderConfig
from fieldgym.envs.sorting.reports import foresee
from fieldgym.kernels.config import override

ID = "fieldgym/ProduceSorting-v0"
EXACT = 1e-9
TOUCHED = 0.02
"""Part of a bound in expectation by which it may miss the best policy: a line may be filled on average alone."""
RIPE = GRADES.index("ripe")


def crowded(seed: int, reports: int = 4, **changes: Any) -> SortingCore:
    """A short crowded stream with two small lorries and a bin that is soon full, waits that are long."""
    book = OrderConfig(shipments=2, every_s=4.0, lines=2, count=(1, 2), bin_holds=2, swap_s=1.5)
    scenario = replace(SCENARIOS["load-1.6"], stream_s=3.0, load=2.5, orders=book)
    config = SortingConfig(scenario=scenario, grip=replace(SortingConfig().grip, wait_s=1.5))
    for number in range(200):
        core = SortingCore(override(config, changes), PerceptionModel.measured(), 1)
        core.reset_rows(np.array([0]), [np.random.default_rng(1000 * seed + number)])
        if int(core.state.queued[0]) == reports:
            return core
    raise AssertionError("no toy has so many reports")


def hasty(best: float) -> SortingCore:
    """Two items that are due before both could be packed, unless the first grip fails; each holds by chance."""
    book = OrderConfig(shipments=1, every_s=20.0, lines=2)
    config = SortingConfig(scenario=replace(SCENARIOS["load-1.6"], orders=book))
    core = SortingCore(override(config, {"grip.best": best}), PerceptionModel.perfect(), 1)
    still = {"grip_luck": 0.0, "way_luck": 0.99, "slip_along_m": 0.0, "slip_across_m": 0.0, "across_m": 0.0}
    items = replace(
        Items.empty(2),
        passing_s=np.array([1.0, 1.4]),
        grade=np.array([RIPE, RIPE]),
        **{name: np.full(2, value) for name, value in still.items()},
    )
    field = core.complete(ProduceField(items, orders=Orders(*np.array([[RIPE, 2, 2.5]]).T)), np.random.default_rng(0))
    core.load(np.array([0]), core.stack([field]))
    return core


class Odds(NamedTuple):
    """Chances of a report: that the fingers hold, that what they hold slips, that it is of the grade reported."""

    holds: float
    slips: float
    right: float


def odds(core: SortingCore, report: int) -> Odds:
    """By halving between lucks that fare well and lucks that fare ill."""
    state, told = core.state, int(core.state.report_grade[0, report])
    item = int(state.report_item[0, report])
    found = []
    for luck, which in ((TRUTH.grip_luck, 0), (TRUTH.way_luck, 1)):
        truth, low, high = state.item_truth[0, item].copy(), 0.0, 1.0
        for _ in range(45):
            truth[luck] = 0.5 * (low + high)
            low, high = (
                (truth[luck], high)
                if foresee(core.tables, state.number[0, report], truth)[which]
                else (low, truth[luck])
            )
        found.append(low)
    right = float(state.item_truth[0, item, TRUTH.grade] == told)
    if told >= RIPE:
        # As many ripe fruits come as green ones, and none is taken for a tuber.
        eyes: Any = core.perception
        seen = np.array(eyes.confusion)[RIPE:, told]
        right = float(seen[told - RIPE] / seen.sum())
    return Odds(found[0] if item < state.item_truth.shape[1] - 1 else 0.0, found[1], right)


def best_on_average(core: SortingCore, counted: bool) -> float:
    """Largest mean return, or number of items delivered, of policies that know all but the luck of picks to come."""
    state, executor = core.state, NominalExecutor(core)
    known = {report: odds(core, report) for report in state.queue[0, : state.queued[0]].tolist()}
    met: dict[bytes, float] = {}

    def paid(action: int) -> float:
        """What is paid for a decision and, in the best case, for those after it; the state goes on from it."""
        before = state.totals[0, TOTAL.placed]
        plan = core.plan(np.array([action]))
        result = core.apply(plan, executor.execute(plan))
        now = state.totals[0, TOTAL.placed] - before if counted else result.rewards.sum()
        return float(now) + (0.0 if result.terminated[0] or result.truncated[0] else best())

    def picked(action: int, restore: Any) -> float:
        report = int(state.slot_report[0, action])
        item, told = state.report_item[0, report], state.report_grade[0, report]
        holds, slips, right = known[report]
        kept = holds * (1.0 - slips)
        mean = 0.0
        for chance, held, lost, grade in (
            (1.0 - holds, False, False, told),
            (holds * slips, True, True, told),
            (kept * right, True, False, told),
            (kept * (1.0 - right), True, False, (told + 1) % len(GRADES)),
        ):
            if chance > 0.0:
                state.report_held[0, report], state.report_lost[0, report] = held, lost
                state.item_truth[0, item, TRUTH.grade] = grade
                mean += chance * paid(action)
                restore()
        return mean

    def best() -> float:
        numbers = state.totals[0, TOTAL.time_s], *state.place[0], *state.bin_ready_s[0]
        parts = np.round(numbers, 9), state.leave_s, state.line_left, state.bin_items
        here = b"".join(part.tobytes() for part in parts)
        if here not in met:
            saved, most = [part.copy() for part in state], -np.inf

            def restore() -> None:
                for part, was in zip(state, saved, strict=True):
                    part[...] = was

            for action in np.flatnonzero(core.observe()["action_mask"][0]).tolist():
                most = max(most, picked(action, restore) if action < core.config.slots else paid(action))
                restore()
            met[here] = most
        return met[here]

    return best()


def test_no_order_of_picks_delivers_more_than_the_bound(best_by_trying):
    touched, reached = 0, 0
    for seed in range(6):
        core = crowded(seed)
        instance, best = sorting.instance_of(core), best_by_trying(core)
        bound = instance.bound()
        assert bound.found is not None and bound.found.episode_return <= best.episode_return + EXACT
        assert bound.found.net_rate <= best.net_rate
        reached += bound.found == pytest.approx(bounds.base.Found(best.net_rate, best.episode_return))
        assert best.episode_return <= bound.episode_return + EXACT and best.net_rate <= bound.net_rate + EXACT
        assert best.cycle_time_s >= instance.cycle_time_at(best.net_rate - EXACT) - EXACT
        touched += best.net_rate == pytest.approx(bound.net_rate)
    assert touched >= 5 and reached == 6


def test_the_environment_pays_what_was_found(monkeypatch):
    env: Any = gym.make(ID, scenario="orders", backend="analytic")
    seed, tried, info = 1, [], {}
    packed = packer.packed

    def written(core: Any, reports: Any) -> Any:
        tried.append((reports.tolist(), packed(core, reports)))
        return tried[-1][1]

    monkeypatch.setattr(packer, "packed", written)
    bound: Any = bounds.instance(ID, seed, scenario="orders").bound()
    for reports, (delivered, value) in tried:
        (_, info), total, over = env.reset(seed=seed), 0.0, False
        state = env.unwrapped.core.state
        while not over:
            slots = np.flatnonzero(state.slot_report[0] == reports[0]) if reports else np.zeros(0, int)
            if len(slots) and info["action_mask"][slots[0]]:
                action = int(slots[0])
                reports = reports[1:]
            else:
                action = env.action_space.n - 1
            _, reward, terminated, truncated, info = env.step(action)
            over, total = terminated or truncated, total + float(reward)
        assert not reports and total == pytest.approx(value) and info["scorecard"]["done"] == delivered
    assert bound.found.episode_return == max(value for _, (_, value) in tried) <= bound.episode_return
    assert bound.found.net_rate == max(delivered for _, (delivered, _) in tried) / info["scorecard"]["total"]
    alone: Any = bounds.instance(ID, seed, scenario="orders", carried_out=False).bound()
    assert alone.found is None and (alone.net_rate, alone.episode_return) == (bound.net_rate, bound.episode_return)
    # What is left out, bins that are swapped, costs little; who knows the luck gets far more than a policy.
    assert 0.0 < bound.gap < 0.05
    scores = evaluate(lambda env: make_policy("receding-horizon-value", env), ID, [seed], scenario="orders")
    assert scores.returns[0] + 2.0 < bound.found.episode_return
    assert scores.scorecard["net_rate"][0] < bound.found.net_rate <= bound.net_rate


def near(core: SortingCore) -> int:
    """Which of the two bounds in expectation the best policy comes near; none is below it."""
    hope: Any = sorting.instance_of(core).bound().expected
    assert not hope.estimated
    items, found = core.state.totals[0, TOTAL.items], 0
    for counted, bound in ((False, hope.episode_return), (True, hope.net_rate * items)):
        most = best_on_average(core, counted)
        assert most <= bound + EXACT
        found += bound - most <= TOUCHED * max(bound, EXACT)
    return found


def test_no_policy_delivers_more_on_average_than_the_bound():
    assert sum(near(crowded(seed, 3)) for seed in (1, 2, 3, 4, 7)) >= 9


@pytest.mark.slow
@pytest.mark.long
def test_no_policy_delivers_more_on_average_than_the_bound_of_many_toys():
    easy = {"grip.best": 0.7, "grip.slip": 0.9}
    assert sum(near(crowded(seed, 3 + seed % 2, **(easy if seed % 3 == 0 else {}))) for seed in range(8, 38)) >= 50


def test_a_grip_that_fails_leaves_time_for_another():
    for best in (0.3, 0.6):
        core = hasty(best)
        hope: Any = sorting.instance_of(core).bound().expected
        # The second one is tried only after a grip that failed.
        assert best_on_average(core, True) == pytest.approx(best * (2.0 - best), abs=1e-6)
        assert hope.net_rate * 2.0 == pytest.approx(best * (2.0 - best), abs=1e-3)
        assert hope.episode_return == pytest.approx(best_on_average(core, False), abs=1e-3)


@pytest.mark.parametrize("seed", [3, 4])
def test_whatever_the_prices_no_policy_gets_more(seed, monkeypatch):
    core, rng = crowded(seed, 3), np.random.default_rng(seed)
    most = best_on_average(core, False)
    seen = []

    def at_random(lines: Any, goods: Any, guess: Any) -> list[Any]:
        return [rng.choice([0.0, 0.2, 1.0], len(guess) + len(lines.wants)) * rng.random()]

    monkeypatch.setattr(sorting, "first_prices", at_random)
    monkeypatch.setattr(sorting, "STAGES", [stage._replace(rounds=0) for stage in packing.STAGES])
    monkeypatch.setattr(sorting, "most_filled", lambda *_: np.inf)
    for _ in range(20):
        hope: Any = sorting.instance_of(core).bound().expected
        assert most <= hope.episode_return + EXACT
        seen.append(hope.episode_return)
    assert max(seen) > 1.5 * min(seen)


def test_a_platform_that_strays_holds_no_less_at_best_and_no_more_at_worst():
    core = crowded(0)
    there = core.state.queue[0, : core.state.queued[0]]
    exact, loose = (grips.chances_of(core, core.tables, 0, there, stray) for stray in ((0.0, 0.0), (1e-3, 1e-2)))
    known = [odds(core, report) for report in there.tolist()]
    assert exact.least == pytest.approx([each.holds for each in known], abs=1e-9)
    assert exact.right == pytest.approx([(1.0 - each.slips) * each.right for each in known], abs=1e-9)
    assert (exact.least == exact.most).all() and (loose.least < exact.least).all() and (loose.most > exact.most).all()
    assert (loose.right >= exact.right).all() and (loose.held >= exact.held).all()
    twice = grips.chances_of(core, core.tables, 0, there[[0, 1, 1]], (0.0, 0.0))
    assert (twice.least == [exact.least[0], 0.0, 0.0]).all() and (twice.most == exact.most[[0, 1, 1]]).all()


def test_orders_have_a_bound_in_expectation_where_reports_are_drawn():
    cases: Any = ({}, True), ({"backend": "pybullet", "perception": "model"}, True), ({"backend": "pybullet"}, False)
    for settings, drawn in cases:
        known: Any = bounds.instance("fieldgym/ProduceSorting-v0", 1, scenario="orders", **settings)
        assert (known.tries is not None) == drawn
