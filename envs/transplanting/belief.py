"""What the transplanter believes of the presented rows, and what is true."""

from __future__ import annotations

import numpy as np

from ..belief import DONE, LOST, OPEN, STILL, Belief
from .columns import Candidate
from .config import EMPTY, SPEEDS
from .core import TransplantingCore
from .orders import wanted
from .scene import TRAY_TOP_M

_ABOVE_M = 0.06
"""Marks float over the seedlings."""


def belief(core: TransplantingCore) -> Belief:
    """Pairs of presented cells that the machine takes for possible; what the cells really hold.

    A source cell is open while it holds a healthy seedling and lost with any other; a target cell is open while it
    lacks one. Where trays are ordered, the grade that the presented one wants stands for healthy.
    """
    state, n, m = core.state, core.source_shape[1], core.target_shape[1]
    cells_m = np.column_stack([np.zeros(n + m), core.places.x_m[: n + m], np.full(n + m, TRAY_TOP_M + _ABOVE_M)])
    pairs = np.arange(n * m)
    taken = core.observe()["candidates"][0].reshape(n * m, -1)[:, 0] > 0.5
    source, target = cells_m[pairs // m].copy(), cells_m[n + pairs % m].copy()
    source[~taken] = target[~taken] = np.nan
    supply = state.source_cells[0, state.source_row[0]]
    holds = state.target_cells[0, state.target_row[0]]
    there = np.concatenate([supply != EMPTY, np.ones(m, bool)])
    good = wanted(state, 0)
    stands = np.concatenate([np.where(supply == good, OPEN, LOST), np.where(holds == good, DONE, OPEN)])
    return Belief(
        slot_m=source,
        to_m=target,
        true_m=cells_m[there],
        stands=stands[there],
        size_m=0.012,
        drift_m_s=STILL,
        options=SPEEDS,
        extras=(*(("next source tray", "next order") if core.ordered else ()), "next source row", "next target row"),
        blocks=("",),
        candidate=Candidate,
    )
