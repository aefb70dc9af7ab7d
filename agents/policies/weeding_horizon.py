"""Receding horizon for weeding with any tool: a beam search over the next shots, with an estimate of all the others.

It knows what it has done (``weeding_belief``) and what shots do on average (``envs.weeding.outcomes``).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...envs.weeding.features import (
    ACROSS_SCALE_M,
    ALONG_SCALE_M,
    CROP_GAP_SCALE_M,
    ENERGY,
    SPEED_SCALE,
    C,
    M,
    candidate_table,
)
from ...envs.weeding.outcomes import Outcomes, outcomes_of
from ...envs.weeding.ridges import lift_time
from ...envs.weeding.timing import A, G, Place, approach, move_time
from ...envs.weeding.together import Chosen, Shares, set_right, sums_of
from ...kernels import bind, compiled
from .base import Actions, Observation
from .search import NOTHING, Step, Taken, search, with_one, within
from .weeding import AtSpeed, HoldBacklog, ScriptedWeeder
from .weeding_belief import Belief, Memory, believe, chosen, kills, kills_now
from .weeding_outlook import Thrift, outlook

Array = NDArray[np.float64]

_STILL_M_S = 1e-3
"""A cart is taken to drive at least this fast."""
PRICE = 0.35
"""What a second costs, as a share of what work without pause earns: weeds that no camera has seen yet will want it
[chosen on tuned seeds, as the other numbers here]."""
MODE_PRICE = 0.7
"""Of that, what counts where the modes of later shots are chosen."""
RESERVE = 0.5
"""Services that the estimate keeps in reserve before a weed leaves."""
SPEEDY_PRICE = 0.1
"""``PRICE`` where the cart slows down when there is much to do."""


class Shots(NamedTuple):
    """What can be shot at in B worlds; K candidates, M modes. Places are relative to the present cart.

    Attributes:
        arm: numbers of the tool's arm.
        stand_s: (M,), seconds on a plant.
        price: what a second costs.
        killed: what a killed weed is worth.
        speed: (B,), of the cart, m/s.
        place: (B, K, 2), of the candidates along and across, metres.
        belief: what shots are expected to kill.
        cost: (B, K, M), expected cost of a shot but for the time.
        legal: (B, K, M), whether it can be the next one.
        mode: (B, K), in which a candidate is worked on later; -1 where none is worth it.
        rest_s: (B, K), seconds of that mode.
        opens_s: (B, K), seconds until the candidate is in the window.
        leaves_s: (B, K), seconds until it has left it, less a reserve.
        move_s: (B, K + 1, K), from candidate to candidate; the last row begins at the machine's present place.
    """

    arm: Any
    stand_s: Array
    price: float
    killed: float
    speed: Array
    place: Array
    belief: Belief
    cost: Array
    legal: NDArray[np.bool_]
    mode: NDArray[np.int64]
    rest_s: Array
    opens_s: Array
    leaves_s: Array
    move_s: Array


@compiled
def extend(
    problem: Shots,
    w: int,
    x: float,
    y: float,
    z: float,
    clock_s: float,
    candidate: int,
    option: int,
    taken: Taken,
    first: bool,
) -> Step:
    """One more shot; for the first the mask knows better than the estimate."""
    if not (problem.legal[w, candidate, option] if first else problem.mode[w, candidate] == option):
        return Step(x, y, z, clock_s, 0.0, False)
    gain = problem.killed * kills(problem.belief, w, candidate, option, taken) - problem.cost[w, candidate, option]
    if not gain > 0.0:
        return Step(x, y, z, clock_s, 0.0, False)
    along, across = problem.place[w, candidate, G.along], problem.place[w, candidate, G.across]
    stand_s, speed = problem.stand_s[option], problem.speed[w]
    way = approach(problem.arm, stand_s, Place(x, y, z), speed * clock_s, speed, along, across)
    done_s = clock_s + (way.move_s + way.wait_s) + stand_s
    return Step(way.carrier_m, way.lean_m, way.across_m, done_s, gain, way.legal)


@compiled
def prospect(problem: Shots, w: int, clock_s: float, taken: Taken, last: int) -> float:
    """Value of the others, served in the order of leaving where they still can be, less the price of all the time."""
    worth = 0.0
    for j in range(problem.mode.shape[1]):
        mode = problem.mode[w, j]
        if mode >= 0 and not taken.used >> j & 1:
            done_s = max(clock_s + problem.move_s[w, last, j], problem.opens_s[w, j]) + problem.rest_s[w, j]
            if done_s <= problem.leaves_s[w, j]:
                gain = problem.killed * kills(problem.belief, w, j, mode, taken) - problem.cost[w, j, mode]
                if gain > 0.0:
                    clock_s, last, taken = done_s, j, with_one(taken, j, mode)
                    worth += gain
    return worth - problem.price * clock_s


bind(Shots, extend, prospect)


@compiled
def measure_moves(shots: Shots, start: Array, share: float) -> None:
    """Fill in ``Shots.move_s``.

    The lean takes a fixed share of the way along; while one weed is served the next comes nearer.
    """
    for w in range(len(start)):
        k = shots.place.shape[1]
        for i in range(k + 1):
            passed = 0.0
            if i < k:
                lean, across = share * shots.place[w, i, G.along], shots.place[w, i, G.across]
                carrier = shots.place[w, i, G.along] - lean
                passed = share * shots.speed[w] * shots.rest_s[w, i]
            else:
                carrier, lean, across = start[w, A.carrier], start[w, A.lean], start[w, A.across]
            for j in range(k):
                along = shots.place[w, j, G.along]
                to_lean = share * along
                move_s = move_time(
                    shots.arm,
                    along - to_lean - carrier + passed,
                    to_lean - lean - passed,
                    shots.place[w, j, G.across] - across,
                )
                shots.move_s[w, i, j] = max(move_s, lift_time(shots.arm, across, shots.place[w, j, G.across]))


@compiled
def waiting(shots: Shots, moment_s: float) -> Array:
    """What waiting a moment is worth (B,)."""
    worth = np.empty(len(shots.speed))
    for w in range(len(worth)):
        worth[w] = prospect(shots, w, moment_s, Taken(0, 0, 0), shots.place.shape[1])
    return worth


class RecedingHorizon(ScriptedWeeder):
    """Beam search over the next shots; what comes after them is estimated by earliest deadline first.

    Sequences of up to ``depth`` shots are grown over estimated windows and move times; the ``width`` best of each
    depth are kept. A sequence is worth what its shots are expected to kill, of their own track and of what is reported
    beside it, less what was swept already by it or by own shots before; plus what serving the other candidates in the
    order of leaving would still bring after it, less the time. The first shot is tried in every mode, later ones in the
    mode with the highest value less a price for its seconds; where energy is scarce, a joule costs what makes it last
    for the rest of the strip. Waiting a moment is a sequence too. Only the first shot is fired.

    The search adds up what is believed of one report at a time. What it tells of the shot that it has chosen
    (``expected``) is set right by what such sums bring (``envs.weeding.together``).

    Attributes:
        believed: (B,), kills that the last decisions are expected to bring.
        last: what was known of the last shots when they were chosen.

    Args:
        config: the task's public numbers.
        depth: shots ahead.
        width: sequences kept at each depth.
        outcomes: what shots do on average; by default as the tool's measured cameras see.
        sums: what sums of that bring, see ``envs.weeding.together``; by default likewise.
        price: of a second, as a share of what work without pause earns.
        budget_ms: wall milliseconds for a decision; the search is then as wide as it has time for, whatever ``width``.
    """

    name = "receding-horizon"

    def __init__(
        self,
        config: Any,
        depth: int = 8,
        width: int = 40,
        outcomes: Outcomes | None = None,
        price: float = PRICE,
        budget_ms: float | None = None,
        sums: Shares | None = None,
    ):
        """Take the machine's windows and move times from the configuration."""
        super().__init__(config)
        if depth < 1 or width < 1:
            raise ValueError(f"depth = {depth} and width = {width}: give at least 1")
        self._depth, self._width, self._budget_ms = depth, width, budget_ms
        tool = self.outlook
        self._tables = outcomes or outcomes_of(config, tool.perception, tool.process)
        self._sums = sums_of(config, tool.perception, tool.process) if sums is None else sums
        scarce = config.scenario.energy_j > 0.0
        self._thrift = Thrift.of(self._tables, tool.energy_j) if scarce else None
        self._price = price * config.weights.killed / config.service_s
        self._reserve_s = RESERVE * config.service_s
        self.believed = np.zeros(0)
        self.last: Chosen | None = None
        self._memory = Memory.blank(0)

    @classmethod
    def make(cls, env: Any, seed: int, **settings: Any) -> Any:
        """The policy for an environment; it reckons with the cameras that the environment has."""
        core = env.unwrapped.core
        config = core.config
        seen = config, core.perception or outlook(config).perception, core.process
        return cls(config, outcomes=outcomes_of(*seen), sums=sums_of(*seen), **settings)

    def reset(self, rows: NDArray[np.bool_]) -> None:
        """Forget the shots of the worlds (B,) in which a new episode begins."""
        if len(rows) == len(self._memory.shots):
            self._memory.forget(rows)
        else:
            self._memory = Memory.blank(len(rows))

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        shots, killed, count, kind, cart_m = self._problem(observation)
        start = observation["machine"][:, [M.place, M.lean_along, M.lean_across]].astype(np.float64)
        start *= self.outlook.arm.scale
        measure_moves(shots, start, self.outlook.lean_share)
        idle = waiting(shots, self.config.cart.moment_s)
        modes = len(shots.stand_s)

        def plan(width: int) -> NDArray[np.int64]:
            return search(shots, start, idle, modes, count, self._depth, width)

        answer = plan(self._width) if self._budget_ms is None else within(self._budget_ms, plan)
        fired, rows = answer != NOTHING, np.arange(len(answer))
        slot, mode = np.where(fired, answer // modes, 0), np.where(fired, answer % modes, 0)
        place = shots.place[rows, slot]
        place[:, G.along] += cart_m
        table, touched = candidate_table(observation).astype(np.float64), self._memory.touched(place)
        confidence, crop_gap_m = table[..., C.confidence], table[..., C.crop_gap] * CROP_GAP_SCALE_M
        self.last = chosen(shots.belief, killed, kind, confidence, crop_gap_m, slot, mode, touched)
        self.believed = np.where(fired, set_right(self._sums, self.last), 0.0)
        self._memory.add(cart_m, place, kind[rows, slot], confidence[rows, slot], mode, fired)
        return np.where(fired, answer, self.wait)

    def expected(self, observation: Observation, actions: Actions) -> Array:
        """Kills (B,) that the last decisions are expected to bring: they depend on what is remembered."""
        return self.believed

    def _problem(self, observation: Observation) -> tuple[Shots, Array, NDArray[np.int64], NDArray[np.int64], Array]:
        """What the search works on, expected kills (B, K, M), candidates (B,), their kinds (B, K), the carts (B,)."""
        config, tool, weights = self.config, self.outlook, self.config.weights
        table, machine = candidate_table(observation).astype(np.float64), observation["machine"].astype(np.float64)
        b, k = table.shape[:2]
        if len(self._memory.shots) != b:
            self._memory = Memory.blank(b)
        modes, work_s = len(tool.work_s), tool.work_s
        count = (table[..., C.present] > 0.5).sum(axis=1)
        cart_m = machine[:, M.progress] * config.scenario.strip_m
        place = table[..., [C.along, C.across]] * [ALONG_SCALE_M, ACROSS_SCALE_M]
        kind = 3 * (table[..., C.grass] > 0.5) + table[..., C.cotyledon : C.four_leaf + 1].argmax(axis=-1)
        crop_gap_m = table[..., C.crop_gap] * CROP_GAP_SCALE_M
        belief = Belief(
            np.zeros((b, k, modes)),
            np.empty((b, k, k, modes)),
            np.empty((b, k, k, modes, modes)),
            np.zeros((b, k), np.int64),
            np.zeros((b, k, modes)),
        )
        self._memory.take_back(cart_m)
        in_world = place.copy()
        in_world[..., G.along] += cart_m[:, None]
        believe(self._tables, self._memory, count, in_world, kind, crop_gap_m, table[..., C.confidence], belief)
        cost = -weights.crop * belief.harm - weights.joules * tool.energy_j
        if self._thrift is not None:
            left_j = machine[:, ENERGY] * config.scenario.energy_j
            price = weights.killed * self._thrift.price_of(left_j, config.scenario.strip_m - cart_m)
            cost = cost + price[:, None, None] * tool.energy_j
        killed = kills_now(belief, count)
        value = weights.killed * killed - cost
        worth = value - MODE_PRICE * self._price * work_s
        legal = observation["action_mask"][:, : modes * k].reshape(b, k, modes) > 0
        best = np.where(value > 0.0, worth, -np.inf)
        mode = np.where((value > 0.0).any(axis=-1), best.argmax(axis=-1), -1)
        speed = np.maximum(machine[:, M.speed] * SPEED_SCALE, _STILL_M_S)
        pace = 1.0 / speed[:, None]
        shots = Shots(
            arm=tool.arm,
            stand_s=work_s,
            price=self._price,
            killed=float(weights.killed),
            speed=speed,
            place=place,
            belief=belief,
            cost=cost,
            legal=legal,
            mode=mode,
            rest_s=work_s[np.maximum(mode, 0)],
            opens_s=(place[..., G.along] - tool.arm.front_m) * pace,
            leaves_s=(place[..., G.along] + tool.arm.front_m) * pace - self._reserve_s,
            move_s=np.empty((b, k + 1, k)),
        )
        return shots, killed, count, kind, cart_m


def constant_075(env: Any, seed: int) -> AtSpeed:
    """``receding-horizon`` at three quarters of the scenario's speed."""
    return AtSpeed(RecedingHorizon.make(env, seed), 0.75)


def constant_1(env: Any, seed: int) -> AtSpeed:
    """``receding-horizon`` at the scenario's speed."""
    return AtSpeed(RecedingHorizon.make(env, seed), 1.0)


def constant_15(env: Any, seed: int) -> AtSpeed:
    """``receding-horizon`` at one and a half times the scenario's speed."""
    return AtSpeed(RecedingHorizon.make(env, seed), 1.5)


def hold_backlog(env: Any, seed: int) -> HoldBacklog:
    """``receding-horizon`` at a speed that keeps the backlog constant."""
    return HoldBacklog(RecedingHorizon.make(env, seed, price=SPEEDY_PRICE))


def hold_backlog_065(env: Any, seed: int) -> HoldBacklog:
    """``hold-backlog`` with a third of its time to spare, for a share of the weeds that is demanded."""
    return HoldBacklog(RecedingHorizon.make(env, seed), 0.50, 0.65, "hold-backlog-0.65")
