"""Strawberries before a wall: a task of one's own in one file, on the package's translational five-bar."""

from dataclasses import dataclass

import numpy as np
from gymnasium import spaces

import fieldgym.custom as fg
from fieldgym.mechanisms import TranslationalFiveBar
from fieldgym.motion import QUINTIC

(LEFT, BOTTOM), (RIGHT, TOP) = TranslationalFiveBar.transplanter().window_m
CORNER, SIZE, HOME, TIME_LIMIT_S = np.array([LEFT, BOTTOM]), np.array([RIGHT - LEFT, TOP - BOTTOM]), (0.0, TOP), 120.0


@dataclass(frozen=True, eq=False)
class Berries(fg.Table):
    across_m: fg.Array = fg.number("m", LEFT, RIGHT, "across the machine")
    up_m: fg.Array = fg.number("m", BOTTOM, TOP, "seen from the motors")
    ripe: fg.Flags = fg.flag("whether it is worth picking", fill=1.0)
    luck: fg.Array = fg.number("", 0.0, 1.0, "the gripper holds it when this is below its chance", fill="uniform")


@dataclass(frozen=True, eq=False)
class StrawberryField(fg.Field):
    task, main, places = "strawberry", "berries", ("across_m", "up_m")
    berries: Berries


@dataclass(frozen=True)
class Wall(fg.Config):
    berries: int = fg.num(8, 1, 40, "")
    ripe_share: float = fg.num(0.7, 0.0, 1.0, "")


@dataclass(frozen=True)
class StrawberryConfig(fg.Config):
    scenario: Wall = fg.nested(Wall)
    velocity_m_s: float = fg.num(1.0, 0.01, 4.5, "m/s")
    acceleration_m_s2: float = fg.num(10.0, 0.1, 140.0, "m/s2")
    grip_s: float = fg.num(0.8, 0.0, 10.0, "s")
    hold: float = fg.num(0.9, 0.0, 1.0, "")
    second: float = fg.num(0.05, 0.0, 10.0, "")
    """What a second costs, in ripe berries."""


class StrawberryCore(fg.TaskCore):
    """B worlds of N berries: action k picks berry k, N leaves; what is not possible costs a grip's time."""

    reward_names, phase_names = ("picked", "time"), ("travel", "grip")
    score_names = (*fg.COMMON_SCORES, "phase_travel_s", "phase_grip_s")
    machine_features, candidate_features = ("across", "up", "time"), ("present", "across", "up", "ripe", "travel")
    field_type, rows = StrawberryField, property(lambda self: np.arange(self.worlds))

    def __init__(self, config, perception, worlds=1):
        super().__init__(worlds)
        self.config, self.n = config, config.scenario.berries
        self.place, self.tool = np.zeros((worlds, self.n, 2)), np.zeros((worlds, 2))
        self.there, self.ripe, self.held = np.zeros((3, worlds, self.n), bool)
        self.phases_s, self.counts = np.zeros((worlds, 2)), np.zeros((worlds, 5))
        self.observation_space = fg.observation_space(self, self.n, self.n + 1)
        self.action_space = spaces.Discrete(self.n + 1)

    def draw_field(self, generator):
        x, y, lot, luck = generator.random((4, self.n))
        ripe = lot < self.config.scenario.ripe_share
        return StrawberryField(Berries(LEFT + x * SIZE[0], BOTTOM + y * SIZE[1], ripe, luck))

    def complete(self, field, generator):
        if len(field.berries) > self.n:
            raise fg.FieldError(f"{len(field.berries)} berries: give at most {self.n}, or raise scenario.berries")
        return super().complete(field, generator)

    def load(self, rows, batch):
        for row, berries in zip(rows, [field.berries for field in batch], strict=True):
            n = len(berries)
            self.there[row], self.ripe[row], self.held[row] = np.arange(self.n) < n, False, False
            self.place[row, :n] = np.column_stack([berries.across_m, berries.up_m])
            self.ripe[row, :n], self.held[row, :n] = berries.ripe, berries.luck < self.config.hold
            self.tool[row], self.phases_s[row], self.counts[row] = HOME, 0.0, 0.0
            self.counts[row, 4] = self.ripe[row].sum()

    def travel_s(self):
        strokes, config = self.place - self.tool[:, None], self.config
        return QUINTIC.duration_unchecked(strokes, config.velocity_m_s, config.acceleration_m_s2).max(axis=-1)

    def plan(self, actions):
        """Berry (B,), whether it is picked (B,), whether the machine leaves (B,), seconds of the phases (B, 2)."""
        berry, leaves = np.minimum(actions, self.n - 1), actions == self.n
        picks = ~leaves & self.there[self.rows, berry]
        travel = np.where(picks, self.travel_s()[self.rows, berry], 0.0)
        return berry, picks, leaves, np.column_stack([travel, np.where(leaves, 0.0, self.config.grip_s)])

    def apply(self, plan, outcome):
        berry, picks, leaves, phases_s = outcome
        ripe = picks & self.ripe[self.rows, berry]
        gained = ripe & self.held[self.rows, berry]
        self.phases_s += phases_s
        self.counts[:, :3] += np.stack([gained, ripe & ~gained, ~picks & ~leaves], axis=1)
        self.counts[gained, 3] = self.phases_s[gained].sum(axis=1)
        self.there[self.rows[picks], berry[picks]] = False
        self.tool[picks] = self.place[self.rows[picks], berry[picks]]
        rewards = np.column_stack([gained, -self.config.second * phases_s.sum(axis=1)])
        return fg.StepResult(rewards, phases_s, leaves, ~leaves & (self.phases_s.sum(axis=1) > TIME_LIMIT_S))

    def observe(self):
        machine = np.column_stack([(self.tool - CORNER) / SIZE, self.phases_s.sum(axis=1) / TIME_LIMIT_S])
        across, up = ((self.place - CORNER) / SIZE).transpose(2, 0, 1)
        table = np.stack([self.there, across, up, self.ripe, self.travel_s()], axis=-1) * self.there[..., None]
        mask = np.column_stack([self.there, np.ones(self.worlds, bool)]).astype(np.int8)
        flat = table.reshape(self.worlds, -1)
        return {"machine": np.float32(machine), "candidates": np.float32(flat), "action_mask": mask}

    def scores(self):
        done, lost, illegal, last, every = self.counts.T
        time = self.phases_s.sum(axis=1)
        rates = done / np.maximum(every, 1.0), last / np.maximum(done, 1.0), 60.0 * done / np.maximum(time, 1e-9)
        return np.column_stack([*rates, time, done, every - done, lost, illegal, self.phases_s])


class Nearest:
    """The ripe berry that is reached soonest; leaves when there is none."""

    def __init__(self, env, seed):
        self.n = env.unwrapped.core.n

    def act(self, observation):
        _, _, _, ripe, travel = observation["candidates"].reshape(-1, self.n, 5).transpose(2, 0, 1)
        return np.where((ripe > 0).any(axis=1), np.where(ripe > 0, travel, np.inf).argmin(axis=1), self.n)


class StrawberryEnv(fg.TaskEnv):
    assembly = fg.Assembly(StrawberryConfig, {"wall": Wall(), "dense": Wall(berries=20)}, StrawberryCore)


class StrawberryVectorEnv(fg.TaskVectorEnv):
    assembly = StrawberryEnv.assembly


SPEC = fg.TaskSpec(
    id="farm/StrawberryPicking-v0",
    entry_point="strawberry:StrawberryEnv",
    vector_entry_point="strawberry:StrawberryVectorEnv",
    machine="translational five-bar with a gripper before a wall of strawberries",
    decision="which berry next, when to leave",
    actions="Discrete(N + 1): berry, or leave",
    policies={"nearest": "strawberry:Nearest"},
    reference="nearest",
)
