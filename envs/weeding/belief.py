"""What a weeder believes of its strip, and what is true."""

from __future__ import annotations

import numpy as np

from ..belief import DONE, LOST, OPEN, STILL, Belief, placed
from .core import WeedingCore
from .features import Candidate
from .state import BLOCKS
from .timing import G

_MARK_LEVEL_M = 0.012
_SPEEDS = ("hold the speed", "slower", "faster")


def belief(core: WeedingCore) -> Belief:
    """Tracks that may be treated now, and the true weeds of the strip."""
    state, end = core.state, core.weeds_end
    exists = core.plant_exists[0, :end]
    weed = state.plant[0, :end][exists]
    dead = (state.plant_dose[0, :end] >= state.plant_tolerance[0, :end])[exists]
    passed = weed[:, G.along] < state.cart[0] - core.tables.exit_m
    ground = np.column_stack([state.track_report[0], np.full(len(state.track_report[0]), _MARK_LEVEL_M)])
    return Belief(
        slot_m=placed(state.slot_track[0], state.track_real.shape[1] - 1, ground),
        to_m=None,
        true_m=np.column_stack([weed, np.full(len(weed), _MARK_LEVEL_M)]),
        stands=np.where(dead, DONE, np.where(passed, LOST, OPEN)),
        size_m=0.02,
        drift_m_s=STILL,
        options=tuple(core.process.modes),
        extras=("wait",),
        blocks=_SPEEDS[:BLOCKS] if core.tables.speed_control else ("",),
        candidate=Candidate,
    )
