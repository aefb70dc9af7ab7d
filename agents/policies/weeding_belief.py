"""What a planner believes of a weeder's candidates: what shots will do, given what it has done itself.

An observation shows what dose own works have put on a report, not where they were meant for, in which mode, nor what
they have left beside their own track. So a planner remembers its own shots, and reckons with measured tables of what
they do to what is reported about them (``envs.weeding.outcomes``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...envs.weeding.outcomes import (
    CONFIDENCES,
    CROP_GAPS_M,
    CROWD_M,
    CROWDS,
    FAR_M,
    NEIGHBOUR_GAPS_M,
    STEP_M,
    Outcomes,
    class_of,
    crop_step,
)
from ...envs.weeding.state import MODES
from ...envs.weeding.timing import G
from ...envs.weeding.together import Chosen
from ...kernels import compiled
from .search import Taken, way_of

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MEMORY = 64
"""Shots that are remembered in a world: those that a cart's window holds, and many more."""


class Memory(NamedTuple):
    """Own shots in B worlds, H places each, which are filled again and again.

    Attributes:
        place: (B, H, 2), along the row in the world and across, metres.
        kind: (B, H), reported.
        sure: (B, H), class of how sure the cameras were, see ``CONFIDENCES``.
        mode: (B, H).
        shots: (B,), how many there have been; the last of them stands at ``(shots - 1) % H``.
        cart_m: (B,), where the cart was at the last decision.
        fired: (B,), whether that was a shot.
    """

    place: Array
    kind: NDArray[np.int64]
    sure: NDArray[np.int64]
    mode: NDArray[np.int64]
    shots: NDArray[np.int64]
    cart_m: Array
    fired: Flags

    @classmethod
    def blank(cls, worlds: int) -> Memory:
        """Of worlds in which nothing was done."""
        whole = np.zeros((worlds, MEMORY), np.int64)
        return cls(
            np.zeros((worlds, MEMORY, 2)),
            whole,
            whole.copy(),
            whole.copy(),
            np.zeros(worlds, np.int64),
            np.full(worlds, np.nan),
            np.zeros(worlds, bool),
        )

    def forget(self, rows: Flags) -> None:
        """Begin anew in the worlds (B,) that ``rows`` marks."""
        self.shots[rows], self.cart_m[rows], self.fired[rows] = 0, np.nan, False

    def take_back(self, cart_m: Array) -> None:
        """Compare with where the carts are now.

        Where one has not moved a decision is asked for again: the last one was not carried out. Where one is farther
        back another episode has begun.
        """
        self.forget(cart_m < self.cart_m)
        again = (cart_m == self.cart_m) & self.fired
        self.shots[again] -= 1
        self.fired[again] = False

    def touched(self, place: Array) -> Flags:
        """Whether an own shot is remembered within ``FAR_M`` of places (B, 2) in the world."""
        apart_m = np.hypot(*np.moveaxis(self.place - place[:, None], -1, 0))
        return ((apart_m < FAR_M) & (np.arange(MEMORY) < self.shots[:, None])).any(axis=1)

    def add(
        self,
        cart_m: Array,
        place: Array,
        kind: NDArray[np.int64],
        confidence: Array,
        mode: NDArray[np.int64],
        fired: Flags,
    ) -> None:
        """Remember decisions (B,) at places (B, 2) in the world; those that ``fired`` are shots."""
        rows = np.flatnonzero(fired)
        slot = self.shots[rows] % MEMORY
        self.place[rows, slot], self.kind[rows, slot], self.mode[rows, slot] = place[rows], kind[rows], mode[rows]
        self.sure[rows, slot] = np.searchsorted(CONFIDENCES, confidence[rows], side="right")
        self.shots[rows] += 1
        self.cart_m[:], self.fired[:] = cart_m, fired


class Belief(NamedTuple):
    """What shots are expected to do in B worlds; K candidates, M modes.

    Attributes:
        own: (B, K, M), kills among what belongs to the candidate, and among what earlier shots have left beside it.
        beside: (B, K, K, M), kills of a shot at the first among what belongs to the second.
        after: (B, K, K, M, M), share that a shot at the first leaves of the own kills of the second, by both modes.
        near: (B, K), a bit for each candidate that is near enough for the two to be told; else they are not written.
        harm: (B, K, M), crop plants that die.
    """

    own: Array
    beside: Array
    after: Array
    near: NDArray[np.int64]
    harm: Array


@compiled
def distance(from_m: Array, to_m: Array) -> float:
    """Metres between two places (2,)."""
    return float(np.hypot(to_m[G.along] - from_m[G.along], to_m[G.across] - from_m[G.across]))


@compiled
def believe(
    tables: Outcomes,
    memory: Memory,
    count: NDArray[np.int64],
    place: Array,
    kind: NDArray[np.int64],
    crop_gap_m: Array,
    confidence: Array,
    belief: Belief,
) -> None:
    """Write what is believed of the candidates.

    Args:
        tables: what shots do on average.
        memory: own shots.
        count: (B,), the candidates of a world are 0 .. n - 1.
        place: (B, K, 2), along the row in the world and across.
        kind: (B, K), reported, see ``Outcomes``.
        crop_gap_m: (B, K), reported.
        confidence: (B, K), how sure the cameras are of the candidates.
        belief: is written.
    """
    slots = place.shape[1]
    kept = np.empty((slots, MODES))
    for w in range(len(count)):
        shots = min(memory.shots[w], MEMORY)
        for k in range(count[w]):
            # What own shots have left of each candidate's own kills, and what they have left to be killed beside it.
            for mode in range(MODES):
                kept[k, mode], belief.own[w, k, mode] = 1.0, 0.0
            sure, nearest_m, others = class_of(CONFIDENCES, confidence[w, k]), np.inf, 0
            for s in range(shots):
                apart_m = distance(place[w, k], memory.place[w, s])
                if apart_m >= CROWD_M:
                    continue
                others, nearest_m, step = others + 1, min(nearest_m, apart_m), int(apart_m / STEP_M)
                if apart_m < FAR_M:
                    before, of, was = memory.mode[w, s], memory.kind[w, s], memory.sure[w, s]
                    for mode in range(MODES):
                        kept[k, mode] *= tables.after[kind[w, k], step, sure, before, mode]
                        belief.own[w, k, mode] += tables.left[of, step, was, before, mode]
            belief.near[w, k] = 0
            for j in range(count[w]):
                apart_m = distance(place[w, k], place[w, j])
                if j == k or apart_m >= CROWD_M:
                    continue
                others, nearest_m, step = others + 1, min(nearest_m, apart_m), int(apart_m / STEP_M)
                if apart_m >= FAR_M:
                    continue
                belief.near[w, k] |= 1 << j
                known = class_of(CONFIDENCES, confidence[w, j])
                for mode in range(MODES):
                    belief.beside[w, k, j, mode] = tables.beside[kind[w, j], step, known, sure, mode]
                    for before in range(MODES):
                        belief.after[w, k, j, before, mode] = tables.after[kind[w, j], step, known, before, mode]
            crop, near = class_of(CROP_GAPS_M, crop_gap_m[w, k]), class_of(NEIGHBOUR_GAPS_M, nearest_m)
            crowd = class_of(CROWDS, others)
            for mode in range(MODES):
                kept[k, mode] *= tables.own[kind[w, k], crop, near, sure, crowd, mode]
                belief.own[w, k, mode] += kept[k, mode]
                belief.harm[w, k, mode] = tables.harm[crop_step(crop_gap_m[w, k]), mode]
        for k in range(count[w]):
            for j in range(count[w]):
                if belief.near[w, k] >> j & 1:
                    for mode in range(MODES):
                        belief.beside[w, k, j, mode] *= kept[j, mode]


@compiled
def kills(belief: Belief, w: int, candidate: int, mode: int, taken: Taken) -> float:
    """What a shot is expected to kill after the shots of a sequence."""
    near = belief.near[w, candidate]
    killed, done = belief.own[w, candidate, mode], near & taken.used
    if near == 0:
        return killed
    if done:
        for j in range(belief.near.shape[1]):
            if done >> j & 1:
                killed *= belief.after[w, j, candidate, way_of(taken, j), mode]
    for k in range(belief.near.shape[1]):
        if near >> k & 1 and not taken.used >> k & 1:
            more, done = belief.beside[w, candidate, k, mode], belief.near[w, k] & taken.used
            if done:
                for j in range(belief.near.shape[1]):
                    if done >> j & 1:
                        more *= belief.after[w, j, k, way_of(taken, j), mode]
            killed += more
    return killed


@compiled
def kills_now(belief: Belief, count: NDArray[np.int64]) -> Array:
    """``kills`` (B, K, M) of each shot as the next one."""
    killed = np.zeros(belief.own.shape)
    for w in range(len(count)):
        for k in range(count[w]):
            for mode in range(MODES):
                killed[w, k, mode] = kills(belief, w, k, mode, Taken(0, 0, 0))
    return killed


def chosen(
    belief: Belief,
    killed: Array,
    kind: NDArray[np.int64],
    confidence: Array,
    crop_gap_m: Array,
    slot: NDArray[np.int64],
    mode: NDArray[np.int64],
    touched: Flags,
) -> Chosen:
    """The shots (B,) at ``slot`` in ``mode``, to be told of.

    Args:
        belief: of the candidates.
        killed: (B, K, M), ``kills_now``.
        kind: (B, K), reported.
        confidence: (B, K), how sure the cameras are.
        crop_gap_m: (B, K), reported.
        slot: (B,), what is shot at.
        mode: (B,).
        touched: (B,), see ``Memory``.
    """
    rows = np.arange(len(slot))
    near = (belief.near[rows, slot][:, None] >> np.arange(killed.shape[1]) & 1) > 0
    return Chosen(
        kind=kind[rows, slot],
        mode=mode,
        own=belief.own[rows, slot, mode],
        whole=killed[rows, slot, mode],
        most=np.where(near, killed[rows, :, mode], 0.0).max(axis=1),
        confidence=confidence[rows, slot],
        crop_gap_m=crop_gap_m[rows, slot],
        touched=touched,
    )
