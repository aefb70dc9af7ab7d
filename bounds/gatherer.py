"""Picks of heads that wilt into a bag that fills up, by who knows everything, carried out by the rules themselves.

A route is a sequence of heads at each stop, each with an effort, and whether the bag is emptied before it. Routes are
changed at random, at one place at a time; what is better is kept, and what is a little worse, which is less and less
(threshold accepting; Dueck and Scheuer 1990). What the rules say of the best routes is what can be had.
"""

from __future__ import annotations

import copy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.safflower.process import Shears, collected_share, cut_share, dropped_share
from ..envs.safflower.rules import EMPTYING
from ..envs.safflower.state import T
from ..envs.safflower.timing import DRIVE
from ..kernels import compiled
from .stops import Stop

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

TRIES, CHANGES = 6, 100_000
"""Routes that are sought for the return, and changes of each."""
WARM = 0.1
"""How much worse may be taken at first, in worths of a gram [chosen on seeds 1000000 and 1000001]."""
_EMPTIED, _DRIVEN = -1, -2


class Row(NamedTuple):
    """What a search works on: S stops, n heads of all of them, E efforts.

    Attributes:
        first: (S + 1,), first head of each stop.
        slot: (n,), which of its stop's reports stands for a head.
        slots: reports that are shown at once.
        cut_g: (n, E), grams that each effort cuts.
        mass_g: (n,), grams on a head.
        odds: (n,), what luck multiplies the odds of collecting it with.
        closes_s: (n,), when it wilts.
        process_s: (n, E), seconds at a head.
        approach_s: (S, most + 1, most), from the stop's beginning or a head to a head.
        leave_s: (S, most + 1), to the next stop.
        dropped: (E,), share of what is cut that drops with an empty bag.
        bag_g: what fills the bag; infinite for one that nothing fills.
        clog: see ``Bag``.
        empty_s: seconds of emptying it.
        begin_s: when the first decision begins.
        limit_s: no decision begins then.
        gram: worth of a gram.
        loss: cost of a gram that a pick leaves or drops.
        second: cost of a second.
    """

    first: Numbers
    slot: Numbers
    slots: int
    cut_g: Array
    mass_g: Array
    odds: Array
    closes_s: Array
    process_s: Array
    approach_s: Array
    leave_s: Array
    dropped: Array
    bag_g: float
    clog: float
    empty_s: float
    begin_s: float
    limit_s: float
    gram: float
    loss: float
    second: float


class Route(NamedTuple):
    """A way along the row; the heads of a stop lie between ``Row.first`` of it and of the next one.

    Attributes:
        order: (n,), heads of every stop, those that are picked in front.
        picked: (S,), how many those are.
        effort: (n,), by head.
        emptied: (n,), whether the bag is emptied before it, by head.
    """

    order: Numbers
    picked: Numbers
    effort: Numbers
    emptied: NDArray[np.bool_]


def row_of(core: Any, world: int, stops: list[Stop], heads: list[Numbers], tracks: list[Numbers]) -> Row:
    """What stands in a world of the rules right after its reset.

    Args:
        core: the rules.
        world: which one.
        stops: what each stop offers by the reports that were drawn.
        heads: (n,) a stop, the heads behind that.
        tracks: (n,) a stop, the reports of these.
    """
    state, config, counts = core.state, core.config, [stop.targets for stop in stops]
    process, scenario, weights, most = config.process, config.scenario, config.weights, max([1, *counts])
    head, track, shears = np.concatenate(heads), np.concatenate(tracks), Shears.of(process)
    error, mass = state.head_position[world, head] - state.track_target[world, track], state.head_mass_g[world, head]
    odds, cut = state.head_odds[world, head], np.empty((len(head), len(process.strokes)))
    for i, (along, across, up) in enumerate(error):
        for effort, strokes in enumerate(process.strokes):
            cut[i, effort] = mass[i] * cut_share(shears, float(strokes), along, across, up, odds[i, 0])
    approach, leave = np.zeros((len(stops), most + 1, most)), np.zeros((len(stops), most + 1))
    for number, stop in enumerate(stops):
        approach[number, : stop.targets + 1, : stop.targets] = stop.approach_s
        leave[number, : stop.targets + 1] = stop.leave_s
    bag = scenario.bag
    return Row(
        first=np.concatenate([[0], np.cumsum(counts)]),
        slot=track - np.repeat(state.first[world, : len(stops)], counts),
        slots=int(config.slots),
        cut_g=cut,
        mass_g=mass,
        odds=odds[:, 1].copy(),
        closes_s=state.head_closes_s[world, head],
        process_s=np.concatenate([stop.process_s for stop in stops]),
        approach_s=approach,
        leave_s=leave,
        dropped=np.array([dropped_share(process, seconds) for seconds in process.suction_s]),
        bag_g=float(bag.capacity_g) if bag.capacity_g > 0.0 else np.inf,
        clog=float(bag.clog),
        empty_s=float(bag.empty_s),
        begin_s=float(process.recognise_s),
        limit_s=float(scenario.time_limit_s),
        gram=float(weights.collected_g),
        loss=-float(weights.lost_g),
        second=-float(weights.seconds),
    )


@compiled
def walked(row: Row, route: Route, decisions: Numbers) -> tuple[float, int]:
    """What a route is worth, and how many ``decisions`` it takes.

    These are heads times the efforts and the effort, -1 where the bag is emptied, -2 where the machine drives on. A
    head that has wilted, or is not shown yet, is left out.
    """
    stops, efforts, count = len(row.first) - 1, row.cut_g.shape[1], 0
    now_s, bag_g, worth = row.begin_s, 0.0, 0.0
    for stop in range(stops):
        begin, place, picks = row.first[stop], 0, 0
        for i in range(route.picked[stop]):
            head = int(route.order[begin + i])
            effort, to = int(route.effort[head]), head - begin
            empties = bag_g > 0.0 and (route.emptied[head] or bag_g >= row.bag_g)
            then_s = now_s + row.approach_s[stop, place, to] + row.process_s[head, effort]
            then_s += row.empty_s if empties else 0.0
            late = then_s > row.closes_s[head] or (empties and now_s + row.empty_s >= row.limit_s)
            if late or row.slot[head] >= row.slots + picks:
                continue
            if empties:
                bag_g, decisions[count] = 0.0, _EMPTIED
                count += 1
            grams = collected_g(row, head, effort, bag_g)
            worth += row.gram * grams - row.loss * (row.mass_g[head] - grams) - row.second * (then_s - now_s)
            decisions[count] = head * efforts + effort
            now_s, bag_g, place, picks, count = then_s, bag_g + grams, to + 1, picks + 1, count + 1
            if now_s >= row.limit_s:
                return worth, count
        worth -= row.second * row.leave_s[stop, place]
        now_s += row.leave_s[stop, place]
        decisions[count] = _DRIVEN
        count += 1
        if now_s >= row.limit_s:
            break
    return worth, count


@compiled
def collected_g(row: Row, head: int, effort: int, bag_g: float) -> float:
    """Grams that a pick brings into a bag that holds some already, see the rules."""
    dropped = row.dropped[effort]
    dropped += (1.0 - dropped) * row.clog * (bag_g / row.bag_g)
    return row.cut_g[head, effort] * collected_share(dropped, row.odds[head])


@compiled
def sought(row: Row, luck: Array, warm: float) -> tuple[Numbers, float]:
    """Decisions of the best of many routes, see ``walked``, and what it is worth.

    Args:
        row: what there is.
        luck: (changes, 5), uniform numbers.
        warm: see ``WARM``.
    """
    n, efforts, stops = len(row.mass_g), row.cut_g.shape[1], len(row.first) - 1
    here = Route(np.arange(n), np.zeros(stops, np.int64), np.full(n, efforts // 2), np.zeros(n, np.bool_))
    decisions, best_of = np.empty(2 * n + stops, np.int64), np.empty(2 * n + stops, np.int64)
    now, length = walked(row, here, best_of)
    best = now
    for change in range(len(luck) if n else 0):
        place, stop = int(luck[change, 0] * n), 0
        while row.first[stop + 1] <= place:
            stop += 1
        begin, picked, head = row.first[stop], here.picked[stop], here.order[place]
        effort, emptied, at, to, step = here.effort[head], here.emptied[head], place - begin, place - begin, 0
        if at >= picked:
            # One more, anywhere.
            to, step = int(luck[change, 1] * (picked + 1)), 1
            here.effort[head], here.emptied[head] = int(luck[change, 3] * efforts), False
        elif luck[change, 2] < 0.25:
            to, step = picked - 1, -1
        elif luck[change, 2] < 0.6:
            to = int(luck[change, 1] * picked)
        elif luck[change, 2] < 0.8:
            here.effort[head] = int(luck[change, 3] * efforts)
        else:
            here.emptied[head] = not emptied
        moved(here.order, begin + at, begin + to)
        here.picked[stop] += step
        then, count = walked(row, here, decisions)
        late = change / len(luck)
        if then >= now - row.gram * warm * (1.0 - late) * (1.0 - late) * luck[change, 4]:
            now = then
            if now > best:
                best, length = now, count
                for i in range(count):
                    best_of[i] = decisions[i]
        else:
            here.picked[stop] -= step
            moved(here.order, begin + to, begin + at)
            here.effort[head], here.emptied[head] = effort, emptied
    return best_of[:length].copy(), best


@compiled
def moved(order: Numbers, at: int, to: int) -> None:
    """Take what stands at one place to another one; what is between makes room."""
    one, step = order[at], 1 if to > at else -1
    for i in range(at, to, step):
        order[i] = order[i + step]
    order[to] = one


def found(core: Any, row: Row, tracks: Numbers) -> list[tuple[float, float]]:
    """Grams and returns of routes from the rules, for the return and for grams alone; ``tracks`` (n,) are reports."""
    rng, grams = np.random.default_rng(0), row._replace(gram=1.0, loss=0.0, second=0.0)
    routes = [sought(aim, rng.random((CHANGES, 5)), WARM)[0] for aim in (*TRIES * [row], grams)]
    return [carried_out(core, decisions, tracks, row.cut_g.shape[1]) for decisions in routes]


def carried_out(core: Any, decisions: Numbers, tracks: Numbers, efforts: int) -> tuple[float, float]:
    """Grams and return of decisions, behind which the machine drives on.

    Args:
        core: the rules of one world right after a reset; they stay as they are.
        decisions: see ``walked``.
        tracks: (n,), reports of the heads.
        efforts: how many there are.
    """
    core, total, over, step = copy.deepcopy(core), 0.0, False, 0
    state, onward = core.state, DRIVE * core.config.slots
    while not over:
        did, action = int(decisions[step]) if step < len(decisions) else _DRIVEN, onward
        if did == _EMPTIED:
            action = onward + EMPTYING
        elif did >= 0:
            slots = np.flatnonzero(state.slot_report[0] == tracks[did // efforts])
            action = DRIVE * int(slots[0]) + did % efforts if len(slots) else onward
        plan = core.plan(np.array([action]))
        result = core.apply(plan, core.nominal(plan))
        total, over = total + float(result.rewards.sum()), bool(result.terminated[0] or result.truncated[0])
        step += 1
    return float(state.totals[0, T.gained]), total
