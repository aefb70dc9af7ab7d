"""Every feature, reward and score of the transplanter, told again in plain Python from the field and the decisions."""

from dataclasses import replace
from itertools import pairwise
from math import exp, sqrt
from typing import Any

import numpy as np
import pytest

from fieldgym.envs.transplanting.config import (
    DAMAGED,
    EMPTY,
    HEALTHY,
    POOR,
    SCENARIOS,
    PerceptionModel,
    TransplantingConfig,
    Tray,
)
from fieldgym.envs.transplanting.core import TransplantingCore, TransplantOutcome
from fieldgym.envs.transplanting.field import draw

SPEEDS = 3
CONFUSED = (
    ((0.80, 0.15, 0.05), (0.10, 0.75, 0.15), (0.10, 0.30, 0.60)),
    ((0.70, 0.10, 0.20), (0.15, 0.80, 0.05), (0.20, 0.20, 0.60)),
)
"""Cameras that err often, and differently on the two sides."""


def config(scenario: str) -> TransplantingConfig:
    """Small trays that differ, numbers that differ from one another, plugs that suffer often."""
    default = TransplantingConfig()
    trays = {"source": Tray(3, 4, 0.050), "target": Tray(2, 3, 0.070, 0.500, 0.260)}
    return TransplantingConfig(
        scenario=replace(SCENARIOS[scenario], **trays, source_trays=3, target_trays=2, vacancy=0.3, poor=0.2),
        machine=replace(default.machine, tray_centre_m=0.17, conveyor_settle_s=0.13),
        process=replace(
            default.process, extraction=0.8, loss_half_m_s2=50.0, damage_half_m_s2=45.0, grip_s=0.17, illegal_s=0.7
        ),
        weights=replace(default.weights, planted=1.3, spoiled=-0.4, seconds=-0.15),
    )


class Told:
    """One episode: what a machine did and knows, without arrays, tables or kernels."""

    def __init__(self, config: TransplantingConfig, field):
        self.config = config
        (self.n, self.rows_s), (self.m, self.rows_t) = (
            (tray.columns, trays * tray.rows)
            for tray, trays in (
                (config.scenario.source, config.scenario.source_trays),
                (config.scenario.target, config.scenario.target_trays),
            )
        )
        self.luck, self.cells, self.seen = {}, {}, {}
        for side, table, confusion in zip(("source", "target"), (field.source, field.target), CONFUSED, strict=True):
            for i in range(len(table)):
                cell = side, int(table.row[i]), int(table.column[i])
                self.cells[cell] = content = int(table.state[i])
                first, second, _ = confusion[content]
                self.seen[cell] = int(table.lot[i] >= first) + int(table.lot[i] >= first + second)
                if side == "source":
                    self.luck[cell] = float(table.extract[i]), float(table.lose[i]), float(table.damage[i])
        self.source_row = self.target_row = 0
        self.x_m, self.up = 0.0, True
        self.phases = dict.fromkeys(("travel", "carry", "handle", "index", "wait"), 0.0)
        words = "done damaged illegal lost torn wasted cleared transplants travel_m last"
        self.count = dict.fromkeys(words.split(), 0.0)
        self.gaps = self.rows_t * self.m - self.healthy()

    def healthy(self) -> int:
        return sum(side == "target" and content == HEALTHY for (side, _, _), content in self.cells.items())

    @property
    def time_s(self) -> float:
        return sum(self.phases.values())

    def place_m(self, side: str, column: int) -> float:
        tray, sign = (self.config.scenario.source, -1) if side == "source" else (self.config.scenario.target, 1)
        return sign * self.config.machine.tray_centre_m + (column - (tray.columns - 1) / 2) * tray.pitch_m

    def leg_s(self, stroke_m: float, acceleration: float) -> float:
        return max(1.875 * stroke_m / 4.5, sqrt(10.0 / sqrt(3.0) * stroke_m / acceleration))

    def gate(self, x_m: float, up: bool, to_m: float, to_up: bool, acceleration: float) -> tuple[float, float]:
        """Seconds and metres of a gate; standing there already takes nothing."""
        if x_m == to_m and not up and not to_up:
            return 0.0, 0.0
        strokes = 0.15 * (not up), abs(x_m - to_m), 0.15 * (not to_up)
        return sum(self.leg_s(stroke, acceleration) for stroke in strokes), sum(strokes)

    def approach(self, source: int, target: int, clears: bool) -> tuple[float, float]:
        stops = [(self.x_m, self.up)]
        if clears:
            stops += [(self.place_m("target", target), False), (0.0, True)]
        stops.append((self.place_m("source", source), False))
        ways = [self.gate(*a, *b, 60.0) for a, b in pairwise(stops)]
        return sum(s for s, _ in ways), sum(m for _, m in ways)

    def carry(self, source: int, target: int, speed: int) -> tuple[float, float]:
        ends = self.place_m("source", source), False, self.place_m("target", target), False
        return self.gate(*ends, (15.0, 35.0, 60.0)[speed])

    def presented(self, side: str, column: int) -> tuple[str, int, int]:
        return side, self.source_row if side == "source" else self.target_row, column

    def possible(self, source: int, target: int) -> bool:
        seen = self.seen.get(self.presented("source", source)), self.seen.get(self.presented("target", target), HEALTHY)
        return seen[0] != EMPTY and seen[1] != HEALTHY

    def decide(self, action: int) -> tuple[dict[str, float], dict[str, float]]:
        """Carry an action out; gives the rewards and the seconds by phase."""
        before, healthy_before = dict(self.phases), self.healthy()
        pair, speed = divmod(action, SPEEDS)
        source, target = divmod(pair, self.m)
        spoiled = 0.0
        if pair < self.n * self.m and self.possible(source, target):
            spoiled = self.transplant(source, target, speed)
        elif pair < self.n * self.m or (speed == 0 and self.source_row + 1 == self.rows_s):
            self.phases["wait"] += self.config.process.illegal_s
            self.count["illegal"] += 1
        else:
            spoiled = self.move_on("source" if speed == 0 else "target")
        phases = {name: seconds - before[name] for name, seconds in self.phases.items()}
        weights = self.config.weights
        rewards = {
            "planted": weights.planted * (self.healthy() - healthy_before),
            "spoiled": weights.spoiled * spoiled,
            "time": weights.seconds * sum(phases.values()),
        }
        if "planted just now" in self.count:
            del self.count["planted just now"]
            self.count["last"] = self.time_s
        return rewards, phases

    def transplant(self, source: int, target: int, speed: int) -> float:
        process, count = self.config.process, self.count
        here, there = self.presented("source", source), self.presented("target", target)
        plug, before, clears = self.cells[here], self.cells[there], self.seen[there] == POOR
        extract, lose, damage = self.luck[here]
        seconds, metres = self.approach(source, target, clears)
        self.phases["travel"] += seconds
        count["travel_m"] += metres
        count["transplants"] += 1
        self.x_m, self.up = self.place_m("source", source), False
        self.phases["handle"] += process.grip_s + clears * (process.grip_s + process.release_s)
        if clears:
            count["cleared"] += before != EMPTY
            self.cells[there], self.seen[there] = EMPTY, EMPTY
        looked = self.seen[here]
        self.cells[here] = self.seen[here] = EMPTY
        if plug == EMPTY or extract >= process.extraction:
            count["torn"] += plug != EMPTY
            count["damaged"] += plug != EMPTY
            return float(plug == HEALTHY)
        seconds, metres = self.carry(source, target, speed)
        self.phases["carry"] += seconds
        self.phases["handle"] += process.release_s
        count["travel_m"] += metres
        self.x_m = self.place_m("target", target)
        acceleration = (15.0, 35.0, 60.0)[speed]
        if lose < 1.0 / (1.0 + exp((process.loss_half_m_s2 - acceleration) / process.loss_width_m_s2)):
            count["lost"] += 1
            return float(plug == HEALTHY)
        self.seen[there] = looked
        crushed = self.cells[there]
        hurt = damage < 1.0 / (1.0 + exp((process.damage_half_m_s2 - acceleration) / process.damage_width_m_s2))
        if crushed != EMPTY or hurt:
            count["damaged"] += 2 if crushed == HEALTHY else 1
            plug_now = DAMAGED
        else:
            plug_now = plug
        self.cells[there] = plug_now
        if plug_now == HEALTHY:
            count["done"] += 1
            count["planted just now"] = 1.0
            return 0.0
        return float(plug == HEALTHY)

    def move_on(self, side: str) -> float:
        """Send the presented row of a side away; gives the healthy seedlings that leave unused."""
        machine, scenario = self.config.machine, self.config.scenario
        if not self.up:
            self.phases["travel"] += self.leg_s(0.15, 60.0)
            self.count["travel_m"] += 0.15
            self.up = True
        tray, row = (scenario.source, self.source_row) if side == "source" else (scenario.target, self.target_row)
        stroke = tray.pitch_m
        if (row + 1) % tray.rows == 0:
            stroke = tray.length_m - (tray.rows - 1) * tray.pitch_m + machine.tray_gap_m
        moving = max(
            1.875 * stroke / machine.conveyor_velocity_m_s,
            sqrt(10.0 / sqrt(3.0) * stroke / machine.conveyor_acceleration_m_s2),
        )
        self.phases["index"] += moving + machine.conveyor_settle_s
        if side == "target":
            self.target_row += 1
            return 0.0
        wasted = sum(self.cells["source", row, column] == HEALTHY for column in range(self.n))
        self.count["wasted"] += wasted
        self.source_row += 1
        return float(wasted)

    def machine(self) -> dict[str, Any]:
        target = [self.seen.get(self.presented("target", column), HEALTHY) for column in range(self.m)]
        return {
            "place": self.x_m / 0.3,
            "down": float(not self.up),
            "time": self.time_s / self.config.scenario.time_limit_s,
            "source_rows": (self.rows_s - self.source_row - 1) / self.rows_s,
            "target_rows": (self.rows_t - self.target_row - 1) / self.rows_t,
            "ready": np.mean([self.seen[self.presented("source", i)] != EMPTY for i in range(self.n)]),
            "gaps": np.mean([report != HEALTHY for report in target]),
        }

    def candidate(self, pair: int) -> dict[str, float]:
        source, target = divmod(pair, self.m)
        if not self.possible(source, target):
            names = "present source target carry approach source_poor clear"
            return dict.fromkeys(names.split(), 0.0)
        clears = self.seen[self.presented("target", target)] == POOR
        return {
            "present": 1.0,
            "source": self.place_m("source", source) / 0.3,
            "target": self.place_m("target", target) / 0.3,
            "carry": self.carry(source, target, 1)[0],
            "approach": self.approach(source, target, clears)[0],
            "source_poor": float(self.seen[self.presented("source", source)] == POOR),
            "clear": float(clears),
        }

    def scores(self) -> dict[str, float]:
        cells, healthy, count = self.rows_t * self.m, self.healthy(), self.count
        named = {name: count[name] for name in count if name not in ("last", "planted just now")}
        return {
            **named,
            **{f"phase_{name}_s": seconds for name, seconds in self.phases.items()},
            "net_rate": healthy / cells,
            "cycle_time_s": count["last"] / max(count["done"], 1.0),
            "throughput_per_min": 60.0 * count["done"] / max(self.time_s, 1e-9),
            "duration_s": self.time_s,
            "missed": cells - healthy,
            "healthy": healthy,
            "cells": cells,
            "gaps": self.gaps,
            "filled": 1.0 - (cells - healthy) / max(self.gaps, 1.0),
        }


def by_name(names: tuple[str, ...], values) -> dict[str, float]:
    return dict(zip(names, np.asarray(values).tolist(), strict=True))


def hold_together(scenario: str, seed: int) -> dict[str, float]:
    """Play an episode at random and compare at every decision; gives the scorecard."""
    work = config(scenario)
    field = draw(work, np.random.default_rng(seed))
    core = TransplantingCore(work, PerceptionModel(*CONFUSED), 1)
    core.load(np.array([0]), core.stack([field]))
    told, rng = Told(work, field), np.random.default_rng([seed, 1])
    over = False
    while not over:
        observation = core.observe()
        assert by_name(core.machine_features, observation["machine"][0]) == pytest.approx(told.machine(), abs=1e-5)
        for pair, row in enumerate(observation["candidates"][0].reshape(told.n * told.m, -1)):
            assert by_name(core.candidate_features, row) == pytest.approx(told.candidate(pair), abs=1e-5)
        mask = [int(told.possible(*divmod(pair, told.m))) for pair in range(told.n * told.m) for _ in range(SPEEDS)]
        more = told.source_row + 1 < told.rows_s
        assert observation["action_mask"][0].tolist() == [*mask, int(more), 1]
        # Possible pairs most of the time, then a conveyor; now and then anything at all.
        pairs, chance = np.flatnonzero(mask), rng.random()
        action = int(rng.choice(pairs)) if len(pairs) and chance < 0.8 else len(mask) + int(not more or chance > 0.85)
        action = int(rng.integers(len(mask) + 2)) if chance > 0.95 else action
        plan = core.plan(np.array([action]))
        result = core.apply(plan, TransplantOutcome(plan.phases_s, np.zeros((1, 2))))
        rewards, phases = told.decide(action)
        assert by_name(core.reward_names, result.rewards[0]) == pytest.approx(rewards, abs=1e-9)
        assert by_name(core.phase_names, result.phases_s[0]) == pytest.approx(phases, abs=1e-9)
        assert by_name(core.score_names, core.scores()[0]) == pytest.approx(told.scores(), abs=1e-9)
        over = bool(result.terminated[0])
        assert over == (told.target_row == told.rows_t)
    return told.scores()


@pytest.mark.parametrize("scenario", ["fill-high", "replug-high"])
def test_features_rewards_and_scores_are_what_plain_python_makes_of_field_and_decisions(scenario):
    cards = [hold_together(scenario, seed) for seed in range(12)]
    for name in ("done", "damaged", "illegal", "lost", "torn", "wasted", "cleared", "phase_index_s", "phase_wait_s"):
        assert sum(card[name] for card in cards) > 0.0, f"{name} was never put to the test"
