"""Every feature and every score, computed again from the state and the log of decisions in plain Python; the doses of
both tools on a grid against their written formulas."""

from dataclasses import replace
from itertools import product
from math import acos, exp, hypot, log, pi, sqrt
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.envs.weeding.features import L
from fieldgym.envs.weeding.field import Crops
from fieldgym.envs.weeding.process import dose
from fieldgym.envs.weeding.response import crop_tolerance, tolerance
from fieldgym.envs.weeding.rules import note
from fieldgym.envs.weeding.tools.hoe.process import HoeProcess, HoeProcessConfig, Stir
from fieldgym.envs.weeding.tools.laser.process import Burn, LaserProcess, ProcessConfig

IDS = ["LaserWeeding", "LaserWeedingSpeed", "HoeWeeding"]


def quintic_s(stroke_m, velocity, acceleration):
    """Shortest rest-to-rest quintic: peaks of 15/8 and 10/sqrt(3)."""
    return max(1.875 * stroke_m / velocity, sqrt(10.0 / sqrt(3.0) * stroke_m / acceleration))


def laser_way(config, stand_s, place, cart, speed, along, across):
    """Move, wait, legal."""
    r = config.reach
    half = r.travel_m - 0.5 * stand_s * speed
    ahead = along - cart - speed * (r.expected_move_s + 0.5 * stand_s)
    lean = float(np.clip(ahead * r.lean_m / (max(half, 0.0) + r.lean_m), -r.lean_m, r.lean_m))
    move = max(
        quintic_s(abs(along - lean - place[0]), r.travel_velocity_m_s, r.travel_acceleration_m_s2),
        quintic_s(abs(lean - place[1]), r.lean_velocity_m_s, r.lean_acceleration_m_s2),
        quintic_s(abs(across - place[2]), r.lean_velocity_m_s, r.lean_acceleration_m_s2),
    )
    return move, along - lean - cart, r.travel_m, half >= 0.0 and abs(across) <= r.half_width_m


def hoe_way(config, stand_s, place, cart, speed, along, across):
    """Move, wait, legal."""
    r = config.reach
    move = max(
        quintic_s(abs(along - place[0]), r.velocity_m_s, r.acceleration_m_s2),
        quintic_s(abs(across - place[2]), r.velocity_m_s, r.acceleration_m_s2),
    )
    return move, along - cart, r.travel_m, abs(across) <= r.half_width_m


def features_by_hand(core, shots):
    """Machine's features, the candidates' by slot, and the first block of the mask, by name.

    ``shots`` are aims and modes of what was done.
    """
    config, state = core.config, core.state
    cart, speed, place = float(state.cart[0]), float(state.speed[0]), state.place[0]
    laser = hasattr(config.reach, "lean_m")
    front, half_width = config.front_m, config.half_width_m
    slots = [int(track) for track in state.slot_track[0] if track != core.capacity]
    machine = {
        "place": (place[0] - cart) / config.reach.travel_m,
        "lean_along": place[1] / config.reach.lean_m if laser else place[1],
        "lean_across": place[2] / half_width,
        "speed": speed / 0.1,
        "set_speed": state.set_speed[0] / 0.1,
        "progress": cart / config.scenario.strip_m,
        "backlog": len(slots) / config.slots,
    }
    field, candidates, legal = core.field, [], []
    for track in slots:
        along, across = field.reports.along_m[track], field.reports.across_m[track]
        stage, row = field.reports.stage[track], {}
        for mode in range(3):
            stand = work_s(config)[mode]
            way = laser_way if laser else hoe_way
            move, ahead, travel, possible = way(config, stand, place, cart, speed, along, across)
            wait = max((ahead - travel) / speed - move, 0.0)
            behind = ahead - speed * (move + wait + stand)
            legal.append(possible and behind >= -travel and wait <= config.cart.early_s)
            if mode == 1:
                row = {"move": move / 0.5, "wait": wait / 0.5}
        row |= {
            "present": 1.0,
            "along": (along - cart) / 0.3,
            "across": across / 0.2,
            "leaves": (along - cart + front) / speed / 4.0,
            "grass": field.reports.species[track],
            "cotyledon": stage == 0,
            "two_leaf": stage == 1,
            "four_leaf": stage == 2,
            "crop_gap": min(field.reports.crop_gap_m[track] / 0.05, 4.0),
            "confidence": field.reports.confidence[track],
            "done": sum(
                share_by_hand(config, mode, along - aim[0], across - aim[1], field.reports.species[track], stage)
                for aim, mode in shots
            ),
        }
        candidates.append({name: float(np.clip(value, -10.0, 10.0)) for name, value in row.items()})
    return machine, candidates, legal


def share_by_hand(config, mode, along, across, species, stage):
    """Dose of a work at an offset / the one that kills half of a kind."""
    process, off = config.process, hypot(along, across)
    if hasattr(process, "dose_j"):
        width = process.spot_radius_m**2 + process.meristem_m[stage] ** 2
        arrives, half = (
            process.dose_j[mode] * exp(-2.0 * off**2 / width),
            process.ed95_j / 19.0 ** (1.0 / process.slope),
        )
    else:
        sweep, root = process.stir_radius_m[mode] + process.blade_radius_m, process.root_m[stage]
        arrives, half = process.depth_m[mode] * lens_m2(sweep, root, off) / (pi * root**2), process.depth50_m
    return arrives / (half * process.stage_factor[stage] * (process.grass_factor if species else 1.0))


def work_s(config):
    """Seconds on a plant by mode."""
    if hasattr(config.reach, "lean_m"):
        return [config.process.correct_s + joules / config.process.power_w for joules in config.process.dose_j]
    return config.process.work_s.sum(axis=1).tolist()


class Log:
    """The scores, from what every decision was and brought."""

    def __init__(self, core):
        self.core, self.time, self.cart = core, 0.0, -core.config.cart.start_m
        self.killed = self.crops = self.illegal = self.shots = self.blanks = self.joules = 0.0
        self.last_shot = self.last_kill = 0.0
        self.leaves, self.dead = np.zeros(len(core.field.crops)), np.zeros(len(core.field.crops), bool)
        self.phases = dict.fromkeys(core.phase_names, 0.0)
        self.aimed = []

    def add(self, plan, result):
        config, kind, elapsed = self.core.config, int(plan.kind[0]), float(result.phases_s[0].sum())
        rewards = dict(zip(self.core.reward_names, result.rewards[0].tolist(), strict=True))
        self.time += elapsed
        before, after = plan.speed[0].tolist()
        ramp = min(abs(after - before) / config.cart.acceleration_m_s2, elapsed)
        reached = before + np.sign(after - before) * config.cart.acceleration_m_s2 * ramp
        self.cart += 0.5 * (before + reached) * ramp + after * (elapsed - ramp)
        for name, seconds in zip(self.core.phase_names, result.phases_s[0].tolist(), strict=True):
            self.phases[name] += seconds
        self.killed += rewards["killed"]
        self.crops -= rewards["crop"] / 5.0
        assert rewards["time"] == pytest.approx(-0.05 * elapsed) and rewards["killed"] % 1.0 == 0.0
        if kind < 3:
            joules = float(self.core.process.energy_j[kind])
            assert rewards["energy"] == pytest.approx(-0.0005 * joules)
            self.shots, self.joules, self.last_shot = self.shots + 1.0, self.joules + joules, self.time
            self.strip(plan.aim[0], kind)
            self.aimed.append((plan.aim[0].tolist(), kind))
            self.blanks += self.core.field.reports.behind[plan.track[0]] == 0
            if rewards["killed"]:
                self.last_kill = self.time
        elif kind == 4:
            self.illegal += 1.0
        if kind >= 3:
            assert rewards["killed"] == rewards["crop"] == rewards["energy"] == 0.0
        assert rewards["leaves"] == 0.0

    def strip(self, aim, mode):
        """Leaves of living crop plants, over discs of 55 mm, within the burnt or stirred disc."""
        crops, process = self.core.field.crops, self.core.config.process
        if hasattr(process, "dose_j"):
            w = process.spot_radius_m
            hit = w * sqrt(0.5 * log(2.0 * process.dose_j[mode] / (pi * w * w) / process.leaf_tolerance_j_m2))
        else:
            hit = process.stir_radius_m[mode] + process.blade_radius_m
        for i, (along, across) in enumerate(zip(crops.along_m, crops.across_m, strict=True)):
            off = float(along - aim[0]), float(across - aim[1])
            if not self.dead[i] and 0.0 <= along <= self.core.config.scenario.strip_m:
                share = lens_m2(hit, 0.055, hypot(*off)) / (pi * 0.055**2)
                self.leaves[i] = min(self.leaves[i] + share, 1.0)
        state, end = self.core.state, self.core.weeds_end
        self.dead = (state.plant_dose[0, end:] >= state.plant_tolerance[0, end:])[: len(crops)]

    def scores(self):
        field, config = self.core.field, self.core.config
        weeds, some = len(field.weeds), max(self.killed, 1.0)
        inside = np.count_nonzero((field.crops.along_m >= 0.0) & (field.crops.along_m <= config.scenario.strip_m))
        return {
            "net_rate": self.killed / weeds,
            "cycle_time_s": self.last_kill / some,
            "throughput_per_min": 60.0 * self.killed / self.time,
            "duration_s": self.time,
            "done": self.killed,
            "missed": weeds - self.killed,
            "damaged": self.crops,
            "illegal": self.illegal,
            **{f"phase_{name}_s": seconds for name, seconds in self.phases.items()},
            "crop_loss_percent": 100.0 * self.crops / inside,
            "leaf_loss": self.leaves.sum() / inside,
            "joules_per_weed": self.joules / some,
            "ha_per_h": 3600.0 * (self.cart + config.cart.start_m) * config.scenario.band_m / self.time / 1e4,
            "shots": self.shots,
            "blank_shots": self.blanks,
            "shot_time_s": self.last_shot / max(self.shots, 1.0),
            "weeds": weeds,
            "tracks": len(field.reports),
        }


def beset(field):
    """The field with tender crop plants beside every sixth weed."""
    weeds = field.weeds
    near = weeds.along_m[::6] + 0.002, weeds.across_m[::6] + 0.001
    return replace(field, crops=Crops(*near, np.full(len(near[0]), 0.02)))


@pytest.mark.parametrize("name", IDS)
def test_every_feature_and_every_score_by_hand(name):
    # A cart that takes its time: the speed that it has is not the one that was commanded.
    slow = {"cart.acceleration_m_s2": 0.02}
    env: Any = gym.make_vec(f"fieldgym/{name}-v0", 1, vectorization_mode="vector_entry_point", overrides=slow)
    core, rng = env.unwrapped.core, np.random.default_rng(3)
    core.field = beset(core.draw_field(np.random.default_rng(8)))
    core.load(np.zeros(1, np.int64), core.stack([core.field]))
    log, base = Log(core), core.base_actions
    seen = {column: set() for column in core.candidate_features}
    found: dict[str, float] = {}
    for decision in range(260):
        observation = core.observe()
        machine, candidates, legal = features_by_hand(core, log.aimed)
        assert list(machine) == list(core.machine_features)
        assert observation["machine"][0] == pytest.approx(list(machine.values()), rel=1e-6, abs=1e-6)
        table = observation["candidates"][0].reshape(core.config.slots, -1)
        for shown, row in zip(table, candidates, strict=False):
            assert set(row) == set(core.candidate_features)
            assert shown == pytest.approx([row[column] for column in core.candidate_features], rel=1e-6, abs=1e-6)
            for column, value in row.items():
                seen[column].add(value)
        assert not table[len(candidates) :].any()
        mask = observation["action_mask"][0].reshape(-1, base)
        padded = [*legal, *([False] * (base - 1 - len(legal))), True]
        assert all(block.astype(bool).tolist() == padded for block in mask)
        # Now and then what is not possible; else something to work on, where there is.
        able, unable = np.flatnonzero(mask.ravel()), np.flatnonzero(mask.ravel() == 0)
        pool = unable if decision % 15 == 14 and len(unable) else able[:-1] if len(able) > 3 else able
        plan = core.plan(np.array([rng.choice(pool)]))
        result = core.apply(plan, core.nominal(plan))
        log.add(plan, result)
        found = dict(zip(core.score_names, core.scores()[0].tolist(), strict=True))
        assert found == pytest.approx(log.scores(), rel=1e-9, abs=1e-9)
        if result.terminated[0]:
            break
    # Whatever is alike in every candidate would not show in the wrong place.
    assert all(len(values) > 1 for column, values in seen.items() if column != "present")
    cards = found["shots"], found["blank_shots"], found["illegal"], found["damaged"], found["done"], found["missed"]
    assert min(cards) > 0.0 and len(set(cards)) == len(cards)


def test_the_laser_s_doses_are_the_written_ones():
    process = ProcessConfig(dose_j=(10.0, 50.0, 90.0), spot_radius_m=0.004, meristem_m=(0.001, 0.002, 0.005))
    work, radius = Burn.of(process), (0.001, 0.002, 0.005, 0.006)
    for mode, kind, x, y in product(range(3), range(4), (-0.003, 0.0, 0.002), (0.0, 0.001, 0.006)):
        by_hand = (10.0, 50.0, 90.0)[mode] * exp(-2.0 * (x * x + y * y) / (0.004**2 + radius[kind] ** 2))
        assert dose(work, mode, x, y, kind) == pytest.approx(by_hand, rel=1e-12)
        assert dose(work, mode, 0.6 * work.reach_m, 0.8 * work.reach_m, kind) <= 1.0001e-9 * 90.0
    # A dose d kills with the probability 1 / (1 + (ED50 / d)^slope); ED95 is 54 J for two-leaf broadleaves.
    ed50 = 54.0 / 19.0**0.25
    for species, stage, luck in product((0, 1), (0, 1, 2), (0.02, 0.5, 0.95)):
        limit = tolerance(LaserProcess(process).response, species, stage, luck)
        middle = ed50 * (0.4, 1.0, 3.0)[stage] * (1.0, 1.75)[species]
        assert 1.0 / (1.0 + (middle / limit) ** 4.0) == pytest.approx(luck, rel=1e-9)
    for luck in (0.02, 0.5, 0.95):
        limit = crop_tolerance(LaserProcess(process).response, luck)
        assert 1.0 / (1.0 + (20.0 / limit) ** 4.0) == pytest.approx(luck, rel=1e-9)


def test_works_are_noted_whatever_the_order_of_the_tracks():
    rng, process = np.random.default_rng(4), HoeProcessConfig()
    work, half = Stir.of(process), process.response.half_of(*np.indices((2, 3)))
    report = np.column_stack([np.sort(rng.uniform(0.0, 0.09, 12)), rng.uniform(-0.015, 0.015, 12)])
    kinds, seen = rng.integers(0, 2, (12, 2)), np.zeros((12, len(L)), np.float32)
    seen[:, L.grass], seen[np.arange(12), L.cotyledon + kinds[:, 1]] = kinds[:, 0], 1.0
    order = rng.permutation(12)
    mixed, aim = seen[order], report[6] + [0.004, 0.0]
    law: Any = getattr(note, "py_func", note)
    (x, y), own = aim.tolist(), int(np.flatnonzero(order == 6)[0])
    for _ in range(9):
        law(work, half, report, seen, 6, 4, True, 2, x, y)
        law(work, half, report[order], mixed, own, 0, False, 2, x, y)
    share = [
        9.0 * share_by_hand(WorkOf(process), 2, float(at[0] - x), float(at[1] - y), grass, stage)
        for at, (grass, stage) in zip(report, kinds, strict=True)
    ]
    by_hand = np.minimum(share, 10.0) * (np.arange(12) != 6)
    assert mixed[:, L.done] == pytest.approx(by_hand[order]) and 10.0 in by_hand
    # Those before the oldest that is shown are not looked at.
    assert seen[:, L.done] == pytest.approx(by_hand * (np.arange(12) >= 4)) and by_hand[:4].max() > 0.0


class WorkOf(NamedTuple):
    process: Any


def lens_m2(one, other, distance):
    """Area that two discs share, by their circular segments."""
    if distance >= one + other:
        return 0.0
    if distance <= abs(one - other):
        return pi * min(one, other) ** 2
    area = 0.0
    for r, s in ((one, other), (other, one)):
        middle = min((distance**2 + r**2 - s**2) / (2.0 * distance), r)
        area += r * r * acos(middle / r) - middle * sqrt(r * r - middle * middle)
    return area


def test_the_hoe_s_doses_are_the_written_ones():
    process = HoeProcessConfig(root_m=(0.004, 0.012, 0.03), stir_radius_m=(0.004, 0.008, 0.012))
    work, root = Stir.of(process), (0.004, 0.012, 0.03, 0.010)
    for mode, kind, x, y in product(range(3), range(4), (-0.013, 0.0, 0.021), (0.0, 0.008, 0.031)):
        sweep = (0.004, 0.008, 0.012)[mode] + 0.014
        share = lens_m2(sweep, root[kind], hypot(x, y)) / (pi * root[kind] ** 2)
        by_hand = (0.012, 0.022, 0.035)[mode] * share
        assert dose(work, mode, x, y, kind) == pytest.approx(by_hand, rel=1e-9, abs=1e-12)
    for species, stage, luck in product((0, 1), (0, 1, 2), (0.02, 0.5, 0.95)):
        limit = tolerance(HoeProcess(process).response, species, stage, luck)
        middle = 0.006 * (0.5, 1.0, 2.0)[stage] * (1.0, 1.3)[species]
        assert 1.0 / (1.0 + (middle / limit) ** 1.3) == pytest.approx(luck, rel=1e-9)
    for luck in (0.02, 0.5, 0.95):
        limit = crop_tolerance(HoeProcess(process).response, luck)
        assert 1.0 / (1.0 + (0.012 / limit) ** 2.0) == pytest.approx(luck, rel=1e-9)
