"""What the picker believes of its row, and what is true."""

from __future__ import annotations

import numpy as np

from ..belief import DONE, OPEN, STILL, Belief, placed
from .config import EFFORTS, OPEN_STAGES
from .core import SafflowerCore
from .features import Candidate


def belief(core: SafflowerCore) -> Belief:
    """Reported heads of this stop, and the open heads of the whole row."""
    state = core.state
    blooms = np.isin(state.head_stage[0], OPEN_STAGES) & ((state.head_mass_g[0] > 0.0) | state.head_visited[0])
    slots = state.slot_report[0, :-1]
    return Belief(
        slot_m=placed(slots, state.track_target.shape[1] - 1, state.track_target[0] + core.frame),
        to_m=None,
        true_m=state.head_position[0, blooms] + core.frame,
        stands=np.where(state.head_visited[0, blooms], DONE, OPEN),
        size_m=0.03,
        drift_m_s=STILL,
        options=EFFORTS,
        extras=("drive on",),
        blocks=("",),
        candidate=Candidate,
    )
