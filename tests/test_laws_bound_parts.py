"""The parts of bounds from both sides: against trying everything, on instances that are small enough for it."""

from collections.abc import Iterator
from itertools import combinations, permutations, product
from math import hypot, inf, isfinite, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment
from stopped import some_stops

from fieldgym.bounds import base, belt, shots, stops, timeline, transplanting
from fieldgym.bounds.transplanting import OPEN, SHUT, USELESS
from fieldgym.envs.sorting.config import SortingConfig
from fieldgym.envs.sorting.timing import Paces
from fieldgym.envs.transplanting import timing

EXACT = 1e-9

# Stops


def schedules(some: list[stops.Stop], worths: Any, budget_s: float) -> Iterator[tuple[float, float, bool, int, float]]:
    """Worth, seconds, whether the last stop is left, targets served and gain of every schedule."""

    def go(at: int, place: int, served: tuple[int, ...], time: float, worth: float, count: int, gain: float) -> Any:
        yield worth, time, at == len(some), count, gain
        if at == len(some) or time >= budget_s:
            return
        stop = some[at]
        for j, e in product(range(stop.targets), range(stop.gain.shape[1])):
            if j not in served:
                then = time + stop.approach_s[place, j] + stop.process_s[j, e]
                yield from go(
                    at, j + 1, (*served, j), then, worth + worths[at][j, e], count + 1, gain + stop.gain[j, e]
                )
        yield from go(at + 1, 0, (), time + stop.leave_s[place], worth, count, gain)

    yield from go(0, 0, (), 0.0, 0.0, 0, 0.0)


@pytest.mark.parametrize("second", [0.0, 0.2])
@pytest.mark.parametrize("budget_s", [1.0, 3.0, 50.0])
@pytest.mark.parametrize("seed", range(3))
def test_schedules_of_stops_are_bounded_and_met_where_time_is_long(seed, budget_s, second):
    some = some_stops(seed)
    worths = [stop.gain - 0.3 * seed for stop in some]
    every = list(schedules(some, worths, budget_s))
    ended = max(w - second * (t if left else max(t, budget_s)) for w, t, left, _, _ in every)
    anyhow = max(w - second * t for w, t, _, _, _ in every)
    bound, proven = stops.largest(some, worths, budget_s, second)
    free, also = stops.largest(some, worths, budget_s, second, reach_end=False)
    assert bound >= ended - EXACT and free >= anyhow - EXACT
    assert not proven or bound == pytest.approx(ended, abs=1e-9)
    assert not also or free == pytest.approx(anyhow, abs=1e-9)
    assert budget_s < 50.0 or (proven and also)


@pytest.mark.parametrize("already_s", [0.0, 1.5])
@pytest.mark.parametrize("share", [0.2, 0.7, 0.99])
@pytest.mark.parametrize("seed", range(3))
def test_no_schedule_with_as_much_has_a_shorter_cycle(seed, share, already_s):
    some = some_stops(seed)
    grams = share * sum(float(stop.gain.max(axis=1).sum()) for stop in some)
    cycles = [
        (already_s + time) / count
        for _, time, left, count, gain in schedules(some, [stop.gain for stop in some], inf)
        if count and gain >= grams and not left
    ]
    least = stops.shortest_cycle(some, grams, already_s)
    assert min(cycles) - 0.75 < least <= min(cycles) + EXACT
    assert stops.shortest_cycle(some, 5.0 * grams / share, already_s) == inf


# Belts


def stream_of(seed: int, n: int = 4) -> tuple[belt.Belt, belt.Stream]:
    config, rng = SortingConfig(), np.random.default_rng(seed)
    places = np.vstack([np.array(config.belt.bins_m), [[0.0, 0.0]]])
    last = rng.uniform(0.05, 0.25, n)
    speed = config.belt.speed_m_s
    passing = np.sort(rng.uniform(5.0, 6.5 + 0.4 * n, n)) - last / speed
    stream = belt.Stream(
        passing_s=passing,
        across_m=rng.uniform(-0.1, 0.1, n),
        first_m=-last - 0.05,
        last_m=last,
        hold_s=rng.uniform(0.5, 0.7, n),
        least_s=rng.uniform(0.1, 0.3, n),
        known_s=np.maximum(passing - (last + 0.05) / speed - 2.5, 0.0),
        bin=rng.integers(0, 4, n),
        gain=rng.uniform(0.3, 1.0, n),
        slack_m=0.0,
    )
    return belt.Belt(Paces.of(config), places, 60.0), stream


def finish_by_hand(line: belt.Belt, stream: belt.Stream, j: int, place: int, time_s: float) -> float:
    """Two rounds of each fixed point, on the quintic law."""
    paces, v = line.paces, line.paces.speed_m_s

    def motion(along: float, across: float) -> float:
        way = max(hypot(along, across) - stream.slack_m, 0.0)
        return max(way * paces.pace, sqrt(way * paces.square_pace), float(stream.least_s[j]))

    begin = max(time_s, float(stream.known_s[j]))
    now, (x, y) = (begin - float(stream.passing_s[j])) * v, line.places[place]
    approach = float(stream.least_s[j]) + 0.15
    for _ in range(2):
        ahead = max(now + v * approach, float(stream.first_m[j])) - x
        approach = motion(ahead - 0.5 * v * approach, float(stream.across_m[j]) - y)
    meet = max(now + v * approach, float(stream.first_m[j]))
    if meet > stream.last_m[j] or begin >= line.limit_s:
        return inf
    bin_x, bin_y = line.places[int(stream.bin[j])]
    aside, way = bin_y - float(stream.across_m[j]), bin_x - meet - v * float(stream.hold_s[j])
    carry = max(
        hypot(bin_x, aside) * paces.pace, sqrt(hypot(bin_x, aside) * paces.square_pace), float(stream.least_s[j])
    )
    for _ in range(2):
        carry = motion(way - 0.5 * v * carry, aside)
    reached = begin + max((meet - now) / v, approach)
    return reached + float(stream.hold_s[j]) + carry + paces.release_s


@pytest.mark.parametrize("slack_m", [0.0, 0.02])
def test_a_pick_is_finished_when_its_legs_are(slack_m):
    some = 0
    for seed in range(4):
        line, stream = stream_of(seed)
        stream = stream._replace(slack_m=slack_m)
        for j, place, time_s in product(range(4), range(5), (0.0, 2.0, 3.1, 4.4, 5.5, 59.99, 60.0)):
            by_hand = finish_by_hand(line, stream, j, place, time_s)
            assert belt.finish_s(line, stream, j, place, time_s) == pytest.approx(by_hand, abs=1e-9)
            some += isfinite(by_hand)
        assert belt.finish_s(line._replace(limit_s=3.1), stream, 0, 4, 3.1) == inf
    assert some > 60


@pytest.mark.parametrize("seed", range(6))
def test_the_best_picks_are_those_of_all_orders(seed):
    line, stream = stream_of(seed, 5)
    best, earliest = 0.0, [0.0] + [inf] * 5
    for count in range(1, 6):
        for order in permutations(range(5), count):
            place, now = 4, 0.0
            for j in order:
                now = belt.finish_s(line, stream, j, place, now)
                place = int(stream.bin[j])
            if now < inf:
                best, earliest[count] = max(best, sum(stream.gain[j] for j in order)), min(earliest[count], now)
    value, _, order, proven = belt.best_picks(line, stream, 5000)
    assert proven and value == pytest.approx(best) and value == pytest.approx(sum(stream.gain[j] for j in order))
    one = stream._replace(gain=np.ones(5))
    _, found, _, proven = belt.best_picks(line, one, 5000)
    assert proven and found == pytest.approx(earliest)
    _, _, _, proven = belt.best_picks(line, stream, 2)
    assert not proven
    # In time that is cut to grains no schedule is lost, and few are won.
    first, to, option, wait, end_s, start = belt.expand(line, stream, 0.01)
    graph = timeline.Timeline(first, to, option, wait, end_s, start, np.arange(6), np.arange(5), np.ones(5))
    priced = timeline.priced(graph, stream.gain, np.zeros(5), np.zeros(len(end_s)), np.ones(5))
    assert best - EXACT <= priced.bound <= best + 0.35
    late = belt.decided_late(line, stream)
    assert (late.known_s >= stream.known_s).all() and (late.known_s > stream.known_s).any()
    assert belt.best_picks(line, late, 5000)[0] == pytest.approx(best)


# Timelines


def some_graph(seed: int) -> tuple[timeline.Timeline, np.ndarray, np.ndarray, np.ndarray]:
    """Nodes in two states at eight ticks; edges forward in time, a thing each or two halves of one."""
    rng, ticks = np.random.default_rng(seed), 8
    first, to, option, wait, end_s = [0], [], [], [], []
    for node in range(2 * ticks):
        tick = ticks - 1 - node // 2
        wait.append(node - 2 if tick < ticks - 1 else node)
        end_s.append(float(tick))
        for other in range(4):
            then = tick + int(rng.integers(2, 5))
            if then < ticks and rng.random() < 0.6:
                to.append((ticks - 1 - then) * 2 + int(rng.integers(2)))
                option.append(other)
        first.append(len(to))
    graph = timeline.Timeline(
        np.array(first),
        np.array(to, np.int32),
        np.array(option, np.int32),
        np.array(wait),
        np.array(end_s),
        2 * ticks - 1,
        np.array([0, 1, 2, 3, 5]),
        np.array([0, 1, 2, 0, 2]),
        np.array([1.0, 1.0, 1.0, 0.5, 0.5]),
    )
    return graph, rng.random(3) + 0.2, 0.2 * rng.random(4), -0.05 * np.array(end_s)


def walks(graph: timeline.Timeline) -> Iterator[tuple[list[int], int]]:
    def go(node: int, options: list[int]) -> Any:
        yield options, node
        if graph.wait[node] != node:
            yield from go(int(graph.wait[node]), options)
        for e in range(graph.first[node], graph.first[node + 1]):
            yield from go(int(graph.to[e]), [*options, int(graph.option[e])])

    yield from go(graph.start, [])


@pytest.mark.parametrize("seed", range(4))
def test_paths_in_time_are_the_longest_and_prices_bound_what_counts_once(seed):
    graph, gain, cost, end = some_graph(seed)
    every, prices = list(walks(graph)), np.array([0.3, 0.1, 0.4])
    weight, nodes = np.empty(4), len(end)
    timeline.option_weights(graph, prices, cost, weight)
    shares = [(0,), (1,), (2,), (0, 2)]
    by_hand = [sum(prices[list(things)]) * (0.5 if len(things) == 2 else 1.0) for things in shares]
    assert weight == pytest.approx(np.array(by_hand) - cost)
    best, way, taken = np.empty(nodes), np.empty(nodes, np.int64), np.empty(nodes, np.int64)
    value = timeline.longest_path(graph, weight, end, best, way)
    count, last = timeline.follow(graph, way, taken)
    assert value == pytest.approx(max(sum(weight[o] for o in options) + end[node] for options, node in every))
    assert value == pytest.approx(sum(weight[o] for o in taken[:count]) + end[last])

    def worth(options: list[int], node: int) -> float:
        served = np.zeros(3)
        for o in options:
            served[list(shares[o])] += 0.5 if o == 3 else 1.0
        return float(gain[served >= 1.0 - 1e-9].sum() - cost[options].sum() + end[node])

    most = max(worth(options, node) for options, node in every)
    found = timeline.priced(graph, gain, cost, end, np.ones(3), rounds=300)
    assert found.found <= most + EXACT and most - EXACT <= found.bound <= most + 0.25
    assert found.found >= most - 0.25
    told = timeline.priced(graph, gain, cost, end, np.ones(3), found=most, rounds=300, begin=found.prices)
    assert told.found >= most - EXACT and most - EXACT <= told.bound <= found.bound + 1e-6
    assert timeline.priced(graph, gain, cost, end, np.ones(3), rounds=0).bound >= found.bound - EXACT


# Trays


def test_the_cheapest_out_of_rows_that_are_reached_in_turn():
    rng = np.random.default_rng(2)
    for again, last in product((inf, 0.6), (False, True)):
        rows = [rng.random(size) for size in (2, 3, 1)]
        reach = np.array([0.0, 0.2, 0.5])
        own = [row * 0.5 for row in rows] if last else None
        found = transplanting.cheapest(rows, reach, 5, again, own)
        for count in range(6):
            prices = []
            for here in range(3):
                some = [*np.concatenate([*rows[:here], (own or rows)[here]]), *([again] * 6)]
                prices += [reach[here] + sum(chosen) for chosen in combinations(sorted(some)[:count], count)]
            assert found[count] == pytest.approx(min(prices, default=inf)), (again, last, count)


def test_prices_of_rows_and_columns_are_the_dual_of_their_transport():
    rng = np.random.default_rng(3)
    for _ in range(5):
        cost = rng.random((3, 4))
        rows, columns = transplanting.dual_prices(cost, np.ones(3), np.ones(4))
        assert (rows[:, None] + columns <= cost + 1e-12).all()
        # Each of the columns is held by a row: none could be higher.
        assert (cost - rows[:, None] - columns).min(axis=0) == pytest.approx(0.0, abs=1e-9)
        tripled = np.repeat(np.repeat(cost, 4, axis=0), 3, axis=1)
        least = tripled[linear_sum_assignment(tripled)].sum() / 12.0
        assert rows.mean() + columns.mean() == pytest.approx(least, abs=1e-3)


def test_a_seedling_that_is_carried_for_nothing_may_be_a_short_cut():
    """Shares of the only plug and the only cell: what the shortest round from the one back to the other takes."""
    approach, carry = np.full((2, 9, 2, 2), 20.0), np.full((3, 2, 2), 5.0)
    table = timing.Times(
        approach=np.repeat(approach.reshape(2, 9, 4, 1), 2, axis=-1),
        carry=np.repeat(carry.reshape(3, 4, 1), 2, axis=-1),
        rise=np.zeros((9, 2)),
        row_s=np.zeros((2, 2)),
        **dict.fromkeys(("grip_s", "release_s", "handle_s", "illegal_s"), 0.0),
        turn_s=np.zeros(2),
    )
    where = timing.Places(np.arange(9.0), np.repeat([0.0, 0.1], (4, 5)))

    def round_s() -> float:
        plugs, cells = np.array([[USELESS, 2]]), np.array([[OPEN, SHUT]])
        found = transplanting.shares(where, table, plugs, cells)
        return float(found.plug_s[2, 1] + found.cell_s[0])

    assert round_s() == pytest.approx(20.0 + 5.0, abs=1e-6)
    # From the target cell to the other source cell, with its seedling to the other target cell, back from there.
    table.approach[timing.STRAIGHT, 2, :2], table.approach[timing.STRAIGHT, 3, 2:] = 1.0, 2.0
    table.carry[:, 1] = 4.0
    assert round_s() == pytest.approx(1.0 + 4.0 + 2.0 + 5.0, abs=1e-6)


# Shots


def test_modes_that_another_beats_in_everything_are_left_out():
    def option(stand_s: float, cost: float, *weeds: int) -> Any:
        return shots.Option(np.zeros(2), np.zeros(2), 0.0, stand_s, cost, 0.0, dict.fromkeys(weeds, 1.0))

    quick, dear, both, slow, nothing = (
        option(0.2, 0.1, 1),
        option(0.3, 0.2, 1),
        option(0.4, 0.3, 1, 2),
        option(0.5, 0.05, 1),
        option(0.1, 0.0),
    )
    assert shots.undominated([slow, both, nothing, dear, quick]) == [quick, both, slow]


def test_the_least_of_shares():
    nothing = np.zeros(3)
    found = shots.Shots(
        told_m=np.zeros((3, 2)),
        aim_m=np.zeros((3, 2)),
        slack_m=nothing,
        stand_s=nothing,
        cost=nothing,
        share_first=np.array([0, 2, 3, 5]),
        share_weed=np.array([0, 1, 1, 0, 2]),
        share=np.array([1.0, 1.0, 0.5, 1.0, 1.0]),
        weeds=3,
        worth=np.ones(3),
        energy_j=nothing,
        whole=np.array([True, True, False]),
        advance=np.array([0.5, 0.0, 0.0]),
        track=np.arange(3),
        mode=np.arange(3),
    )
    assert found.brought().tolist() == [1.5, 0.5, 2.0]
    assert found._replace(cost=np.ones(3)).due(2.0).tolist() == [2.0, 1.0, -1.0]
    assert found.option_of_share().tolist() == [0, 0, 1, 2, 2]
    assert found.least(np.array([5.0, 4.0, 3.0, 2.0, 1.0])).tolist() == [2.0, 3.0, 1.0]
    assert found.least_split(np.array([6.0, 1.0, 8.0])).tolist() == [3.0, 2.0, 4.0]


def test_gaps_and_names():
    assert base.relative_gap(2.0, 1.5) == 0.25 and base.relative_gap(-2.0, -3.0) == 0.5
    assert base.relative_gap(1.0, 1.0 - 1e-10) == 0.0 and base.relative_gap(0.0, -1e-3) > 1.0
