"""Every rule of the transplanter chooses what is best by its documented key, reckoned anew on rows of any kind."""

from itertools import combinations, pairwise, permutations, product
from math import exp, isclose
from typing import Any

import numpy as np
import pytest
from observed import WORLDS, least, machine_of

from fieldgym.agents.policies import transplanting
from fieldgym.envs.transplanting.columns import Candidate as Pair
from fieldgym.envs.transplanting.columns import Lucks
from fieldgym.envs.transplanting.columns import Machine as Transplanter
from fieldgym.envs.transplanting.config import PerceptionModel as TrayEyes
from fieldgym.envs.transplanting.config import TransplantingConfig
from fieldgym.envs.transplanting.core import TransplantingCore
from fieldgym.envs.transplanting.timing import gate_motion, times
from fieldgym.motion import Gate


def trays(seed: int):
    """Rows of the real trays, whose pairs are K in number."""
    config = TransplantingConfig()
    n, m = config.scenario.source.columns, config.scenario.target.columns
    rng, table = np.random.default_rng(seed), times(config)
    columns = Pair._fields
    candidates = np.zeros((WORLDS, n * m, len(columns)), np.float32)
    mask = np.zeros((WORLDS, 3 * n * m + 2), np.int8)
    for w in range(WORLDS - 1):
        seedlings, gaps = rng.random(n) < 0.5, rng.random(m) < 0.4
        poor, clear = rng.random(n) < 0.2, rng.random(m) < 0.3
        place = rng.integers(table.approach.shape[1])
        for i, j in np.ndindex(n, m):
            if seedlings[i] and gaps[j]:
                row = candidates[w, i * m + j]
                row[columns.index("present")] = 1.0
                row[columns.index("source_poor")], row[columns.index("clear")] = poor[i], clear[j]
                row[columns.index("approach")] = table.approach[int(clear[j]), place, i * m + j, 0]
                mask[w, 3 * (i * m + j) : 3 * (i * m + j) + 3] = 1
    mask[:, -2] = rng.random(WORLDS) < 0.7
    mask[:, -1] = 1
    machine = rng.uniform(0.0, 1.0, (WORLDS, len(Transplanter._fields))).astype(np.float32)
    machine[:, Transplanter._fields.index("gaps")] *= rng.random(WORLDS) < 0.7
    observation = {"machine": machine, "candidates": candidates.reshape(WORLDS, -1), "action_mask": mask}
    return config, observation, n, m


def test_the_transplanter_s_rules():
    config, observation, n, m = trays(6)
    table, process, weights = times(config), config.process, config.weights
    once = process.grip_s + process.release_s
    carry = table.carry[..., 0].reshape(3, n, m)
    good = []
    for limit in config.machine.carry_acceleration_m_s2:
        lost, hurt = (
            1.0 / (1.0 + exp((half - limit) / width))
            for half, width in (
                (process.loss_half_m_s2, process.loss_width_m_s2),
                (process.damage_half_m_s2, process.damage_width_m_s2),
            )
        )
        good.append(process.extraction * (1.0 - lost) * (1.0 - hurt))
    value = [weights.planted * p + weights.spoiled * (1.0 - p) for p in good]
    made = {
        name: getattr(transplanting, name)(config)
        for name in ("FixedOrder", "FixedOrderChosenSpeed", "Nearest", "ShortestCycle", "Assignment", "TwoOpt")
    }
    chosen = {name: policy.act(observation) for name, policy in made.items()}
    grid = observation["candidates"].reshape(WORLDS, n, m, -1)
    speeds, conveyors = set(), set()
    for w in range(WORLDS):
        cell = {(i, j): dict(zip(Pair._fields, map(float, grid[w, i, j]), strict=True)) for i, j in np.ndindex(n, m)}
        able = [pair for pair, row in cell.items() if row["present"] and not row["source_poor"]]
        gaps = machine_of(Transplanter, observation, w)["gaps"]
        if not able:
            source = gaps > 0.0 and observation["action_mask"][w, -2]
            conveyors.add(bool(source))
            for name, actions in chosen.items():
                assert actions[w] == 3 * n * m + (0 if source else 1), name
            continue
        approach = {pair: cell[pair]["approach"] + once * cell[pair]["clear"] for pair in able}
        first = {pair: approach[pair] + carry[1][pair] for pair in able}
        wanted = {
            "FixedOrder": able[0],
            "FixedOrderChosenSpeed": able[0],
            "Nearest": min(able, key=lambda pair: (round(approach[pair], 6), carry[1][pair])),
            "ShortestCycle": least(first, None),
        }
        for name, pair in wanted.items():
            speed = 1
            if name != "FixedOrder":
                rate = [value[s] / (approach[pair] + once + carry[s][pair]) for s in range(3)]
                speed = int(np.argmax(rate))
                speeds.add(speed)
            assert chosen[name][w] == 3 * (pair[0] * m + pair[1]) + speed, name
        check_sequences(config, table, cell, able, first, {k: int(chosen[k][w]) // 3 for k in ("Assignment", "TwoOpt")})
    assert len(speeds) > 1 and conveyors == {False, True}


def check_sequences(config: Any, table: Any, cell: Any, able: Any, first: Any, chosen: dict[str, int]) -> None:
    """The matched pairs take the least time on average, and come in the quickest order; where few enough to try all."""
    n, m = config.scenario.source.columns, config.scenario.target.columns
    once = config.process.grip_s + config.process.release_s
    approach, carry = table.approach[..., 0].reshape(2, -1, n, m), table.carry[1, :, 0].reshape(n, m)
    sources, gaps = sorted({i for i, _ in able}), sorted({j for _, j in able})

    def after(last: int, pair: tuple[int, int]) -> float:
        clears = int(cell[pair]["clear"])
        return approach[clears, n + last][pair] + clears * once + carry[pair]

    def took(order: Any) -> float:
        return first[order[0]] + sum(after(a[1], b) for a, b in pairwise(order))

    count = min(len(sources), len(gaps))
    if count > 3 or max(len(sources), len(gaps)) > 5:
        return
    matchings = [
        list(zip(i, j, strict=True))
        for i in permutations(sources, count)
        for j in ([tuple(gaps)] if count == len(gaps) else permutations(gaps, count))
    ]
    mean = {pair: float(np.mean([after(last, pair) for last in gaps])) for pair in able}
    cheapest = min(sum(mean[pair] for pair in matching) for matching in matchings)
    begun = {
        pair[0] * m + pair[1]: took(order)
        for matching in matchings
        if isclose(sum(mean[pair] for pair in matching), cheapest, abs_tol=1e-9)
        for order in permutations(matching)
        for pair in order[:1]
        if isclose(took(order), min(took(o) for o in permutations(matching)), abs_tol=1e-9)
    }
    assert chosen["Assignment"] in begun
    assert divmod(chosen["TwoOpt"], m) in able


def test_mended_sequences_cannot_be_mended_by_one_more_change():
    """Neither turning a piece round, nor exchanging two gaps, nor another seedling or gap makes them quicker."""
    rng = np.random.default_rng(3)
    for sources, gaps in ((5, 3), (3, 5), (4, 4)):
        for _ in range(4):
            first, following = rng.random((sources, gaps)), rng.random((gaps, sources, gaps))
            count = min(sources, gaps)
            found = transplanting.mended(first, following, [(i, i) for i in range(count)])
            took = transplanting.sequence_s(first, following, found)
            by_hand = first[found[0]] + sum(following[a[1]][b] for a, b in pairwise(found))
            assert took == pytest.approx(by_hand)
            others = [found[:i] + found[i : j + 1][::-1] + found[j + 1 :] for j in range(count) for i in range(j)]
            for i, j in combinations(range(count), 2):
                swapped = list(found)
                swapped[i], swapped[j] = (found[i][0], found[j][1]), (found[j][0], found[i][1])
                others.append(swapped)
            for i, pair in enumerate(found):
                spare = set(range(sources)) - {a for a, _ in found}, set(range(gaps)) - {b for _, b in found}
                changed = [(a, pair[1]) for a in spare[0]] + [(pair[0], b) for b in spare[1]]
                others += [[*found[:i], other, *found[i + 1 :]] for other in changed]
            assert all(transplanting.sequence_s(first, following, other) >= took - 1e-9 for other in others)


def test_a_way_has_no_round_corner_where_it_must_be_straight():
    """A tool that has to rise straight for all of its way stops at the corner."""
    up, over = np.zeros(2), np.array([0.4, 0.15])
    for style, straight_m in product(("blended", "time-optimal"), (0.15, 0.16)):
        straight = Gate(style, 4.5, 60.0, straight_m=straight_m)
        stopping, rounded_ = gate_motion(straight, up, over, 0.15), gate_motion(Gate(style, 4.5, 60.0), up, over, 0.15)
        assert stopping.duration_s == pytest.approx(straight.motion(up, over, 0.15).duration_s)
        assert rounded_.duration_s < stopping.duration_s - 0.01


def test_luck_as_large_as_a_chance_is_no_luck():
    """A plug leaves its cell where its luck is below the share that does."""
    core = TransplantingCore(TransplantingConfig(), TrayEyes.perfect(), 1)
    core.reset_rows(np.array([0]), [np.random.default_rng(3)])
    share, state = core.config.process.extraction, core.state
    action = int(np.flatnonzero(core.observe()["action_mask"][0])[0])
    source = action // 3 // core.target_shape[1]
    for luck, grips in ((np.nextafter(share, 0.0), True), (share, False), (np.nextafter(share, 1.0), False)):
        state.luck[0, 0, source, Lucks._fields.index("extract")] = luck
        assert bool(core.plan(np.array([action])).grips[0]) == grips
