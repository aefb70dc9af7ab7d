"""Every rule of the sorter chooses what is best by its documented key, reckoned anew on observations of any kind."""

from math import hypot, inf, isclose
from typing import Any

import numpy as np
import pytest
from observed import WORLDS, K, least, made_up, quintic_s

from fieldgym.agents.policies import sorting, sorting_value
from fieldgym.agents.policies.search import Taken
from fieldgym.agents.policies.value_weights import SHAPES
from fieldgym.agents.policies.weights import PolicyFileError
from fieldgym.envs.sorting.columns import Candidate as Item
from fieldgym.envs.sorting.columns import Machine as Sorter
from fieldgym.envs.sorting.config import PerceptionModel, SortingConfig
from fieldgym.envs.sorting.odds import Odds

GRADES = ("ware", "seed", "ripe", "green")


def produce(seed: int):
    observation, rows = made_up(Sorter, Item, seed, 1, 1, (GRADES,))
    return observation, rows


def test_the_sorter_s_rules():
    observation, rows = produce(4)
    keys = {
        sorting.Fifo: lambda item, slot: -item["along"],
        sorting.EarliestDeadline: lambda item, slot: slot,
        sorting.Nearest: lambda item, slot: item["approach"] + 4.0 * item["wait"],
        sorting.ShortestCycle: lambda item, slot: item["cycle"],
        sorting.ValuePerSecond: lambda item, slot: -item["value"] * item["quality"] / item["cycle"],
    }
    for kind, key in keys.items():
        actions = kind().act(observation)
        for w in range(WORLDS):
            able = {k: key(rows[w][k], k) for k in range(K) if observation["action_mask"][w, k]}
            assert actions[w] == least(able, K), kind


def sequences_of(config: Any, observation: Any, rows: Any, w: int, gain: list[float], price: float):
    """What every sequence of picks is worth, with the others in the queue's order after it; by its first pick."""
    sorter, belt, grip = config.machine.sorter, config.belt, config.grip
    v, items = belt.speed_m_s, rows[w]

    def motion(way: float, least_s: float) -> float:
        return max(quintic_s(way, sorter.velocity_m_s - v, sorter.acceleration_m_s2), least_s)

    hold = 2.0 * quintic_s(config.machine.travel_level_m - 0.010, sorter.velocity_m_s, sorter.acceleration_m_s2)
    hold += grip.grip_s
    there = [k for k in range(K) if items[k]["present"]]
    goal = {k: [items[k][name] for name in GRADES].index(max(items[k][name] for name in GRADES)) for k in there}

    def pick(k: int, place: tuple[float, float], clock: float) -> tuple[tuple[float, float], float] | None:
        item = items[k]
        along, across = 0.2 * item["along"], 0.2 * item["across"]
        last = along + v * (4.0 * item["slack"] + item["approach"])
        first = -(last + 0.006 + v * hold)
        least_s = max(quintic_s(item["turn"], sorter.turn_rad_s, sorter.turn_rad_s2), config.machine.shortest_move_s)
        now, bin_place = along + v * clock, belt.bins_m[goal[k]]
        approach = least_s
        for _ in range(2):
            ahead = max(now + v * approach, first) - place[0]
            approach = motion(hypot(ahead - 0.5 * v * approach, across - place[1]), least_s)
        meet = max(now + v * approach, first)
        if meet > last:
            return None
        lifted = clock + max((meet - now) / v, approach) + hold
        return bin_place, lifted + motion(hypot(bin_place[0] - meet - v * hold, bin_place[1] - across), least_s) + (
            grip.release_s
        )

    queue = sorted(there, key=lambda k: -0.2 * items[k]["along"])

    def rest(place: tuple[float, float], clock: float, used: tuple[int, ...]) -> float:
        worth = 0.0
        for k in queue:
            if k not in used and (found := pick(k, place, clock)):
                worth, (place, clock) = worth + gain[k], found
        return worth - price * clock

    best: dict[int, float] = {}

    def grow(used: tuple[int, ...], place: tuple[float, float], clock: float, gained: float, depth: int) -> None:
        if used:
            best[used[0]] = max(best.get(used[0], -inf), gained + rest(place, clock, used))
        for k in there if depth else []:
            if k not in used:
                found = pick(k, place, clock) if used else None
                if not used and observation["action_mask"][w, k]:
                    found = belt.bins_m[goal[k]], 2.0 * items[k]["cycle"]
                if found:
                    grow((*used, k), *found, gained + gain[k], depth - 1)

    return best, grow


@pytest.mark.parametrize("by_value", [False, True])
def test_the_sorter_s_planner_begins_with_the_best_sequence(by_value):
    config, (observation, rows) = SortingConfig(), produce(5)
    table = observation["candidates"].reshape(WORLDS, K, -1)
    # Items as they lie: about the reach, some seconds left.
    for name, low, high in (("along", -2.5, 0.5), ("across", -0.5, 0.5), ("slack", 0.0, 0.6), ("approach", 0.2, 0.5)):
        column = Item._fields.index(name)
        table[..., column] = np.where(table[..., 0] > 0.0, low + (high - low) * table[..., column] / 1.5, 0.0)
    # Present ones come first.
    table[:] = np.take_along_axis(table, np.argsort(-table[..., :1], axis=1, kind="stable"), axis=1)
    observation["action_mask"][:-1, :K] &= table[:-1, :, 0] > 0.0
    for w, k in np.ndindex(WORLDS, K):
        rows[w][k] = dict(zip(Item._fields, map(float, table[w, k]), strict=True))
    depth, shown = 3, 24
    actions = sorting.RecedingHorizon(config, depth, 200, by_value=by_value).act(observation)
    odds = Odds(config, PerceptionModel.measured())
    mean = sum(odds.aligned * np.array(config.produce.value if by_value else (1.0,) * 4)) / 4.0
    price, waits = 0.45 * mean / 1.6, 0
    for w in [*range(shown), WORLDS - 1]:
        chances = odds.placed(table[w].astype(float))
        gain = [chance * (item["value"] if by_value else 1.0) for chance, item in zip(chances, rows[w], strict=True)]
        best, grow = sequences_of(config, observation, rows, w, gain, price)
        grow((), (0.0, 0.0), 0.0, 0.0, depth)
        waits += not best
        assert actions[w] == K if not best else isclose(best[int(actions[w])], max(best.values()), abs_tol=1e-6)
    assert 0 < waits < shown


def test_planners_refuse_to_look_nowhere():
    for kind, config in ((sorting.RecedingHorizon, SortingConfig()),):
        for sizes in ((0, 4), (4, 0)):
            with pytest.raises(ValueError, match="at least 1"):
                kind(config, *sizes)


KNOTS_S = [0.25, 1.0, 1.75, 2.75, 3.75, 5.25, 7.25, 9.25]


def belt_features(table: Any, gain: Any, config: Any, arrivals: Any, time_s: float, clock_s: float, used: int) -> Any:
    """What is on a belt after a while: items and gains by the time they have left, their products, the stream's end."""
    counts, gains = np.zeros(8), np.zeros(8)

    def count(left_s: float, items: float, worth: float) -> None:
        if left_s >= KNOTS_S[0]:
            for i in range(8):
                part = float(np.interp(left_s, KNOTS_S, np.eye(8)[i]))
                counts[i] += part * items
                gains[i] += part * worth

    for k in range(K):
        item = dict(zip(Item._fields, map(float, table[k]), strict=True))
        if item["present"] and not used >> k & 1:
            count(4.0 * item["slack"] + item["approach"] - clock_s, 1.0, float(gain[k]))
    rate, left, worth, last = map(float, arrivals)
    seen_s = min(max(last - time_s, 0.0), clock_s)
    for portion in range(4 if seen_s > 0.0 else 0):
        items = rate * seen_s / 4.0
        count(left - (clock_s - seen_s * (portion + 0.5) / 4.0), items, worth * items)
    pairs = []
    for i in range(8):
        pairs += [0.1 * counts[i] * counts[j] for j in range(i, 8)] + [0.1 * counts[i] * gains[j] for j in range(8)]
    until = last - time_s - clock_s
    ends = [max(until + more, 0.0) / 10.0 for more in (-17.0, -7.0, -2.0, 3.0, 8.0)]
    return np.array([*counts, *gains, *pairs, *ends, 1.0]), seen_s


def test_the_value_of_a_belt_is_its_features_times_the_weights():
    config, rng, (observation, _) = SortingConfig(), np.random.default_rng(2), produce(6)
    # Some have more time left than the last knot.
    observation["candidates"].reshape(WORLDS, K, -1)[..., Item._fields.index("slack")] *= 2.5
    weights = {name: rng.normal(size=shape).astype(np.float32) for name, shape in SHAPES.items()}
    weights["arrivals"] = np.array([0.7, 6.0, 0.5, 0.5 * config.scenario.time_limit_s], np.float32)
    search = sorting_value.ValueSearch(config, sorting_value.ValueWeights(2, 8, weights, {"a": 1}, "mine"))
    assert (search.name, search.card) == ("mine", {"a": 1})
    problem, table = search.problem(observation), observation["candidates"].reshape(WORLDS, K, -1)
    learned, quality = weights["gain"].astype(float), Item._fields.index("quality")
    whole = sorting_value.describe_all(problem)
    sizes = set()
    for w in range(20):
        gain = [
            sum(
                float(row[Item._fields.index(name)]) * learned[power * 4 + kind] * float(row[quality]) ** power
                for kind, name in enumerate(GRADES)
                for power in range(3)
            )
            for row in table[w]
        ]
        assert problem.picks.gain[w] == pytest.approx(gain, abs=1e-9)
        machine = observation["machine"][w]
        time_s = float(machine[Sorter._fields.index("time")]) * config.scenario.time_limit_s
        place = [0.2 * float(machine[Sorter._fields.index(name)]) for name in "xy"]
        for clock_s, used in ((0.0, 0), (3.0, 0b101), (9.0, 0b10), (40.0, 0)):
            row = np.empty(SHAPES["value"])
            sorting_value.describe(problem, w, place[0], place[1], clock_s, used, row)
            known, seen_s = belt_features(table[w], gain, config, weights["arrivals"], time_s, clock_s, used)
            worth, done_s = sorting.queue(problem.picks, w, place[0], place[1], clock_s, used)
            assert row == pytest.approx([*known, worth, done_s - clock_s, seen_s], abs=1e-6)
            assert clock_s or whole[w] == pytest.approx(row)
            sizes.add(seen_s > 0.0)
            bins = problem.picks.bins[problem.picks.goal[w, 1]]
            sorting_value.describe(problem, w, bins[0], bins[1], clock_s, used, row)
            value = sorting_value.prospect(problem, w, clock_s, Taken(used, 0, 0), 1)
            assert value == pytest.approx(float(row @ weights["value"].astype(float)), rel=1e-9)
    assert sizes == {False, True}


def test_learned_values_search_as_deep_as_they_say():
    weights = {name: np.zeros(shape, np.float32) for name, shape in SHAPES.items()}
    for depth, width in ((16, 256), (1, 1)):
        learned = sorting_value.ValueWeights.of({"depth": depth, "width": width}, weights, "mine")
        assert learned.head["depth"] == depth and learned.head["width"] == width
    for depth, width in ((0, 1), (17, 1), (1, 0), (1, 257)):
        with pytest.raises(PolicyFileError, match="out of range"):
            sorting_value.ValueWeights(depth, width, weights, {})
