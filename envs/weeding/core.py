"""The rules of weeding from a moving cart over a batch of worlds, for any tool."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..columns import Says, documented, names
from ..core import Array, Rows, StepResult, observation_space, outside
from ..dice import draw_blocks
from ..drives import Servos
from ..erring import ErringCore
from ..field import Camera
from .batch import Batch, stack, unstack
from .beginning import Looks, begin_tracks, begin_worlds
from .config import SPECIES, FieldTask
from .drawing import Strip, draw_plants
from .features import LIMIT, Candidate, Machine, PoweredMachine, show_tracks
from .field import Profile, WeedField
from .filling import REAL_M, completed, window
from .gaps import crop_index, passed
from .ground import draw_profiles, surface_of
from .perception import PerceptionModel
from .process import WeedingProcess
from .rules import apply_worlds, legal_option, plan_worlds
from .showing import decide_worlds, show_worlds
from .sighting import Cameras, draw_tracks
from .state import BLOCKS, CROP_KIND, MODES, PAD, WAIT, Common, N, Own, R, Rewards, WeederPlan, empty_worlds, tables_of
from .straying import Carrying
from .timing import G, Moving


class WeederOutcome(NamedTuple):
    """What happened: ``phases_s`` (B, P) seconds and ``hit`` (B, 2), where the tool really worked on average."""

    phases_s: Array
    hit: Array


class WeedingCore(ErringCore[WeederPlan, WeederOutcome]):
    """Batched weeding task; tools say what it means to them that drives err.

    An action is ``slot * 3 + mode``; ``3 K`` waits a moment. With ``speed_control`` there are three such blocks: hold
    the speed, one notch slower, one notch faster.

    Args:
        config: the task's numbers.
        machine: numbers of the tool's arm (see ``timing.Arm``).
        process: what the tool does to plants.
        perception: statistical cameras, or None when tracks come from outside through ``receive``.
        worlds: number of worlds B.

    Attributes:
        driven: how many linear and rotary drives move the tool.
    """

    driven: ClassVar[tuple[int, int]] = (0, 0)
    reward_names = names(Rewards)
    machine_features = names(Machine)
    candidate_features = names(Candidate)
    field_type = WeedField
    blocks = MappingProxyType({"machine": Machine, "candidates": Candidate, "rewards": Rewards})
    deciding, showing = staticmethod(decide_worlds), staticmethod(show_worlds)

    def __init__(
        self,
        config: FieldTask,
        machine: Any,
        process: WeedingProcess,
        perception: PerceptionModel | None,
        worlds: int = 1,
    ):
        """Allocate the state."""
        super().__init__(worlds)
        self.config, self.machine, self.process, self.perception = config, machine, process, perception
        scenario, k = config.scenario, config.slots
        if scenario.energy_j > 0.0:
            self.blocks = {**self.blocks, "machine": PoweredMachine}
            self.machine_features = names(PoweredMachine)
        self.phase_names = (*names(Moving), *names(process.phases), "pause")
        self.score_names = (*names(Common), *(f"phase_{name}_s" for name in self.phase_names), *names(Own))
        self.base_actions = MODES * k + 1
        actions = (BLOCKS if config.speed_control else 1) * self.base_actions
        self.action_space = spaces.Discrete(actions)
        self.observation_space = observation_space(self, k, actions, LIMIT)
        self._strip, self._speed_m_s = Strip.of(scenario), float(config.speed_m_s)
        self._all_seen = perception is not None and perception == PerceptionModel.perfect()
        self._cameras = Cameras.of(scenario, config.cart, perception or PerceptionModel.perfect())
        self._numbers = (*self._strip.random_numbers, *self._cameras.random_numbers(scenario.max_weeds))
        believes = perception is not None and not self._all_seen
        delay_s = perception.delay_s if perception else 0.0
        self.tables = tables_of(config, machine, process, delay_s, believes, perception is not None)
        # Weeds and crop plants lie in one array.
        self.weeds_end = self.tables.weeds_end
        self.capacity = self._cameras.capacity(scenario.max_weeds) if perception else 4 * scenario.max_weeds
        self.state = empty_worlds(config, len(self.phase_names), self.capacity, worlds)
        self._drive(Servos.of(scenario.drives, *self.driven))
        b, plants = self.state.plant_dose.shape
        # What the pictures show and the rules do not ask for.
        self.plant_exists = np.zeros((b, plants), bool)
        self.plant_species = np.zeros((b, plants), np.int64)
        self.plant_look = np.zeros((b, plants))
        self.ground_look = np.zeros(b)
        self.episode = np.zeros(b, np.int64)

    def meanings(self) -> dict[str, Mapping[str, Says]]:
        """What each number means; phases are those of the tool too, and stand among the scores."""
        last = {"pause": Says("s", "waiting a moment, and what an illegal action costs")}
        phases = {**documented(Moving), **documented(self.process.phases), **last}
        spent = {f"phase_{name}_s": says for name, says in phases.items()}
        scores = {**documented(Common), **spent, **documented(Own)}
        return super().meanings() | {"phases": phases, "scores": scores}

    @cached_property
    def camera(self) -> Camera | None:
        """The sign by which fields tell whose reports they hold."""
        return None if self.perception is None else Camera.of(self.perception)

    @property
    def window(self) -> dict[str, tuple[float, float]]:
        """Where weeds may stand."""
        return window(self.config.scenario)

    def draw(self, generators: Sequence[np.random.Generator]) -> Batch:
        """Draw strips and what the statistical cameras make of them."""
        luck = self.draw_luck(generators)
        uniform, normal, camera_uniform, camera_normal = draw_blocks(generators, self._numbers)
        plants = draw_plants(self._strip, uniform, normal)
        profiles = draw_profiles(self.config, plants.ground_look)
        if self.perception is None:
            return Batch(plants, None, luck, profiles)
        carrying = self.carrying(profiles, plants.ground_look)
        return Batch(
            plants, draw_tracks(self._cameras, plants, camera_uniform, camera_normal, carrying), luck, profiles
        )

    def carrying(self, profiles: Sequence[Profile], looks: Array) -> Carrying:
        """How tracks are carried to the tool over these grounds, of strips with these lucks (R,)."""
        return Carrying.of(self.config, profiles, looks, self._all_seen)

    def stack(self, fields: Sequence[WeedField]) -> Batch:
        """The batch of fields in which nothing is missing."""
        return stack(self.config.scenario, self.capacity, fields)._replace(luck=self.luck_of(fields))

    def unstack(self, batch: Batch) -> list[WeedField]:
        """The fields of a batch."""
        return self.with_luck(unstack(batch, self.camera), batch.luck)

    def complete(self, field: Any, generator: np.random.Generator) -> WeedField:
        """A field with nothing missing; see ``filling``."""
        whole = super().complete(field, generator)
        cameras = self._cameras if self.perception else None
        done = completed(self.config, cameras, self.camera, whole, generator, self.carrying)
        return self.with_whole_luck(done, whole.drives, generator)

    def load(self, rows: Rows, batch: Batch) -> None:
        """Put strips into ``rows`` and the carts before their beginning, already driving."""
        plants, tracks, luck, profiles = batch
        self.take_luck(rows, luck)
        if profiles:
            self.state.surface[rows] = surface_of(self.config, profiles)
        looks = Looks(self.plant_exists, self.plant_species, self.plant_look, self.ground_look)
        response, speed_m_s = self.process.response, self._speed_m_s
        begin_worlds(self.tables, self.machine, response, self.state, looks, rows, plants, speed_m_s)
        if tracks is not None:
            seen_m, frames_m = self.config.cart.seen_ahead_m, self.perception.frames_m if self.perception else 0.0
            begin_tracks(self.tables, self.state, rows, plants, tracks, float(seen_m), float(frames_m))
        self.episode[rows] += 1

    def receive(
        self,
        row: int,
        report: Array,
        species: NDArray[np.int64],
        stage: NDArray[np.int64],
        crop_gap_m: Array,
        confidence: Array,
        treated: NDArray[np.bool_],
    ) -> None:
        """Take a camera's present tracks into one world: n places (n, 2), what they are, and which were treated.

        A track keeps its index from call to call; new ones come after the old ones.
        """
        state, n = self.state, min(len(report), self.capacity)
        state.track_report[row, :n] = state.track_aim[row, :n] = report[:n]
        told = species[:n], stage[:n], crop_gap_m[:n], confidence[:n]
        show_tracks(state.track_feature[row, :n], report[:n, G.across], *told)
        state.track_count[row] = state.cursor[row] = n
        open_tracks = np.flatnonzero(~treated[:n] & (report[:n, G.along] >= state.cart[row] - self.tables.exit_m))
        nearest = open_tracks[np.argsort(report[open_tracks, G.along], kind="stable")][: self.config.slots]
        state.slot_track[row] = self.capacity
        state.slot_track[row, : len(nearest)] = nearest
        # Only what is shown can be worked on.
        for track in nearest.tolist():
            self._near(row, track)

    def correct(self, row: int, track: int, aim: Array) -> None:
        """Take the tool camera's correction of one track: the tool will be set on ``aim`` (2,)."""
        self.state.track_aim[row, track] = aim
        self._near(row, track)

    def option_legal(self, row: int, option: int) -> bool:
        """Whether a shot, an action of the first block, is possible now in one world."""
        return bool(legal_option(self.tables, self.machine, self.state, row, option))

    def _near(self, row: int, track: int) -> None:
        """Which plants a shot at a track may reach; for scoring alone."""
        state = self.state
        along = state.track_aim[row, track, : G.along + 1]
        weeds = state.plant[row, PAD : self.weeds_end - PAD]
        nearest = int(np.argmin(np.abs(weeds[:, G.along] - along)))
        gap_m = np.hypot(*(weeds - state.track_aim[row, track]).T).min()
        crops, along_m = state.plant[row, self.weeds_end :], float(along[0])
        crop = crop_index(crops, along_m, passed(crops, along_m, 0), self.tables.crop_beside)
        state.track_near[row, track, N.weed], state.track_near[row, track, N.crop] = nearest, crop
        state.track_real[row, track] = bool(gap_m < REAL_M)

    def rules(self) -> tuple[Any, ...]:
        """See ``KernelCore``: the tables, the arm, the work."""
        return self.tables, self.machine, self.process.work

    def plan(self, actions: NDArray[np.int64]) -> WeederPlan:
        """Turn actions (B,) into what the machine has to do."""
        return plan_worlds(self.tables, self.machine, self.state, actions)

    def nominal(self, plan: WeederPlan) -> WeederOutcome:
        """Nominal phase times, the tool where it was sent, or where drives that err bring it.

        A camera beside the tool that has looked after the move has seen where they had brought it.
        """
        if not self.errs:
            return WeederOutcome(plan.phases_s, plan.aim)
        seen = plan.correction.any(axis=1, keepdims=True)
        return WeederOutcome(plan.phases_s, plan.aim + np.where(seen, 0.0, self.work_error(plan)))

    def work_error(self, plan: WeederPlan) -> Array:
        """Where the tool works less where it was sent, (B, 2) on the ground, on average over its work."""
        raise NotImplementedError

    def apply(self, plan: WeederPlan, outcome: WeederOutcome) -> StepResult:
        """Treat plants, book the time, drive on."""
        return apply_worlds(self.tables, self.process.work, self.state, plan, outcome.phases_s, outcome.hit)

    def misplaced(self) -> str:
        """See ``TaskCore.misplaced``."""
        tracks, plants = self.state.track_real.shape[1], self.state.plant_kind.shape[1]
        near = self.state.track_near
        limits = {N.weed: self.weeds_end - PAD - 1, N.crop: plants - self.weeds_end - self.tables.crop_beside}
        if any(not ((near[..., side] >= 0) & (near[..., side] < limit)).all() for side, limit in limits.items()):
            return "track_near"
        return outside(
            self.state, plant_kind=CROP_KIND + 1, track_count=tracks, slot_track=tracks, cursor=tracks
        ) or outside(self, plant_species=len(SPECIES))

    def describe(self, plan: WeederPlan, result: StepResult, row: int = 0) -> str:
        """One line about the last decision."""
        kind = int(plan.kind[row])
        elapsed = float(result.phases_s[row].sum())
        if kind < WAIT:
            effect = "weed dies" if result.rewards[row, R.killed] > 0.0 else "no kill"
            harm = ", crop plant dies" if result.rewards[row, R.crop] < 0.0 else ""
            return f"{self.process.modes[kind]} dose on slot {int(plan.slot[row])}: {effect}{harm}, {elapsed:.2f} s"
        return f"{'wait' if kind == WAIT else 'illegal action'}: {elapsed:.2f} s"
