"""Bounds of ordered trays: every path obeys the linear program, no policy's mean over luck and grades is above it.

And what plans that know the luck got: no more than the best of all decisions, and what the environment pays for them.
"""

from dataclasses import replace
from itertools import product
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym import bounds
from fieldgym.agents import make_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.bounds import nursery, tray_plans
from fieldgym.bounds.lorries import Program, changes
from fieldgym.bounds.orders import OrderInstance, instance_of
from fieldgym.envs.transplanting.columns import (
    NEXT_SOURCE,
    NEXT_TARGET,
    TURN_SOURCES,
    TURN_TARGETS,
    E,
    H,
    L,
    P,
    R,
    T,
    W,
)
from fieldgym.envs.transplanting.config import (
    DAMAGED,
    EMPTY,
    HEALTHY,
    ORDERS,
    POOR,
    OrderBook,
    PerceptionModel,
    RewardWeights,
    TransplantingConfig,
    Tray,
)
from fieldgym.envs.transplanting.core import TransplantingCore
from fieldgym.envs.transplanting.field import draw

EXACT, SOLVED = 1e-9, 1e-6
SPEEDS = 3
IDENTITY = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
EYES = PerceptionModel(((0.80, 0.10, 0.10), (0.05, 0.85, 0.10), (0.05, 0.30, 0.65)), IDENTITY)
MOVES = nursery.PLANT, NEXT_TARGET, TURN_TARGETS, NEXT_SOURCE, TURN_SOURCES
SOURCES, ORDER, SOURCE_ROW, ANOTHER = range(4)
"""The actions behind the pairs: the next tray of either carousel, the next row of either tray or the next tray."""


def ordered(seed: int, book: OrderBook, weights: RewardWeights, **shape: Any) -> TransplantingCore:
    """Ordered trays of these shapes, drawn; a fifth of all plugs tears, and cameras err."""
    scenario = replace(ORDERS["orders"], vacancy=0.1, orders=book, **shape)
    process = replace(TransplantingConfig().process, extraction=0.8)
    config = TransplantingConfig(scenario=scenario, process=process, weights=weights)
    core = TransplantingCore(config, EYES, 1)
    core.load(np.array([0]), core.stack([draw(config, np.random.default_rng(seed))]))
    return core


def thorough(core: TransplantingCore, legal: Any, idle: int) -> int:
    """Whatever fits from every waiting row, then another order; no row is left before all of it was tried."""
    state, order, pairs = core.state, int(core.state.target_row[0]) // core.target_trays[1], core.action_space.n - 4
    told, want = state.source_reports[0, state.source_row[0]], state.grade[0, order]
    fits = legal[told[legal // SPEEDS // core.target_shape[1]] == want]
    if len(fits):
        return int(fits[-1])
    if not told.any() and core.observe()["action_mask"][0, pairs + SOURCE_ROW]:
        return pairs + SOURCE_ROW
    if (state.target_reports[0, state.target_row[0]] == want).all():
        return pairs + ANOTHER
    return pairs + (SOURCES if idle < core.source_trays[0] else ORDER)


def walked(core: TransplantingCore, seed: int) -> tuple[Program, Any, float]:
    """A path at random, in the variables of its linear program, and what it returned."""
    state, instance, rng = core.state, instance_of(core), np.random.default_rng(seed)
    assert isinstance(instance, OrderInstance)
    program = Program(instance.bench, instance.tries)
    tries = program.tries
    (rows, _), m, trays = core.source_shape, core.target_shape[1], len(state.due_s[0])
    chances, luck, pairs = core.terms.chances, state.luck[0, :rows], core.action_space.n - 4
    whole = (luck[..., L.extract, None] < 0.8) & (luck[..., L.lose, None] >= chances[:, H.lose])
    whole = (whole & (luck[..., L.damage, None] >= chances[:, H.damage])).any(axis=-1)
    useful = whole & (state.source_cells[0, :rows] != EMPTY) & (state.source_reports[0, :rows] != EMPTY)
    plug = np.cumsum(useful.ravel()).reshape(useful.shape) - 1
    assert np.argwhere(useful)[:, 0].tolist() == tries.row.tolist()
    when = zip(tries.plug.tolist(), tries.order.tolist(), program.period.tolist(), strict=True)
    option = {each: i for i, each in enumerate(when)}
    due_s, grade = state.due_s[0], state.grade[0]
    values, returned, over, idle = np.zeros(len(program.upper)), 0.0, False, 0
    touched: set[tuple[int, int, int]] = set()
    values[program.shown[:, 0]] = 1.0
    while not over:
        row, target_row = int(state.source_row[0]), int(state.target_row[0])
        order, totals = target_row // core.target_trays[1], state.totals[0].copy()
        mask = core.observe()["action_mask"][0]
        legal = np.flatnonzero(mask[:pairs])
        if seed % 2:
            action = thorough(core, legal, idle)
        else:
            action = int(rng.choice(legal)) if len(legal) and rng.random() < 0.6 else pairs + int(rng.integers(4))
        idle = 0 if action < pairs else idle + 1
        plan = core.plan(np.array([action]))
        result = core.apply(plan, core.nominal(plan))
        returned, over = returned + float(result.rewards.sum()), bool(result.terminated[0])
        # Tried in vain is wasted too.
        values[program.wasted[row]] += result.rewards[0, R.spoiled] / core.config.weights.spoiled
        time_s, move = state.totals[0, T.time], action - pairs if mask[action] else -1
        by = np.flatnonzero(time_s <= due_s[program.leaves])
        now = int(state.target_row[0]) // core.target_trays[1]
        if move in (ORDER, ANOTHER) and (now != order or over):
            values[program.turned[by, E.target]] += (now - order) % trays
            values[program.changed[by]] += not over and grade[now] != grade[order]
        elif move == ANOTHER:
            values[program.behind[order]] += time_s <= due_s[order]
        elif move == SOURCES:
            values[program.turned[by, E.source]] += 1
            values[program.shown[by, int(state.source_row[0])]] = 1.0
        elif move == SOURCE_ROW:
            values[program.shown[by, row + 1]] = 1.0
        elif move < 0 and action < pairs:
            values[program.begun[by]] = 1.0
            values[program.cleared[order]] += plan.clears[0] and time_s <= due_s[order]
            values[program.kept[order]] += state.totals[0, T.healthy] - totals[T.healthy]
            if state.totals[0, T.done] > totals[T.done]:
                source, cell = divmod(int(plan.pair[0]), m)
                chosen = option[int(plug[row, source]), order, int(by[0])]
                values[program.tried[chosen]] = 1.0
                values[program.kept[order]] -= tries.closes[chosen]
                values[program.by_grade[by, int(grade[order] == POOR), row]] = 1.0
                touched.add((order, target_row, cell))
    for order, _, cell in touched:
        values[program.touched[order, cell]] += 1.0
        values[program.served[order]] = 1.0
    values[program.both] = values[program.by_grade].prod(axis=1)
    values[program.seconds] = min(state.totals[0, T.time], due_s.max())
    return program, values, returned


def test_every_path_obeys_the_program_and_returns_no_more_than_it_counts():
    needed = np.zeros(3, int)
    trays = {"source": Tray(3, 4, 0.05), "target": Tray(2, 3, 0.07, 0.500, 0.260)}
    for seed in range(24):
        count, weights = 2 + seed // 2 % 2, RewardWeights(1.3, -0.4, -0.15)
        book = OrderBook(9.0, 3.0, 0.5, (0.2, 0.5, 0.8), source_turn_s=0.3, target_turn_s=0.2)
        core = ordered(seed, book, weights, **trays, source_trays=count, target_trays=count + 1)
        program, values, returned = walked(core, seed)
        assert (program.matrix @ values <= program.limit + EXACT).all() and (values <= program.upper + EXACT).all()
        gained = -float(program._gains() @ values)
        assert gained == core.state.totals[0, T.healthy]
        counted = weights.planted * gained + weights.spoiled * values[program.wasted].sum()
        assert returned <= counted + weights.seconds * float(values[program.seconds[0]]) + EXACT
        changed, turned = values[program.changed[-1]], values[program.turned[-1]]
        needed += (
            values[program.both[-1]].sum() > changed,
            turned[E.target] < 2 * changed,
            values[program.kept].sum() > 0,
        )
    # Neither is a change enough for every row, nor a turn back a change; and what does not close its cell counts.
    assert (needed > 0).all()


@pytest.mark.parametrize("orders", range(2, 7))
def test_a_way_round_the_carousel_meets_no_more_changes_than_their_pace_allows(orders):
    for grade in map(np.array, product((HEALTHY, POOR), repeat=orders)):
        a_round, ahead = changes(grade)
        way = grade[np.arange(4 * orders + 1) % orders]
        met = np.concatenate([[0], np.cumsum(way[1:] != way[:-1])])
        pace = met - a_round / orders * np.arange(len(way))
        assert pace.max() == pytest.approx(ahead)


def test_a_try_takes_its_share_on_average_whether_it_grips_or_not():
    shape = {"source": Tray(1, 1, 0.05), "source_trays": 1, "target": Tray(1, 1, 0.07), "target_trays": 1}
    core = ordered(1, OrderBook(9.0, 0.0, 0.0, (0.3, 0.0, 0.0)), RewardWeights(), **shape)
    instance = instance_of(core)
    assert isinstance(instance, OrderInstance)
    bench, tries = instance.hoped
    assert tries.plug.tolist() == [0] * SPEEDS and core.state.source_cells.all(axis=-1)[0, 0]
    grips = 0.8 * right(core)[0, 0, HEALTHY:].sum()
    for speed in range(SPEEDS):
        took_s = []
        for luck in (0.0, 1.0):
            core.state.luck[0, 0, 0, L.extract] = luck
            took_s.append(core.plan(np.array([speed])).phases_s[0])
        # From over the chute; an attempt that misses is charged no way.
        mean_s = grips * (took_s[0].sum() - bench.shares.once_s) + (1.0 - grips) * (
            took_s[1].sum() - took_s[1][P.travel]
        )
        assert tries.try_s[speed] == pytest.approx(mean_s)


def right(core: TransplantingCore) -> Any:
    """Chances (rows, n, 3) of what source cells hold, counted from what is sown and how it is reported."""
    work, told = core.config.scenario, core.state.source_reports[0, :-1]
    found = np.zeros((*told.shape, 3))
    for (row, column), report in np.ndenumerate(told):
        second = work.orders.supply[row // core.source_trays[1]]
        sown = work.vacancy, (1.0 - work.vacancy) * (1.0 - second), (1.0 - work.vacancy) * second
        found[row, column] = [share * EYES.source[holds][report] for holds, share in enumerate(sown)]
    return found / found.sum(axis=-1, keepdims=True)


class Trying:
    """Every decision and whatever comes of it, by its chance: the best mean that any policy can have."""

    def __init__(self, core: TransplantingCore):
        self.core, self.state, self.right = core, core.state, right(core)
        self.pairs, self.known = core.action_space.n - 4, dict[bytes, float]()
        # Nobody knows what stands in a cell; what was tried is gone.
        core.state.source_cells[0, :-1] = DAMAGED

    def best(self, last: int = -1) -> float:
        """From where the rules stand."""
        here = self.state._replace(**{name: values.copy() for name, values in self.state._asdict().items()})
        cells = here.source_cells, here.target_cells, here.source_reports, here.target_reports
        places = here.source_row, here.target_row, here.place, here.source_at, here.target_at
        key = b"".join(values.tobytes() for values in (*cells, *places, here.totals[:, T.time].round(9)))
        if key not in self.known:
            legal = np.flatnonzero(self.core.observe()["action_mask"][0]).tolist()
            # Of two trays: to turn back at once, or in the other sequence, is nothing new.
            after = {SOURCES: (SOURCES, ORDER), ORDER: (ORDER,)}.get(last, ())
            self.known[key] = max(self.worth(here, action) for action in legal if action - self.pairs not in after)
            self.back(here)
        return self.known[key]

    def worth(self, here: Any, action: int) -> float:
        """Mean of what a decision brings, and all that follow."""
        row, move, mean = int(here.source_row[0]), action - self.pairs, 0.0
        if move >= 0:
            self.back(here)
            left = self.right[row][here.source_cells[0, row] == DAMAGED][:, HEALTHY:].sum()
            spoiled = self.core.config.weights.spoiled * left if move == SOURCE_ROW else 0.0
            return float(spoiled) + self.step(action, move)
        column, (lose, hurt) = action // SPEEDS // self.core.target_shape[1], self.core.terms.chances[action % SPEEDS]
        torn, lost = (0.2, 1.0, 1.0, 1.0), (0.8 * lose, 0.0, 0.0, 1.0)
        harmed, whole = ((0.8 * (1.0 - lose) * odds, 0.0, 1.0, luck) for odds, luck in ((hurt, 0.0), (1.0 - hurt, 1.0)))
        for content, chance in enumerate(self.right[row, column]):
            for odds, *luck in (torn, lost, harmed, whole) if content != EMPTY else ((1.0, 1.0, 1.0, 1.0),):
                self.back(here)
                self.state.source_cells[0, row, column], self.state.luck[0, row, column] = content, luck
                mean += float(chance * odds) * self.step(action, -1)
        return mean

    def step(self, action: int, last: int) -> float:
        """What a decision brings and what follows."""
        plan = self.core.plan(np.array([action]))
        result = self.core.apply(plan, self.core.nominal(plan))
        over = result.terminated[0] or result.truncated[0]
        return float(result.rewards.sum()) + (0.0 if over else self.best(last))

    def back(self, here: Any) -> None:
        """Put the rules back to where they stood."""
        for values, was in zip(self.state, here, strict=True):
            values[...] = was


TOYS = (
    (3.0, {"source": Tray(1, 1, 0.05), "source_trays": 2, "target": Tray(1, 1, 0.07), "target_trays": 1}),
    (2.2, {"source": Tray(2, 2, 0.05), "source_trays": 1, "target": Tray(1, 1, 0.07), "target_trays": 1}),
    (1.3, {"source": Tray(1, 1, 0.05), "source_trays": 2, "target": Tray(1, 1, 0.07), "target_trays": 2}),
    (1.5, {"source": Tray(1, 2, 0.05), "source_trays": 1, "target": Tray(1, 1, 0.07), "target_trays": 2}),
)
"""Seconds between lorries, trays of both sides."""


def test_no_mean_over_luck_and_grades_is_above_the_bound():
    touched = np.zeros(2, int)
    for every_s, shape in TOYS:
        for seed in range(3):
            book = OrderBook(every_s, 0.0, 0.5, (0.3, 0.7, 0.0), source_turn_s=0.6, target_turn_s=0.5)
            for aim, weights in enumerate((RewardWeights(), RewardWeights(1.0, 0.0, 0.0))):
                core = ordered(seed, book, weights, **shape)
                bound = instance_of(core).bound().expected
                assert bound is not None and not bound.estimated
                # That the tool rises at last and the tray is sent away is left out of the bound.
                rest_s = float(core.times.rise[:, W.s].max() + core.times.turn_s[E.target])
                most = Trying(core).best()
                assert most <= bound.episode_return + SOLVED
                if aim:
                    cells = core.target_shape[0] * core.target_shape[1]
                    assert bound.episode_return == pytest.approx(cells * bound.net_rate)
                touched[aim] += bound.episode_return - most + weights.seconds * rest_s <= 0.05
    assert touched.tolist() == [9, 6]


class Knowing(Trying):
    """Every decision, all luck known."""

    def __init__(self, core: TransplantingCore):
        self.core, self.state, self.pairs = core, core.state, core.action_space.n - 4
        self.known = dict[bytes, float]()

    def worth(self, here: Any, action: int) -> float:
        """See ``Trying``."""
        self.back(here)
        return self.step(action, action - self.pairs)


WIDER = 2.0, {"source": Tray(2, 2, 0.05), "source_trays": 2, "target": Tray(1, 2, 0.07), "target_trays": 2}


def test_what_was_found_is_had_by_the_best_of_all_decisions():
    for (every_s, shape), seeds in (*((toy, range(3)) for toy in TOYS), (WIDER, range(2))):
        for seed, weights in product(seeds, (RewardWeights(), RewardWeights(1.0, 0.0, 0.0))):
            book = OrderBook(every_s, 0.0, 0.5, (0.3, 0.7, 0.0), source_turn_s=0.6, target_turn_s=0.5)
            core = ordered(seed, book, weights, **shape)
            bound = instance_of(core).bound()
            most = Knowing(core).best()
            assert bound.found is not None and bound.found.net_rate <= bound.net_rate
            assert bound.found.episode_return == pytest.approx(most, abs=EXACT)
            assert most <= bound.episode_return + SOLVED


def test_moves_do_and_bring_what_the_rules_say():
    trays = {"source": Tray(3, 4, 0.05), "target": Tray(2, 3, 0.07, 0.500, 0.260), "source_trays": 3}
    counts: Any = dict.fromkeys(MOVES, 0)
    for seed in range(12):
        book = OrderBook(4.0, 3.0, 0.5, (0.2, 0.5, 0.8), source_turn_s=0.3, target_turn_s=0.2)
        instance: Any = instance_of(ordered(seed, book, RewardWeights(1.3, -0.4, -0.15), **trays, target_trays=4))
        core, known = instance.core
        state, now_s, brought, returned, over = nursery.start(known), 0.0, 0.0, 0.0, False
        rng, pairs = np.random.default_rng(seed), np.zeros(4, np.int64)
        while not over:
            then, move = state.copy(), int(rng.choice(MOVES))
            then_s, more, count = nursery.moved(known, then, now_s, move, pairs)
            if count < 0:
                # What is only as good in another sequence may be done here.
                state[[nursery.IDLE, nursery.TURNED]] = 0
                continue
            state, now_s, brought, counts[move] = then, then_s, brought + more, counts[move] + 1
            for action in pairs[:count].tolist() if move == nursery.PLANT else [core.action_space.n + move]:
                plan = core.plan(np.array([action]))
                result = core.apply(plan, core.nominal(plan))
                returned, over = returned + float(result.rewards.sum()), bool(result.terminated[0])
            rules = core.state
            assert now_s == pytest.approx(rules.totals[0, T.time]) and brought == pytest.approx(returned)
            assert over == nursery.all_gone(known, state, now_s)
            if not over:
                row, target_row = rules.source_row[0], rules.target_row[0]
                assert (state[nursery.TRAY], state[nursery.ORDER]) == (row // 3, target_row // 2)
                assert state[nursery.PLACE] == rules.place[0]
                bits = int(state[nursery.FIRST + 3 + row // 3])
                there = (known.speed[row] >= 0) & (rules.source_cells[0, row] != EMPTY)
                assert [bits >> i & 1 for i in range(4)] == there.astype(int).tolist()
        assert core.state.totals[0, T.illegal] == 0.0
    assert min(counts.values()) > 20


ID = "fieldgym/TrayTransplanting-v0"


@pytest.mark.slow
@pytest.mark.long
def test_the_environment_pays_what_was_found():
    env, paid, rates = gym.make(ID, scenario="orders", backend="analytic"), [], []
    env.reset(seed=1)
    known: Any = bounds.instance(ID, 1, scenario="orders")
    for actions in tray_plans.planned(known.core[0].action_space.n, known.core[1]):
        env.reset(seed=1)
        over, total, step, info = False, 0.0, 0, {}
        while not over:
            action = int(actions[step]) if step < len(actions) else known.core[0].action_space.n - 1
            _, reward, terminated, truncated, info = env.step(action)
            over, total, step = terminated or truncated, total + float(reward), step + 1
        assert step >= len(actions) and info["scorecard"]["illegal"] == 0.0
        paid.append(total)
        rates.append(info["scorecard"]["net_rate"])
    bound = known.bound()
    assert bound.found.episode_return == pytest.approx(max(paid)) and bound.found.net_rate == max(rates)
    assert bound.found.episode_return < bound.episode_return and bound.found.net_rate < bound.net_rate
    alone: Any = bounds.instance(ID, 1, scenario="orders", carried_out=False).bound()
    assert alone.found is None and (alone.net_rate, alone.expected) == (bound.net_rate, bound.expected)
    scores = evaluate(lambda env: make_policy("receding-horizon", env), ID, [1], scenario="orders")
    # Who knows the luck gets far more.
    assert scores.returns[0] + 10.0 < max(paid) and scores.scorecard["net_rate"][0] < max(rates)
