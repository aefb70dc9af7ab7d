"""What policies are shown of the worlds, and what was achieved in them, as machine code."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..core import Array
from .features import (
    ALONG_SCALE_M,
    CANDIDATE_FEATURES,
    LEAVES_SCALE_S,
    MACHINE_FEATURES,
    SPEED_SCALE,
    TIME_SCALE_S,
)
from .rules import (
    BLANKS,
    BLOCKS,
    CROP,
    ILLEGAL,
    JOULES,
    KILLED,
    LAST,
    MODES,
    SHOTS,
    TIME,
    Tables,
    Worlds,
    approach_slot,
)

COMMON = 8
"""Scores before the phases."""
OWN = 8
"""Scores behind them."""

_MACHINE, _FEATURES = len(MACHINE_FEATURES), len(CANDIDATE_FEATURES)
_ALONG, _LEAVES, _MOVE, _WAIT = (CANDIDATE_FEATURES.index(name) for name in ("along", "leaves", "move", "wait"))
_MOST = 10.0
"""Features are at most this."""


@compiled
def observe_worlds(
    tables: Tables, arm: Any, worlds: Worlds
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int8]]:
    """Features of the machine (B, .) and of the candidates (B, K * F), and the mask (B, blocks * (3 K + 1))."""
    n, slots, empty = len(worlds.cart), worlds.slot_track.shape[1], worlds.track_real.shape[1] - 1
    base = MODES * slots + 1
    machine = np.empty((n, _MACHINE), np.float32)
    candidates = np.zeros((n, slots * _FEATURES), np.float32)
    mask = np.zeros((n, BLOCKS * base if tables.speed_control else base), np.int8)
    for w in range(n):
        cart, speed = worlds.cart[w], worlds.speed[w]
        present = 0
        while present < slots and worlds.slot_track[w, present] != empty:
            present += 1
        machine[w, 0] = (worlds.place[w, 0] - cart) / arm.scale[0]
        machine[w, 1] = worlds.place[w, 1] / arm.scale[1]
        machine[w, 2] = worlds.place[w, 2] / arm.scale[2]
        machine[w, 3] = speed / SPEED_SCALE
        machine[w, 4] = worlds.set_speed[w] / SPEED_SCALE
        machine[w, 5] = cart / tables.strip_m
        machine[w, 6] = present / slots
        for k in range(present):
            track, column = worlds.slot_track[w, k], k * _FEATURES
            for feature in range(_FEATURES):
                candidates[w, column + feature] = worlds.track_feature[w, track, feature]
            ahead = worlds.track_report[w, track, 0] - cart
            candidates[w, column + _ALONG] = min(ahead / ALONG_SCALE_M, _MOST)
            candidates[w, column + _LEAVES] = min((ahead + tables.exit_m) / (speed * LEAVES_SCALE_S), _MOST)
        # What a mode shares in all slots is worked out once: the loop over the slots is the inner one.
        for mode in range(MODES):
            for k in range(present):
                way = approach_slot(tables, arm, worlds, w, k, mode)
                mask[w, MODES * k + mode] = way.legal
                if mode == 1:
                    candidates[w, k * _FEATURES + _MOVE] = min(way.move_s / TIME_SCALE_S, _MOST)
                    candidates[w, k * _FEATURES + _WAIT] = min(way.wait_s / TIME_SCALE_S, _MOST)
        mask[w, base - 1] = 1
        for action in range(base, mask.shape[1]):
            mask[w, action] = mask[w, action - base]
    return machine, candidates, mask


@compiled
def score_worlds(tables: Tables, worlds: Worlds) -> Array:
    """Scorecard so far: the common scores, the phases, then the task's own.

    The net rate counts every true weed of the band, missed ones too.
    """
    phases = worlds.phases_s.shape[1]
    result = np.empty((len(worlds.totals), COMMON + phases + OWN))
    for w in range(len(result)):
        totals, weeds, score, own = worlds.totals[w], worlds.weeds[w], result[w], COMMON + phases
        time_s, killed, shots = max(totals[TIME], 1e-9), totals[KILLED], max(totals[SHOTS], 1.0)
        score[0] = killed / max(weeds, 1.0)
        score[1] = totals[LAST] / shots
        score[2] = 60.0 * killed / time_s
        score[3], score[4], score[5] = totals[TIME], killed, weeds - killed
        score[6], score[7] = totals[CROP], totals[ILLEGAL]
        for phase in range(phases):
            score[COMMON + phase] = worlds.phases_s[w, phase]
        score[own] = 100.0 * totals[CROP] / max(worlds.crops_in_strip[w], 1.0)
        score[own + 1] = killed / time_s
        score[own + 2] = totals[JOULES] / max(killed, 1.0)
        score[own + 3] = (worlds.cart[w] + tables.start_m) / time_s * tables.ha_s_per_m_h
        score[own + 4], score[own + 5] = totals[SHOTS], totals[BLANKS]
        score[own + 6], score[own + 7] = weeds, worlds.track_count[w]
    return result
