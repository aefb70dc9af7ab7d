"""Receding horizon for weeding with any tool: a beam search over the next shots, with an estimate of all the others."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...envs.weeding.features import ACROSS_SCALE_M, ALONG_SCALE_M, SPEED_SCALE, C, M
from ...envs.weeding.ridges import lift_time
from ...envs.weeding.timing import A, G, Place, approach, move_time
from ...kernels import bind, compiled
from .base import Actions, Observation
from .search import NOTHING, Step, search
from .weeding import AtSpeed, HoldBacklog, ScriptedWeeder

Array = NDArray[np.float64]

_STILL_M_S = 1e-3
"""A cart is taken to drive at least this fast."""


class Shots(NamedTuple):
    """What can be shot at in B worlds; K candidates, M modes. Places are relative to the present cart.

    Attributes:
        arm: numbers of the tool's arm.
        stand_s: (M,), seconds on a plant.
        price: what a second costs.
        speed: (B,), of the cart, m/s.
        place: (B, K, 2), of the candidates along and across, metres.
        value: (B, K, M), expected value of a shot but for the time.
        legal: (B, K, M), whether it can be the next one.
        rest_value: (B, K), value of a shot in the mode that the kind of weed calls for; none where it does harm.
        rest_s: (B, K), seconds of that mode.
        opens_s: (B, K), seconds until the candidate is in the window.
        leaves_s: (B, K), seconds until it has left it, less a reserve.
        move_s: (B, K + 1, K), from candidate to candidate; the last row begins at the machine's present place.
    """

    arm: Any
    stand_s: Array
    price: float
    speed: Array
    place: Array
    value: Array
    legal: NDArray[np.bool_]
    rest_value: Array
    rest_s: Array
    opens_s: Array
    leaves_s: Array
    move_s: Array


@compiled
def extend(
    problem: Shots, w: int, x: float, y: float, z: float, clock_s: float, candidate: int, option: int, first: bool
) -> Step:
    """One more shot; for the first the mask knows better than the estimate."""
    if not problem.value[w, candidate, option] > 0.0 or (first and not problem.legal[w, candidate, option]):
        return Step(x, y, z, clock_s, 0.0, False)
    along, across = problem.place[w, candidate, G.along], problem.place[w, candidate, G.across]
    stand_s, speed = problem.stand_s[option], problem.speed[w]
    way = approach(problem.arm, stand_s, Place(x, y, z), speed * clock_s, speed, along, across)
    done_s = clock_s + (way.move_s + way.wait_s) + stand_s
    return Step(way.carrier_m, way.lean_m, way.across_m, done_s, problem.value[w, candidate, option], way.legal)


@compiled
def prospect(problem: Shots, w: int, clock_s: float, used: int, last: int) -> float:
    """Value of the others, served in the order of leaving where they still can be, less the price of all the time."""
    worth = 0.0
    for j in range(problem.rest_value.shape[1]):
        if problem.rest_value[w, j] > 0.0 and not used >> j & 1:
            done_s = max(clock_s + problem.move_s[w, last, j], problem.opens_s[w, j]) + problem.rest_s[w, j]
            if done_s <= problem.leaves_s[w, j]:
                clock_s, last = done_s, j
                worth += problem.rest_value[w, j]
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
        worth[w] = prospect(shots, w, moment_s, 0, shots.place.shape[1])
    return worth


class RecedingHorizon(ScriptedWeeder):
    """Beam search over the next shots; what comes after them is estimated by earliest deadline first.

    Sequences of up to ``depth`` shots are grown over estimated windows and move times; the ``width`` best of each
    depth are kept. A sequence is worth what its shots are expected to bring, plus what serving the other candidates
    in the order of leaving, with their labels' doses, would still bring after it, less the time.
    Waiting a moment is a sequence too. Only the first shot is fired.

    Args:
        config: the task's public numbers.
        depth: shots ahead.
        width: sequences kept at each depth.
    """

    name = "receding-horizon"

    def __init__(self, config: Any, depth: int = 4, width: int = 6):
        """Take the machine's windows and move times from the configuration."""
        super().__init__(config)
        if depth < 1 or width < 1:
            raise ValueError(f"depth = {depth} and width = {width}: give at least 1")
        self._depth, self._width = depth, width
        # A second is charged at a quarter of what work without pause earns [assumed]: weeds that no camera has seen yet
        # will want it. The same uncertainty makes the estimate keep one service in reserve before a weed leaves.
        self._price = 0.25 * config.weights.killed / config.service_s
        self._reserve_s = config.service_s

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        view, arm = self.read(observation), self.outlook.arm
        b, k = view.label.shape
        present = view.table[..., C.present] > 0.5
        place = view.table[..., [C.along, C.across]] * [ALONG_SCALE_M, ACROSS_SCALE_M]
        machine = observation["machine"].astype(np.float64)
        speed = np.maximum(machine[:, M.speed] * SPEED_SCALE, _STILL_M_S)
        start = machine[:, [M.place, M.lean_along, M.lean_across]] * arm.scale
        labelled = np.take_along_axis(view.value, view.label[..., None], axis=2)[..., 0]
        pace = 1.0 / speed[:, None]
        shots = Shots(
            arm=arm,
            stand_s=view.work_s,
            price=self._price,
            speed=speed,
            place=place,
            value=view.value,
            legal=view.legal,
            rest_value=np.where(present, labelled, 0.0),
            rest_s=view.work_s[view.label],
            opens_s=(place[..., G.along] - arm.front_m) * pace,
            leaves_s=(place[..., G.along] + arm.front_m) * pace - self._reserve_s,
            move_s=np.empty((b, k + 1, k)),
        )
        measure_moves(shots, start, self.outlook.lean_share)
        idle = waiting(shots, self.config.cart.moment_s)
        modes = len(view.work_s)
        answer = search(shots, start, idle, modes, present.sum(axis=1), self._depth, self._width)
        return np.where(answer == NOTHING, self.wait, answer)


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
    return HoldBacklog(RecedingHorizon.make(env, seed))


def hold_backlog_065(env: Any, seed: int) -> HoldBacklog:
    """``hold-backlog`` with a third of its time to spare, for a share of the weeds that is demanded."""
    return HoldBacklog(RecedingHorizon.make(env, seed), 0.50, 0.65, "hold-backlog-0.65")
