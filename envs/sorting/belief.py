"""What the sorter believes of its belt, and what is true."""

from __future__ import annotations

import numpy as np

from ..belief import OPEN, Belief, placed
from .columns import ITEM, NUMBER, Candidate
from .core import SortingCore

_ABOVE_M = 0.075
"""Marks float over the belt, above what lies on it."""
_SHOWN_M = 1.2
"""Items farther than this from the machine's middle have not come yet, or have gone."""


def belief(core: SortingCore) -> Belief:
    """Reports in the slots, where the platform would be over them, and the items on the belt."""
    state, belt = core.state, core.config.belt
    level_m, now_s = core.config.machine.sorter.belt_height_m + _ABOVE_M, float(core.time_s[0])
    number = state.number[0]
    along = belt.speed_m_s * (now_s - number[:, NUMBER.passing_s])
    said = np.column_stack([along, number[:, NUMBER.across_m], np.full(len(number), level_m)])
    item = core.items[0]
    x = belt.speed_m_s * (now_s - item[:, ITEM.passing_s])
    here = state.item_free[0] & (np.abs(x) < _SHOWN_M)
    true = np.column_stack([x, item[:, ITEM.across_m], np.full(len(x), level_m)])[here]
    return Belief(
        slot_m=placed(state.slot_report[0], len(number) - 1, said),
        to_m=None,
        true_m=true,
        stands=np.full(len(true), OPEN),
        size_m=0.03,
        drift_m_s=np.array([belt.speed_m_s, 0.0, 0.0]),
        options=("sort it",),
        extras=("wait",),
        blocks=("",),
        candidate=Candidate,
    )
