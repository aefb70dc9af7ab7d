"""Every number of produce sorting against its own formula, written down a second time without the package's kernels."""

import math
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.envs.columns import documented
from fieldgym.envs.sorting.columns import (
    Candidate,
    Item,
    Machine,
    Number,
    Phases,
    Report,
    Rewards,
    Scores,
    Totals,
    Truth,
    candidate_table,
)
from fieldgym.envs.sorting.config import (
    GRADES,
    BeltConfig,
    GripConfig,
    MachineConfig,
    PerceptionModel,
    ProduceConfig,
    ScenarioConfig,
    SortingConfig,
)
from fieldgym.envs.sorting.field import ProduceField, Reports
from fieldgym.envs.sorting.process import Fingers, grip_quality, holds, slips
from fieldgym.envs.sorting.reach import TILTS_RAD, YAWS_RAD, radii
from fieldgym.kernels.config import ConfigError, override
from fieldgym.kernels.config_fields import dotted, entries
from fieldgym.motion import QUINTIC
from fieldgym.motion.orientation import angle_between, axes, tilted

ID = "fieldgym/ProduceSorting-v0"
CONFIG = SortingConfig()
SPEED = CONFIG.belt.speed_m_s
SORTER, MACHINE, GRIP = CONFIG.machine.sorter, CONFIG.machine, CONFIG.grip


def quintic_s(stroke: float, follows: bool = True) -> float:
    """The quintic law under the limits; what follows the belt keeps its speed back."""
    return float(QUINTIC.duration(stroke, SORTER.velocity_m_s - SPEED * follows, SORTER.acceleration_m_s2))


def turn_s(angle_rad: float) -> float:
    duration = float(QUINTIC.duration(angle_rad, SORTER.turn_rad_s, SORTER.turn_rad_s2))
    return max(duration, MACHINE.shortest_move_s)


def reach(tilt: float, yaw: float) -> float:
    """Bilinear in the table of radii."""
    table = radii(SORTER.mechanism, MACHINE.travel_level_m + 0.005)
    along_yaw = [np.interp(abs(yaw), YAWS_RAD, row) for row in table]
    return float(np.interp(tilt, TILTS_RAD, along_yaw))


class Seen:
    """What follows from one report, by the rules' description."""

    def __init__(self, reports: Reports, row: int):
        said = {name: values[row].item() for name, values in reports.arrays().items()}
        self.said, self.grade = said, int(said["grade"])
        yaw = (said["yaw_rad"] + math.pi / 2) % math.pi - math.pi / 2
        limited = min(max(yaw, -MACHINE.yaw_limit_rad), MACHINE.yaw_limit_rad)
        tilt = min(said["tilt_rad"], MACHINE.tilt_limit_rad)
        self.yaw, self.turn = yaw, tilted(tilt, said["azimuth_rad"], limited)
        up = axes(self.turn)[:, 2]
        self.passing_s = said["passing_s"] - SORTER.tool_m * up[0] / SPEED
        self.across_m = said["across_m"] + SORTER.tool_m * up[1]
        height = said["up_m"] + SORTER.tool_m * up[2] - SORTER.origin_above_belt_m
        down = quintic_s(MACHINE.travel_level_m - min(max(height, 0.0), MACHINE.travel_level_m), False)
        self.hold_s, self.descend_s = 2.0 * down + GRIP.grip_s, down
        half = math.sqrt(max(reach(tilt, limited) ** 2 - self.across_m**2, 0.0))
        self.first_m, self.last_m = -half, half - 0.006 - SPEED * self.hold_s
        leans = said["tilt_rad"] > MACHINE.tilt_limit_rad + GRIP.refused_tilt_rad
        self.fits = not leans and self.last_m > -half
        self.leave_s = self.passing_s + (self.last_m if self.fits else 0.10) / SPEED
        misfit = (
            (1.0 - said["width"]) * math.sin(yaw - limited),
            (1.0 - said["thickness"]) * math.sin(said["tilt_rad"] - tilt),
        )
        self.quality = GRIP.best * math.exp(-0.5 * (misfit[0] ** 2 + misfit[1] ** 2) / GRIP.misfit_sigma**2)

    def features(self, time_s: float, place: np.ndarray, turn: np.ndarray) -> dict[str, float]:
        """By name, unscaled where the scale is one."""
        level = np.array([1.0, 0.0, 0.0, 0.0])
        least, now = turn_s(float(angle_between(turn, self.turn))), (time_s - self.passing_s) * SPEED
        approach = least + 0.15
        for _ in range(2):
            meet = max(now + SPEED * approach, self.first_m)
            way = math.hypot(meet - place[0] - 0.5 * SPEED * approach, self.across_m - place[1])
            approach = max(quintic_s(way), least)
        meet = max(now + SPEED * approach, self.first_m)
        wait = max((meet - now) / SPEED - approach, 0.0)
        bin_x, bin_y = CONFIG.belt.bins_m[self.grade]
        back = turn_s(float(angle_between(level, self.turn)))
        carry = max(quintic_s(math.hypot(bin_x, bin_y - self.across_m)), back)
        for _ in range(2):
            along = bin_x - meet - SPEED * self.hold_s - 0.5 * SPEED * carry
            carry = max(quintic_s(math.hypot(along, bin_y - self.across_m)), back)
        possible = self.fits and meet <= self.last_m
        slack = self.passing_s + self.last_m / SPEED - time_s - approach if self.fits else -4.0
        self.times = {"wait": wait, "approach": approach, "descend": self.descend_s, "grip": GRIP.grip_s}
        self.times |= {"lift": self.descend_s, "carry": carry, "release": GRIP.release_s}
        return {
            "present": 1.0,
            "along": now / 0.2,
            "across": self.across_m / 0.2,
            "cos_2yaw": math.cos(2.0 * self.yaw),
            "sin_2yaw": math.sin(2.0 * self.yaw),
            "tilt": self.said["tilt_rad"] / 0.35,
            "turn": float(angle_between(level, self.turn)),
            "length": self.said["length_m"] / 0.06,
            **{name: float(grade == self.grade) for grade, name in enumerate(GRADES)},
            "value": CONFIG.produce.value[self.grade],
            "quality": self.quality,
            "approach": approach,
            "wait": wait / 4.0,
            "cycle": (wait + approach + self.hold_s + carry + GRIP.release_s) / 2.0,
            "slack": max(slack, -4.0) / 4.0,
            "possible": float(possible),
        }


@pytest.mark.parametrize("perception", ["perfect", "model"])
def test_every_feature_and_score_is_recomputed_from_the_field_and_the_decisions(perception):
    env: Any = gym.make(ID, backend="analytic", perception=perception).unwrapped
    counts = [recomputed(env, seed) for seed in range(14, 19)]
    total = {name: sum(count[name] for count in counts) for name in counts[0]}
    assert total["placed"] > 50 and total["wasted"] > 0 and total["dropped"] > 0 and total["illegal"] > 10
    assert (total["misplaced"] > 0) == (perception == "model")


def recomputed(env: Any, seed: int) -> dict[str, int]:
    """Plays an episode beside its recomputation; gives what was counted."""
    observation, info = env.reset(seed=seed)
    field: ProduceField = env.field
    assert field.reports is not None
    said, core = [Seen(field.reports, row) for row in range(len(field.reports))], env.core
    rng, tried, log = np.random.default_rng(seed), set(), Log(field)
    over = False
    while not over:
        time_s, place, turn = log.time_s, core.state.place[0].copy(), core.state.turn[0].copy()
        there = [k for k, seen in enumerate(said) if k not in tried and seen.leave_s > time_s]
        shown = sorted((k for k in there if said[k].said["seen_s"] <= time_s), key=lambda k: said[k].leave_s)[:12]
        table = candidate_table(observation)
        for slot, report in enumerate(shown):
            expected = said[report].features(time_s, place, turn)
            found = dict(zip(core.candidate_features, table[slot].tolist(), strict=True))
            assert found == pytest.approx(expected, rel=1e-5, abs=2e-6)
            assert observation["action_mask"][slot] == expected["possible"]
        assert not table[len(shown) :].any() and not observation["action_mask"][len(shown) : -1].any()
        machine = dict(zip(core.machine_features, observation["machine"].tolist(), strict=True))
        wanted = {"x": place[0] / 0.2, "y": place[1] / 0.2, "turned": math.sqrt(max(1.0 - turn[0] ** 2, 0.0))}
        wanted |= {"time": time_s / CONFIG.scenario.time_limit_s, "in_view": len(shown) / 12}
        assert machine == pytest.approx(wanted, rel=1e-6, abs=1e-6)
        legal = np.flatnonzero(observation["action_mask"])
        action = int(rng.integers(13)) if rng.random() < 0.2 else int(rng.choice(legal))
        possible = action < 12 and observation["action_mask"][action]
        observation, _, over, _, info = env.step(action)
        if action == 12 or not possible:
            nothing = dict.fromkeys(Phases._fields, 0.0) | {"wait": GRIP.wait_s if action == 12 else GRIP.illegal_s}
            assert info["phases_s"] == pytest.approx(nothing)
            log.note(info["phases_s"], info["rewards"], illegal=action != 12)
        else:
            report = shown[action]
            tried.add(report)
            said[report].features(time_s, place, turn)
            times, fate = said[report].times, log.fate(said[report], field)
            if fate == "wasted":
                times |= {"carry": MACHINE.stop_s, "release": 0.0}
            assert info["phases_s"] == pytest.approx(times, rel=1e-9, abs=1e-12)
            paid = {"placed": CONFIG.produce.value[said[report].grade], "misplaced": -0.5, "dropped": -0.5}
            paid = {"wasted": -0.05, **paid}
            assert info["rewards"] == pytest.approx({name: paid[name] * (name == fate) for name in Rewards._fields})
            log.note(info["phases_s"], info["rewards"], fate=fate, value=CONFIG.produce.value[said[report].grade])
        assert info["scorecard"] == pytest.approx(log.scores(), rel=1e-9, abs=1e-12)
    return log.count


class Log:
    """What was decided so far, and the scorecard that follows from it."""

    def __init__(self, field: ProduceField):
        self.items, self.time_s, self.value = field.items, 0.0, 0.0
        self.last_s: dict[str, float] = dict.fromkeys(("placed", "misplaced", "dropped", "wasted"), 0.0)
        self.count: dict[str, int] = dict.fromkeys((*Rewards._fields, "illegal"), 0)
        self.phases: dict[str, float] = dict.fromkeys(Phases._fields, 0.0)
        self.gone = set()

    def note(self, phases: dict, rewards: dict, fate: str = "", value: float = 0.0, illegal: bool = False) -> None:
        for name, seconds in phases.items():
            self.phases[name] += seconds
        self.time_s += sum(phases.values())
        self.count["illegal"] += illegal
        if fate:
            self.count[fate] += 1
            self.last_s[fate] = self.time_s
        self.value += value * (fate == "placed")

    def fate(self, seen: Seen, field: ProduceField) -> str:
        """What comes of a grip with the tool where the report says; by the field's luck."""
        item = int(seen.said["item"])
        if item < 0 or item in self.gone:
            return "wasted"
        lies = {name: values[item].item() for name, values in field.items.arrays().items()}
        tool = axes(seen.turn)
        along = SPEED * (lies["passing_s"] - seen.passing_s) - lies["slip_along_m"] - SORTER.tool_m * tool[0, 2]
        aside = seen.across_m - SORTER.tool_m * tool[1, 2] - lies["across_m"] - lies["slip_across_m"]
        height = seen.said["up_m"] + SORTER.tool_m * tool[2, 2] - SORTER.origin_above_belt_m
        height = min(max(height, 0.0), MACHINE.travel_level_m) - SORTER.tool_m * tool[2, 2]
        up = height - (lies["up_m"] - SORTER.origin_above_belt_m)
        true = axes(tilted(lies["tilt_rad"], lies["azimuth_rad"], lies["yaw_rad"]))
        aslant = [1.0 - (tool[:, axis] @ true[:, axis]) ** 2 for axis in (0, 2)]
        misfit = aslant[0] * (1.0 - lies["width"]) ** 2 + aslant[1] * (1.0 - lies["thickness"]) ** 2
        quality = law(along, aside, up, misfit)
        if not lies["grip_luck"] < GRIP.best * quality:
            return "wasted"
        self.gone.add(item)
        if lies["way_luck"] < GRIP.slip * (1.0 - quality):
            return "dropped"
        return "placed" if lies["grade"] == seen.grade else "misplaced"

    def scores(self) -> dict[str, float]:
        count, items = self.count, len(self.items)
        put_down = count["placed"] + count["misplaced"]
        minutes = max(self.time_s, 1e-9) / 60.0
        worth = sum(CONFIG.produce.value[grade] for grade in self.items.grade.tolist())
        return {
            "net_rate": count["placed"] / items,
            "cycle_time_s": self.last_s["placed"] / max(count["placed"], 1),
            "throughput_per_min": count["placed"] / minutes,
            "duration_s": self.time_s,
            "done": count["placed"],
            "missed": items - put_down - count["dropped"],
            "damaged": count["dropped"],
            "illegal": count["illegal"],
            **{f"phase_{name}_s": seconds for name, seconds in self.phases.items()},
            "value_rate": self.value / worth,
            "misplaced": count["misplaced"],
            "wasted": count["wasted"],
            "total": items,
            "picks_per_min": put_down / minutes,
            "pick_cycle_s": max(self.last_s["placed"], self.last_s["misplaced"]) / max(put_down, 1),
        }


def law(along_m: float, across_m: float, up_m: float, misfit: float) -> float:
    """The formula of the fingers, as it stands in the documentation."""
    radial = math.hypot(along_m, across_m)
    if radial > GRIP.capture_m:
        return 0.0
    squares = (radial / GRIP.centre_sigma_m) ** 2 + (up_m / GRIP.height_sigma_m) ** 2 + misfit / GRIP.misfit_sigma**2
    return math.exp(-0.5 * squares)


def test_the_fingers_follow_their_law_on_a_grid():
    fingers = Fingers.of(GripConfig())
    for along in (-0.03, -0.012, 0.0, 0.009, 0.0249):
        for across in (-0.011, 0.0, 0.003):
            for up in (-0.02, 0.0, 0.007):
                for misfit in (0.0, 0.01, 0.2):
                    quality = law(along, across, up, misfit)
                    assert grip_quality(fingers, along, across, up, misfit) == pytest.approx(quality, rel=1e-12)
                    for luck in (0.0, 0.1, 0.5, 0.97, 0.99):
                        assert holds(fingers, quality, luck) == (luck < 0.98 * quality)
                        assert slips(fingers, quality, luck) == (luck < 0.35 * (1.0 - quality))


@pytest.mark.parametrize(
    "block",
    [Item, Report, Truth, Number, Phases, Rewards, Totals, Scores, Machine, Candidate],
    ids=lambda b: b.__name__,
)
def test_every_number_says_what_it_is(block):
    assert all(said.doc and said.scale > 0.0 and said.low < said.high for said in documented(block).values())


POOL = (math.nan, math.inf, -math.inf, None, "7", "", True, 0, -1, 1e-9, 1e9, 10**400, (), (1.0,), [math.nan] * 4, {})


def leaves() -> list[str]:
    return dotted(SortingConfig)


def tries(name: str) -> list[Any]:
    """Nonsense, the ends of the declared range, and both in place of each number of a tuple."""
    owner: Any = CONFIG
    *path, last = name.split(".")
    for part in path:
        owner = getattr(owner, part)
    value, declared = getattr(owner, last), entries(type(owner))[last].declared
    ends = [end for end in (declared.low, declared.high) if math.isfinite(end)]
    if type(value) is int:
        ends = [int(end) for end in ends]
    found = [*POOL, *ends]
    if isinstance(value, tuple):
        flat = [part for part in POOL[:9]] + ends
        found += [(part, *value[1:]) for part in flat] + [type(value)([part] * len(value)) for part in flat]
    return found


def played(name: str, value: Any) -> bool:
    """Whether a setting is taken; then a few decisions go well with it."""
    try:
        config = override(CONFIG, {name: value})
        env: Any = gym.make(ID, backend="analytic", config=config, disable_env_checker=True).unwrapped
    except ConfigError as error:
        assert "\n" not in str(error) and len(str(error)) < 400
        return False
    rng = np.random.default_rng(0)
    observation, info = env.reset(seed=1)
    for _ in range(8):
        assert env.observation_space.contains(observation), (name, value)
        action = int(rng.choice(np.flatnonzero(observation["action_mask"])))
        observation, reward, terminated, truncated, info = env.step(action)
        numbers = [reward, *info["rewards"].values(), *info["phases_s"].values(), *info["scorecard"].values()]
        assert np.isfinite(numbers).all(), (name, value, info)
        if terminated or truncated:
            break
    assert env.observation_space.contains(observation), (name, value)
    return True


QUICK = ("belt.speed_m_s", "slots", "produce.value", "grip.best", "scenario.load", "scenario.time_limit_s")


@pytest.mark.parametrize("name", QUICK)
def test_a_setting_is_refused_in_a_line_or_works(name):
    assert not all([played(name, value) for value in tries(name)])


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(leaves()) - set(QUICK)))
def test_any_setting_is_refused_in_a_line_or_works(name):
    assert not all([played(name, value) for value in tries(name)])


ONE_BIN: Any = ((0.0, 0.2),)
FAR_BINS: Any = ((0.0, 0.4),) * 4


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: gym.make(ID, scenario="orchard"), "scenario"),
        (lambda: gym.make(ID, backend="gazebo"), "backend"),
        (lambda: gym.make(ID, perception="lidar"), "perception"),
        (lambda: gym.make(ID, slots=0), "slots"),
        (lambda: gym.make_vec(ID, num_envs=2, backend="pybullet"), "batched"),
        (lambda: ScenarioConfig(-1.0), "load"),
        (lambda: ScenarioConfig(1.0, clump=0.5), "clump"),
        (lambda: ScenarioConfig(1.6, clump=9.0, clump_gap_s=3.0), "clump_gap_s"),
        (lambda: replace(GRIP, misfit_sigma=0.0), "misfit_sigma"),
        (lambda: replace(GRIP, best=1.2), "best"),
        (lambda: MachineConfig(tilt_limit_rad=0.6), "tilt_limit_rad"),
        (lambda: MachineConfig(travel_level_m=0.2), "travel_level_m"),
        (lambda: BeltConfig(bins_m=ONE_BIN), "bins_m"),
        (lambda: BeltConfig(camera_x_m=-0.05), "camera_x_m"),
        (lambda: BeltConfig(start_x_m=0.3), "start_x_m"),
        (lambda: BeltConfig(width_m=0.2), "item_half_width_m"),
        (lambda: SortingConfig(belt=BeltConfig(bins_m=FAR_BINS)), "cannot reach"),
        (lambda: replace(PerceptionModel.perfect(), confusion=((0.5, 0.0, 0.0, 0.0),) * 4), "sum to 1"),
        (lambda: ProduceConfig(tuber_length_m=(0.08, 0.04)), "smaller one first"),
        (lambda: ProduceConfig(value=(1.0,)), "value"),  # type: ignore[arg-type]
        (lambda: ProduceConfig(tuber_width=(0.9, 1.3)), "tuber_width"),
        (lambda: SortingConfig(belt=BeltConfig(speed_m_s=0.7)), "speed_m_s"),
    ],
)
def test_bad_settings_are_named(make, word):
    with pytest.raises(ValueError, match=word) as caught:
        make()
    assert "\n" not in str(caught.value)
