"""Every feature, reward and score of the picker, reckoned a second time from the field and the actions alone."""

import math
from itertools import pairwise
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.envs.columns import documented, names
from fieldgym.envs.safflower.drawing import reach_table
from fieldgym.envs.safflower.env import SafflowerPickingEnv
from fieldgym.envs.safflower.features import Candidate, Machine
from fieldgym.envs.safflower.state import Effort, Rewards, Scores, Totals
from fieldgym.envs.safflower.timing import Phases

ID = "fieldgym/SafflowerPicking-v0"
BLOCKS = (Machine, Candidate, Rewards, Effort, Totals, Scores, Phases)
STAGES = ("bud", "fresh", "late", "dry")


class Oracle:
    """A picker in plain Python, as the papers and the environment's page describe it."""

    def __init__(self, config: Any, field: Any):
        """Stand at the first stop of a field whose reports are in the fixed order."""
        self.config, self.scenario, self.process = config, config.scenario, config.process
        self.middle_m = 0.5 * config.machine.picker.five_bar.base_m
        heads, reports = field.heads, field.reports
        self.mass = heads.mass_g.tolist()
        self.total = sum(self.mass)
        self.heads, self.visited, self.picked = heads, set(), []
        self.reports = [
            {name: getattr(reports, name)[row] for name in reports.columns()} for row in range(len(reports.head))
        ]
        self.clock = self.process.recognise_s
        self.phases: dict[str, float] = dict.fromkeys(("recognise", "drive", "travel", "settle", "shear", "suck"), 0.0)
        self.phases["recognise"] = self.clock
        self.counts = dict.fromkeys(("damaged", "illegal", "wasted"), 0)
        self.last = self.box = self.floor = 0.0
        self.go_to(0)
        self.place = (self.look(0), 0.0, config.machine.clear_level_m)

    def centre(self, stop: int) -> float:
        return self.scenario.window_m * (stop + (0.0 if self.scenario.potted else 0.5))

    def look(self, stop: int) -> float:
        return self.centre(stop) - self.config.machine.picker.camera_ahead_m

    def go_to(self, stop: int) -> None:
        self.stop, window = stop, self.scenario.window_m
        edge = self.centre(0) - 0.5 * window
        self.open = [
            report
            for report in self.reports
            if min(max(math.floor((report["along_m"] - edge) / window), 0), self.scenario.stops - 1) == stop
        ]
        self.slots = self.open[: self.config.slots]

    def motion(self, what: str, stroke: float) -> float:
        picker = self.config.machine.picker
        v, a = (getattr(picker, f"{what}_{limit}") for limit in ("velocity_m_s", "acceleration_m_s2"))
        return max(15.0 / 8.0 * abs(stroke) / v, math.sqrt(10.0 / math.sqrt(3.0) * abs(stroke) / a))

    def travel(self, target: tuple[float, float, float]) -> tuple[float, float, float]:
        """Rise, the move side by side, and descent."""
        clear = self.config.machine.clear_level_m
        rise, descent = (self.motion("tool", max(clear - at[2], 0.0)) for at in (self.place, target))
        along, across = target[0] - self.place[0], target[1] - self.place[1]
        return rise, max(self.motion("cart", along), self.motion("tool", across)), descent

    def target(self, report: dict[str, Any]) -> tuple[float, float, float]:
        """Cart, across from the middle, and level below the motors."""
        return report["along_m"], report["across_m"], report["up_m"] - self.scenario.motor_height_m

    def reachable(self, report: dict[str, Any]) -> bool:
        _, across, level = self.target(report)
        if level > self.config.machine.clear_level_m:
            return False
        bar = self.config.machine.picker.five_bar
        near, far = bar.reachable(np.array([[self.middle_m + abs(across) + off, level] for off in (-1e-3, 1e-3)]))
        # The rules look reach up in a table, which is held against the mechanism elsewhere: it decides at the edge.
        return bool(near) if near == far else bool(abs(across) <= np.interp(level, *reach_table(bar)))

    def observe(self) -> tuple[dict[str, float], list[dict[str, float]]]:
        clear, k = self.config.machine.clear_level_m, self.config.slots
        machine = {
            "ahead": (self.place[0] - self.centre(self.stop)) / 0.3,
            "across": self.place[1] / 0.15,
            "height": (self.place[2] - clear) / 0.2,
            "time": self.clock / self.scenario.time_limit_s,
            "stops_left": (self.scenario.stops - 1 - self.stop) / self.scenario.stops,
            "remaining": len(self.open) / k,
        }
        candidates = []
        for report in self.slots:
            target = self.target(report)
            row = {
                "present": 1.0,
                "along": (target[0] - self.place[0]) / 0.3,
                "across": target[1] / 0.15,
                "height": (target[2] - clear) / 0.2,
                "travel": sum(self.travel(target)) / 4.0,
                "size": report["size_m"] / 0.05,
                "reachable": float(self.reachable(report)),
            }
            row |= {stage: float(STAGES[report["stage"]] == stage) for stage in STAGES}
            candidates.append(row)
        return machine, candidates

    def cut(self, head: int, report: dict[str, Any], effort: int) -> tuple[float, float]:
        """Grams cut and grams collected."""
        process, heads = self.process, self.heads
        off = [getattr(heads, name)[head] - report[name] for name in ("along_m", "across_m", "up_m")]
        radial = math.hypot(off[0], off[1])
        if radial > process.capture_radius_m:
            return 0.0, 0.0
        each = process.stroke_cut * math.exp(-0.5 * (radial / process.cut_radius_m) ** 2)
        each *= math.exp(-0.5 * (off[2] / process.cut_height_m) ** 2)
        share = with_luck(1.0 - (1.0 - each) ** process.strokes[effort], process.luck_logit * heads.cut_luck[head])
        lost = process.suction_loss * math.exp(-process.suction_s[effort] / process.suction_decay_s)
        kept = with_luck(1.0 - lost, process.luck_logit * heads.drop_luck[head])
        return self.mass[head] * share, self.mass[head] * share * kept

    def step(self, action: int) -> dict[str, float]:
        """The reward's terms of a decision."""
        slot, effort = divmod(action, 3)
        spent: dict[str, float] = dict.fromkeys(self.phases, 0.0)
        terms = {"collected": 0.0, "lost": 0.0}
        if slot == self.config.slots:
            last = self.stop + 1 == self.scenario.stops
            clear = self.config.machine.clear_level_m
            target = (self.place[0], self.place[1], clear) if last else (self.look(self.stop + 1), 0.0, clear)
            rise, spent["drive"], spent["travel"] = self.travel(target)
            spent["travel"] += rise
            spent["recognise"] = 0.0 if last else self.process.recognise_s
            self.arrive(target, spent)
            if not last:
                self.go_to(self.stop + 1)
        elif slot >= len(self.slots) or not self.reachable(self.slots[slot]):
            spent["recognise"] = self.process.illegal_s
            self.arrive(self.place, spent)
            self.counts["illegal"] += 1
        else:
            report = self.slots[slot]
            spent["travel"] = sum(self.travel(self.target(report)))
            spent["recognise"] = self.process.locate_s
            spent["shear"] = self.process.strokes[effort] * self.process.stroke_m / self.process.shear_speed
            spent["suck"] = self.process.suction_s[effort]
            self.arrive(self.target(report), spent)
            self.open = [other for other in self.open if other is not report]
            self.slots = [other for other in self.slots if other is not report]
            self.slots += self.open[len(self.slots) : self.config.slots]
            terms |= self.pick(report, effort)
        weights = self.config.weights
        return {
            "collected": terms["collected"] * weights.collected_g,
            "lost": terms["lost"] * weights.lost_g,
            "time": sum(spent.values()) * weights.seconds,
        }

    def arrive(self, target: tuple[float, float, float], spent: dict[str, float]) -> None:
        if abs(target[0] - self.place[0]) > 1e-4:
            spent["settle"] = self.config.machine.settle_s
        for name, seconds in spent.items():
            self.phases[name] += seconds
        self.clock += sum(spent.values())
        self.place = target

    def pick(self, report: dict[str, Any], effort: int) -> dict[str, float]:
        head = int(report["head"])
        if head < 0:
            self.counts["wasted"] += 1
            return {}
        before, (cut, gained) = self.mass[head], self.cut(head, report, effort)
        stage = STAGES[self.heads.stage[head]]
        captured = (
            math.hypot(self.heads.along_m[head] - report["along_m"], self.heads.across_m[head] - report["across_m"])
            <= self.process.capture_radius_m
        )
        self.counts["damaged"] += captured and stage == "bud" and head not in self.visited
        self.mass[head] -= cut
        self.box, self.floor = self.box + gained, self.floor + cut - gained
        if not captured or head in self.visited or gained == 0.0:
            self.visited |= {head} if captured else set()
            self.counts["wasted"] += 1
            return {"collected": gained}
        self.visited.add(head)
        self.picked.append(head)
        self.last = self.clock
        return {"collected": gained, "lost": before - gained}

    def scores(self) -> dict[str, float]:
        open_heads = np.count_nonzero(self.heads.mass_g)
        return {
            "net_rate": self.box / self.total,
            "cycle_time_s": self.last / max(len(self.picked), 1),
            "throughput_per_min": len(self.picked) / (self.clock / 60.0),
            "duration_s": self.clock,
            "done": len(self.picked),
            "missed": open_heads - len(self.picked),
            **self.counts,
            **{f"phase_{name}_s": seconds for name, seconds in self.phases.items()},
            "collected_g": self.box,
            "dropped_g": self.floor,
            "total_g": self.total,
            "grams_per_min": self.box / (self.clock / 60.0),
            "stop": self.stop,
        }


def with_luck(share: float, logit: float) -> float:
    """A share whose logit is moved."""
    return 1.0 / (1.0 + (1.0 - share) / share * math.exp(-logit)) if share > 0.0 else 0.0


@pytest.mark.parametrize(("scenario", "slots"), [("pots", 16), ("row-dense", 4), ("row-sparse", 1), ("row", 16)])
def test_features_rewards_and_scores_are_what_their_names_say(scenario, slots):
    env: Any = gym.make(ID, scenario=scenario, slots=slots, backend="analytic", disable_env_checker=True).unwrapped
    rng, kinds = np.random.default_rng(5), set()
    for seed in range(3):
        observation, info = env.reset(seed=seed)
        core, oracle, over = env.core, Oracle(env.core.config, env.field), False
        while not over:
            machine, candidates = oracle.observe()
            shown = dict(zip(core.machine_features, observation["machine"].tolist(), strict=True))
            assert shown == pytest.approx({name: min(value, 10.0) for name, value in machine.items()}, abs=2e-6)
            table = observation["candidates"].reshape(slots, -1)
            for row, expected in zip(table, candidates, strict=False):
                assert dict(zip(core.candidate_features, row.tolist(), strict=True)) == pytest.approx(
                    expected, abs=2e-6
                )
            assert not table[len(candidates) :].any()
            assert info["scorecard"] == pytest.approx(oracle.scores(), rel=1e-9, abs=1e-9)
            legal = observation["action_mask"] > 0
            assert legal[:-1:3].tolist() == [row["reachable"] > 0.0 for row in candidates] + [False] * (
                slots - len(candidates)
            )
            likely = np.where(legal, 1.0, 0.02)
            likely[-1] = 0.3
            action = int(rng.choice(len(likely), p=likely / likely.sum()))
            kinds.add((action % 3) if action < 3 * slots else 3)
            observation, reward, terminated, truncated, info = env.step(action)
            expected = oracle.step(action)
            assert info["rewards"] == pytest.approx(expected, rel=1e-9, abs=1e-12)
            assert reward == pytest.approx(sum(expected.values()), rel=1e-9, abs=1e-12)
            assert sum(info["phases_s"].values()) * core.config.weights.seconds == pytest.approx(expected["time"])
            over = terminated or truncated
            assert truncated == (oracle.clock >= core.config.scenario.time_limit_s and not terminated)
    assert kinds == {0, 1, 2, 3}


@pytest.mark.parametrize("block", BLOCKS)
def test_every_number_of_a_block_is_documented(block):
    assert all(says.doc and says.low < says.high for says in documented(block).values())


def test_phases_stand_in_the_same_order_everywhere():
    phases = names(Phases)
    totals = Totals._fields[Totals._fields.index("recognise") :][: len(phases)]
    scores = Scores._fields[Scores._fields.index("phase_recognise_s") :][: len(phases)]
    assert phases == totals and tuple(f"phase_{name}_s" for name in phases) == scores
    assert all(a < b for a, b in pairwise(map(Candidate._fields.index, STAGES)))


def test_the_page_names_every_feature_in_order():
    page = SafflowerPickingEnv.__doc__ or ""
    for block, start in ((Machine, "``machine``"), (Candidate, "``candidates``"), (Rewards, "**Reward**")):
        place = page.index(start) + len(start)
        for name in names(block):
            assert f"``{name}``" in page[place:], name
            place = page.index(f"``{name}``", place)
    for name in Scores._fields[:2]:
        assert f"``{name}``" in page
