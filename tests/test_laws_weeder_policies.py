"""Every rule of the weeders chooses what is best by its documented key, reckoned anew on observations of any kind."""

from math import acos, exp, inf, pi, sqrt
from typing import Any

import numpy as np
import pytest
from observed import WORLDS, K, least, machine_of, made_up, quintic_s

from fieldgym.agents.policies import weeding
from fieldgym.agents.policies.weeding_horizon import RecedingHorizon
from fieldgym.agents.policies.weeding_outlook import outlook
from fieldgym.envs.weeding.features import Candidate as Weed
from fieldgym.envs.weeding.features import Machine as Weeder
from fieldgym.envs.weeding.outcomes import SIZES, Outcomes
from fieldgym.envs.weeding.tools.hoe.config import HoeWeedingConfig
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig

STAGES = ("cotyledon", "two_leaf", "four_leaf")


def weeds(seed: int):
    observation, rows = made_up(Weeder, Weed, seed, 3, 1, (STAGES,))
    table = observation["candidates"].reshape(WORLDS, K, -1)
    grass, gap = Weed._fields.index("grass"), Weed._fields.index("crop_gap")
    table[..., grass] = table[..., grass] > 0.75
    table[..., gap] = table[..., gap] ** 2
    for w, k in np.ndindex(WORLDS, K):
        rows[w][k] = dict(zip(Weed._fields, map(float, table[w, k]), strict=True))
    return observation, rows


def logistic(dose: float, half: float, slope: float) -> float:
    return 1.0 / (1.0 + (half / max(dose, 1e-9)) ** slope)


def lens_share(cover: float, disc: float, distance: float) -> float:
    """Share of a disc under another one, by circular segments."""
    if distance >= cover + disc:
        return 0.0
    if distance <= abs(cover - disc):
        return min(1.0, (cover / disc) ** 2)
    area = 0.0
    for r, s in ((cover, disc), (disc, cover)):
        middle = (distance**2 + r * r - s * s) / (2.0 * distance)
        area += r * r * acos(middle / r) - middle * sqrt(r * r - middle * middle)
    return area / (pi * disc * disc)


def tool_of(config: Any) -> dict[str, Any]:
    """Work, energy, expected chances and harm of a tool from its configuration's numbers."""
    process = config.process
    if hasattr(process, "dose_j"):
        doses, half = list(process.dose_j), process.ed95_j / 19.0 ** (1.0 / process.slope)
        width = process.spot_radius_m**2 + process.crop_heart_m**2

        def harm(gap: float) -> list[float]:
            arrives = [dose * exp(-2.0 * gap * gap / width) for dose in doses]
            return [logistic(dose, process.crop_ed50_j, process.crop_slope) for dose in arrives]

        work_s = [process.correct_s + dose / process.power_w for dose in doses]
        energy, expected = doses, [0.7 * dose for dose in doses]
    else:
        half, expected = process.depth50_m, [0.95 * depth for depth in process.depth_m]
        work_s, energy = process.work_s.sum(axis=1).tolist(), process.energy_j.tolist()
        sweep = [radius + process.blade_radius_m for radius in process.stir_radius_m]

        def harm(gap: float) -> list[float]:
            shares = [lens_share(radius, process.crop_root_m, gap) for radius in sweep]
            return [
                logistic(depth * share, process.crop_depth50_m, process.crop_slope)
                for depth, share in zip(process.depth_m, shares, strict=True)
            ]

    chance = [
        [
            [
                logistic(dose, half * factor * (process.grass_factor if grass else 1.0), process.slope)
                for dose in expected
            ]
            for factor in process.stage_factor
        ]
        for grass in (False, True)
    ]
    label = [[next((m for m in range(3) if row[m] >= 0.8), 2) for row in rows] for rows in chance]
    return {"work_s": work_s, "energy": energy, "chance": chance, "label": label, "harm": harm}


def offers(config: Any, observation: Any, rows: Any, w: int, tool: Any) -> dict[tuple[int, int], dict[str, float]]:
    """Every shot that is possible, or that there is at all, and does more good than harm."""
    weights, found = config.weights, {}
    for k in range(K):
        weed = rows[w][k]
        kind = int(weed["grass"] > 0.5), int(np.argmax([weed[stage] for stage in STAGES]))
        harm = tool["harm"](0.05 * weed["crop_gap"])
        reach_s = 0.5 * (weed["move"] + weed["wait"])
        for mode in range(3):
            value = weights.killed * tool["chance"][kind[0]][kind[1]][mode]
            value += weights.crop * harm[mode] + weights.joules * tool["energy"][mode]
            if value > 0.0 and (observation is None or observation["action_mask"][w, 3 * k + mode]):
                found[k, mode] = {
                    "value": value,
                    "reach_s": reach_s,
                    "time_s": reach_s + tool["work_s"][mode],
                    "work_s": tool["work_s"][mode],
                    "label": tool["label"][kind[0]][kind[1]],
                }
    return found


@pytest.mark.parametrize("config", [WeedingConfig(slots=K), HoeWeedingConfig(slots=K)], ids=["laser", "hoe"])
def test_the_weeders_rules(config):
    observation, rows = weeds(7)
    tool = tool_of(config)
    labelled = lambda shot, key: shot["label"] == key[1]  # noqa: E731
    rules: dict[Any, Any] = {
        weeding.EarliestDeadline: (labelled, lambda shot, key: key[0]),
        weeding.Nearest: (labelled, lambda shot, key: shot["reach_s"]),
        weeding.ShortestDwell: (labelled, lambda shot, key: 1e3 * shot["work_s"] + shot["reach_s"]),
        weeding.KillPerSecond: (lambda shot, key: True, lambda shot, key: -shot["value"] / shot["time_s"]),
    }
    chosen = {kind: kind(config).act(observation) for kind in (*rules, weeding.Fifo)}
    waits, lower = 0, 0
    for w in range(WORLDS):
        shots = offers(config, observation, rows, w, tool)
        for kind, (able, key) in rules.items():
            keys = {at: key(shot, at) for at, shot in shots.items() if able(shot, at)}
            best = least(keys, (K, 0))
            waits += best[0] == K
            assert chosen[kind][w] == 3 * best[0] + best[1], kind
        for k in range(K):
            modes = [mode for mode in range(3) if (k, mode) in shots and mode <= shots[k, mode]["label"]]
            if modes:
                lower += modes[-1] < shots[k, modes[-1]]["label"]
                assert chosen[weeding.Fifo][w] == 3 * k + modes[-1]
                break
        else:
            assert chosen[weeding.Fifo][w] == 3 * K
    assert waits and lower


@pytest.mark.parametrize("config", [WeedingConfig(), HoeWeedingConfig()], ids=["laser", "hoe"])
def test_what_policies_expect_of_a_tool(config):
    tool, seen = tool_of(config), outlook(config)
    assert seen.work_s == pytest.approx(tool["work_s"], rel=1e-12)
    assert seen.energy_j == pytest.approx(tool["energy"], rel=1e-12)
    assert seen.chance == pytest.approx(np.array(tool["chance"]), rel=1e-9)
    assert seen.label.tolist() == tool["label"]
    assert len({label for row in tool["label"] for label in row}) > 1
    gaps = np.array([0.0, 0.0031, 0.011, 0.0195, 0.03, 0.2])
    by_hand = np.array([tool["harm"](gap) for gap in gaps])
    # The hoe's is read from a table of half millimetres.
    assert seen.harm(gaps) == pytest.approx(by_hand, abs=2e-3)
    assert seen.lean_share == (pytest.approx(0.2 / 0.35) if hasattr(config.reach, "lean_m") else 0.0)
    with pytest.raises(TypeError, match="no outlook"):
        outlook(3)


def test_rules_of_speed():
    config = WeedingConfig(slots=K, speed_control=True)
    observation, rows = weeds(8)
    shots, low, high = weeding.Nearest(config), 0.3, 0.9
    observation["machine"][:, Weeder._fields.index("set_speed")] *= 2.5
    backlog = weeding.HoldBacklog(shots, low, high, "mine")
    constant = {factor: weeding.AtSpeed(shots, factor) for factor in (0.05, 0.75, 1.0, 9.0)}
    assert backlog.name == "mine" and weeding.HoldBacklog(shots).name == "hold-backlog"
    assert [policy.name for policy in constant.values()] == [
        "constant-0.05",
        "constant-0.75",
        "constant-1",
        "constant-9",
    ]
    tool, acts, block = tool_of(config), shots.act(observation), 3 * K + 1
    seen = set()
    for w in range(WORLDS):
        speed = 0.1 * float(observation["machine"][w, Weeder._fields.index("set_speed")])
        for factor, policy in constant.items():
            aim = min(max(factor * config.speed_m_s, 0.03), 0.27)
            change = 1 if speed > aim + 0.01 else 2 if speed < aim - 0.01 else 0
            assert policy.act(observation)[w] == change * block + acts[w]
        there = [weed for weed in rows[w] if weed["present"]]
        work = sum(
            0.26 + tool["work_s"][tool["label"][int(weed["grass"])][int(np.argmax([weed[s] for s in STAGES]))]]
            for weed in there
        )
        way = max([0.3 * weed["along"] + 0.35 for weed in there], default=0.0)
        share = work * max(speed, 1e-3) / max(way, 0.5 * 0.35)
        change = 1 if share > high else 2 if share < low else 0
        seen.add(change)
        assert backlog.act(observation)[w] == change * block + acts[w]
    assert seen == {0, 1, 2}


def test_work_that_is_near_is_spread_over_half_of_what_the_front_camera_sees():
    """A weed just behind the camera's front edge is no reason to stop."""
    config = WeedingConfig(slots=K, speed_control=True)
    observation, rows = weeds(8)
    table = observation["candidates"].reshape(WORLDS, K, len(Weed._fields))
    assert np.shares_memory(table, observation["candidates"])
    present, along = (Weed._fields.index(name) for name in ("present", "along"))
    table[:, 1:, present], table[:, 0, present], table[:, 0, along] = 0.0, 1.0, -0.3
    way, work_s = 0.35 - 0.3 * 0.3, []
    for w in range(WORLDS):
        weed, tool = rows[w][0], tool_of(config)
        label = tool["label"][int(weed["grass"])][int(np.argmax([weed[s] for s in STAGES]))]
        work_s.append(0.26 + tool["work_s"][label])
    set_speed = Weeder._fields.index("set_speed")
    for share in (0.7, 1.1):
        observation["machine"][:, set_speed] = 10.0 * share * 0.6 * way / np.array(work_s)
        change = 1 if share > 1.0 else 0
        policy = weeding.HoldBacklog(weeding.Nearest(config), 0.3, 0.6)
        assert np.all(policy.change(observation) == change)


def ways_of(config: Any) -> tuple[Any, Any]:
    """What a move takes, and how the arm would work on a target: place, seconds until it does, whether it can."""
    r = config.reach
    laser = hasattr(r, "lean_m")

    def move_s(carrier: float, lean: float, across: float) -> float:
        if not laser:
            return max(quintic_s(s, r.velocity_m_s, r.acceleration_m_s2) for s in (carrier, across))
        limits = (r.travel_velocity_m_s, r.travel_acceleration_m_s2), (r.lean_velocity_m_s, r.lean_acceleration_m_s2)
        return max(quintic_s(carrier, *limits[0]), *(quintic_s(s, *limits[1]) for s in (lean, across)))

    def approach(place: Any, stand: float, cart: float, speed: float, along: float, across: float) -> Any:
        lean, possible = 0.0, abs(across) <= r.half_width_m
        if laser:
            half = r.travel_m - 0.5 * stand * speed
            ahead = along - cart - speed * (0.26 + 0.5 * stand)
            lean = min(max(ahead * r.lean_m / (max(half, 0.0) + r.lean_m), -r.lean_m), r.lean_m)
            possible = possible and half >= 0.0
        carrier = along - lean
        move = move_s(carrier - place[0], lean - place[1], across - place[2])
        wait = max((carrier - cart - r.travel_m) / speed - move, 0.0)
        left = carrier - cart - speed * (move + wait + stand) >= -r.travel_m
        return (carrier, lean, across), move + wait, possible and left and wait <= config.cart.early_s

    return move_s, approach


def any_outcomes(seed: int) -> Outcomes:
    """Tables that no tool has: every cell another number."""
    rng = np.random.default_rng(seed)
    kinds, steps, modes = SIZES["kinds"], SIZES["steps"], SIZES["modes"]
    sure = SIZES["confidences"]
    own = (kinds, SIZES["crops"], SIZES["neighbours"], sure, SIZES["crowds"])
    return Outcomes(
        own=rng.random((*own, modes)),
        own_count=np.ones(own),
        beside=rng.random((kinds, steps, sure, sure, modes)),
        beside_count=np.ones((kinds, steps, sure, sure)),
        after=rng.random((kinds, steps, sure, modes, modes)),
        left=rng.random((kinds, steps, sure, modes, modes)),
        harm=0.1 * rng.random((SIZES["crop_steps"], modes)),
        harm_count=np.ones(SIZES["crop_steps"]),
        per_m=np.ones(1),
    )


def beliefs_of(config: Any, tool: Any, tables: Outcomes, rows: Any) -> tuple[Any, Any]:
    """What a shot in a mode is worth after others, and in which mode it would be fired later; nothing was done yet."""
    weights, there = config.weights, [k for k in range(K) if rows[k]["present"]]
    at = [(0.3 * weed["along"], 0.2 * weed["across"]) for weed in rows]
    kind = [3 * int(weed["grass"] > 0.5) + int(np.argmax([weed[stage] for stage in STAGES])) for weed in rows]
    apart = {(i, j): sqrt((at[i][0] - at[j][0]) ** 2 + (at[i][1] - at[j][1]) ** 2) for i in there for j in there}
    sure = [sum(weed["confidence"] >= edge for edge in (0.3, 0.35, 0.4, 0.7, 0.84)) for weed in rows]
    beside = {k: [j for j in there if j != k and apart[k, j] < 0.05] for k in there}

    def left(k: int, mode: int, taken: dict[int, int]) -> float:
        before = [(int(apart[k, j] / 0.005), taken[j]) for j in beside[k] if j in taken]
        return float(np.prod([tables.after[kind[k], step, sure[k], done, mode] for step, done in before]))

    def own(k: int, mode: int) -> float:
        others = [apart[k, j] for j in there if j != k]
        nearest_m, crowd = min(others, default=inf), sum(gap < 0.12 for gap in others)
        crop = sum(0.05 * rows[k]["crop_gap"] >= edge for edge in (0.015, 0.03, 0.05, 0.065, 0.08, 0.11))
        near = sum(nearest_m >= edge for edge in (0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.05))
        return float(tables.own[kind[k], crop, near, sure[k], sum(crowd >= edge for edge in (1, 2, 3, 5, 8)), mode])

    def value(k: int, mode: int, taken: dict[int, int]) -> float:
        killed = own(k, mode) * left(k, mode, taken)
        for j in beside[k]:
            if j not in taken:
                share = tables.beside[kind[j], int(apart[k, j] / 0.005), sure[j], sure[k], mode]
                killed += float(share) * own(j, mode) * left(j, mode, taken)
        harm = float(tables.harm[min(int(0.05 * rows[k]["crop_gap"] / 0.0025), 31), mode])
        return weights.killed * killed + weights.crop * harm + weights.joules * tool["energy"][mode]

    price = 0.7 * 0.35 * weights.killed / config.service_s
    later = {}
    for k in there:
        able = [mode for mode in range(3) if value(k, mode, {}) > 0.0]
        if able:
            later[k] = max(able, key=lambda mode: value(k, mode, {}) - price * tool["work_s"][mode])
    return value, later


def worths_of(config: Any, tool: Any, tables: Outcomes, observation: Any, rows: Any, w: int) -> tuple[Any, float]:
    """What every sequence of two shots at most is worth, by its first one, and what waiting a moment is worth."""
    machine, weeds_ = machine_of(Weeder, observation, w), rows[w]
    speed = max(0.1 * machine["speed"], 1e-3)
    move_s, approach = ways_of(config)
    laser = hasattr(config.reach, "lean_m")
    front = config.reach.travel_m + (config.reach.lean_m if laser else 0.0)
    share = config.reach.lean_m / front if laser else 0.0
    scale = (config.reach.travel_m, config.reach.lean_m if laser else 1.0, config.reach.half_width_m)
    names = "place", "lean_along", "lean_across"
    start = tuple(machine[name] * unit for name, unit in zip(names, scale, strict=True))
    at = [(0.3 * weed["along"], 0.2 * weed["across"]) for weed in weeds_]
    value, later = beliefs_of(config, tool, tables, weeds_)
    price, reserve = 0.35 * config.weights.killed / config.service_s, 0.5 * config.service_s

    def moved(last: int, k: int) -> float:
        (along, across), (x, lean, y), passed = at[k], start, 0.0
        if last < K:
            x, lean, y = at[last][0] * (1.0 - share), share * at[last][0], at[last][1]
            passed = share * speed * tool["work_s"][later.get(last, 0)]
        return move_s(along * (1.0 - share) - x + passed, share * along - lean - passed, across - y)

    def rest(clock: float, taken: dict[int, int], last: int) -> float:
        gained, taken = 0.0, dict(taken)
        for k, mode in later.items():
            if k not in taken:
                done = max(clock + moved(last, k), (at[k][0] - front) / speed) + tool["work_s"][mode]
                if done <= (at[k][0] + front) / speed - reserve and value(k, mode, taken) > 0.0:
                    gained += value(k, mode, taken)
                    clock, last, taken[k] = done, k, mode
        return gained - price * clock

    best: dict[Any, float] = {}

    def grow(first: Any, taken: dict[int, int], place: Any, clock: float, gained: float) -> None:
        for k in range(K):
            for mode in range(3) if weeds_[k]["present"] and k not in taken else ():
                if not (later.get(k) == mode if taken else observation["action_mask"][w, 3 * k + mode]):
                    continue
                gain = value(k, mode, taken)
                there, until, possible = approach(place, tool["work_s"][mode], speed * clock, speed, *at[k])
                if gain > 0.0 and possible:
                    done, begun, more = clock + until + tool["work_s"][mode], first or (k, mode), {**taken, k: mode}
                    best[begun] = max(best.get(begun, -inf), gained + gain + rest(done, more, k))
                    if not taken:
                        grow(begun, more, there, done, gained + gain)

    grow(None, {}, start, 0.0, 0.0)
    return best, rest(config.cart.moment_s, {}, K)


@pytest.mark.parametrize("config", [WeedingConfig(slots=K), HoeWeedingConfig(slots=K)], ids=["laser", "hoe"])
def test_the_planner_begins_with_the_best_sequence(config):
    observation, rows = weeds(9)
    table = observation["candidates"].reshape(WORLDS, K, -1)
    # Present ones come first, as they leave; weeds as they lie about the window, and a cart that drives.
    table[:] = np.take_along_axis(table, np.argsort(-table[..., :1], axis=1, kind="stable"), axis=1)
    for name, low, high in (("along", -0.9, 1.5), ("across", -0.95, 0.95)):
        column = Weed._fields.index(name)
        table[..., column] = np.where(table[..., 0] > 0.0, low + (high - low) * table[..., column] / 1.5, 0.0)
        # Three stand together: what is beside a shot may have been beside the one before it too.
        for k in (1, 2, 4, 5):
            beside = table[:, k - k % 3, column] + (0.1 if name == "along" else 0.05) * table[:, k, column]
            table[:, k, column] = np.where(table[:, k, 0] > 0.0, beside, 0.0)
    for w, k in np.ndindex(WORLDS, K):
        rows[w][k] = dict(zip(Weed._fields, map(float, table[w, k]), strict=True))
    observation["action_mask"][:, : 3 * K] = np.repeat(table[..., 0] > 0.0, 3, axis=1)
    observation["action_mask"][:, : 3 * K : 4] = 0
    observation["action_mask"][5:24:6, : 3 * K] = 0
    observation["machine"][:, Weeder._fields.index("speed")] += 0.5
    tables, waits = any_outcomes(10), 0
    tool, actions = tool_of(config), RecedingHorizon(config, 2, 200, tables).act(observation)
    for w in range(24):
        best, idle = worths_of(config, tool, tables, observation, rows, w)
        if not best or max(best.values()) < idle:
            waits += 1
            assert actions[w] == 3 * K
        else:
            assert best[divmod(int(actions[w]), 3)] == pytest.approx(max(best.values()), abs=1e-6)
    assert 0 < waits < 20
    for depth, width in ((0, 4), (4, 0)):
        with pytest.raises(ValueError, match="at least 1"):
            RecedingHorizon(config, depth, width, tables)
