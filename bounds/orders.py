"""Bounds for the tray transplanter where trays are ordered.

The clairvoyant one knows everything as in ``transplanting``, and has the same shares of a transplant's time; what can
be done by each lorry's time is a linear program (see ``lorries``). Left out is which rows meet and in what sequence,
and that plugs, rows and turns come whole. What plans that know as much got from the rules is told too (``tray_plans``).

In expectation nobody knows what will come of a plug, nor what is true of a seedling that was reported, but the chances
of both: cells are sown independently of each other, and a tray's share of the second grade is told. So nothing that
was done or seen before says more of a plug than its report does, and means are linear in the chance that it is tried.
Who plans may know all reports from the beginning, and what stands in a cell as soon as it was set there.
"""

from __future__ import annotations

import copy
import math
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..envs.transplanting.chances import held, sown
from ..envs.transplanting.columns import H
from ..envs.transplanting.config import EMPTY, HEALTHY, POOR, TransplantingConfig
from ..envs.transplanting.core import TransplantingCore
from .base import Bound, Expectation, check_method, check_start, relative_gap, state_of
from .lorries import Bench, Program, Tries
from .nursery import Nursery, nursery_of
from .transplanting import OPEN, USELESS, Shares, TrayInstance, fastest, shares
from .transplanting import instance_of as trays_in_line
from .tray_plans import found

Array = NDArray[np.float64]
_WORDS = "linear program over lorries, rows, plugs and turns; shares of plugs and cells from assignment duals"


@dataclass(frozen=True, eq=False)
class OrderInstance:
    """Ordered trays with their luck.

    Attributes:
        bench: the trays as they are.
        tries: what comes of trying the plugs that arrive whole.
        hoped: the trays and ``tries`` as far as chances tell.
        all_cells: ordered cells.
        config: the task's numbers.
        words: what is known of the reports.
        core: the rules of this world, for plans to be carried out, and what these go by; None where reports are not
            drawn.
    """

    bench: Bench
    tries: Tries
    hoped: tuple[Bench, Tries]
    all_cells: int
    config: TransplantingConfig
    words: str
    core: tuple[Any, Nursery] | None

    def without_schedule(self) -> OrderInstance:
        """Bounds alone: what is carried out besides is sought longer than these."""
        return replace(self, core=None)

    def bound(self, method: str = "relaxation", time_limit_s: float = 60.0) -> Bound:
        """What no policy can beat; see ``Instance``. Both methods are the same.

        Raises:
            ValueError: unknown method, or a reward that pays for time or for spoiled seedlings.
        """
        check_method(method)
        weights = self.config.weights
        if min(weights.planted, -weights.spoiled, -weights.seconds) < 0.0:
            raise ValueError(f"{weights}: the bound needs planted >= 0, spoiled <= 0 and seconds <= 0")
        began = time.perf_counter()
        program, hoped = Program(self.bench, self.tries), Program(*self.hoped)
        most = math.floor(program.most_cells() + 1e-6)
        net_rate, value = most / self.all_cells, program.largest_return()
        cycle_s = program.cycle_time(max(most, 1)) if most else math.inf
        hope = Expectation(
            hoped.most_cells() / self.all_cells, hoped.largest_return(), "plugs and true grades by their chances", False
        )
        words = f"{_WORDS}; {self.words}"
        reached, gap = None, math.nan
        if self.core is not None:
            reached = found(*self.core)
            gap = max(relative_gap(net_rate, reached.net_rate), relative_gap(value, reached.episode_return))
        return Bound(net_rate, value, cycle_s, words, gap == 0.0, gap, time.perf_counter() - began, hope, reached)

    def cycle_time_at(self, net_rate: float) -> float:
        """Seconds that the cycle time cannot fall below with at least this net rate; infinite when it cannot be had."""
        return Program(self.bench, self.tries).cycle_time(max(math.ceil(net_rate * self.all_cells - 1e-9), 1))


def instance_of(core: TransplantingCore, reports: str = "drawn", row: int = 0) -> OrderInstance | TrayInstance:
    """What stands in a world of the rules right after its reset, ordered or not; see ``transplanting.instance_of``.

    Raises:
        ValueError: the episode is under way, or ``reports`` is unknown.
    """
    state, config = state_of(core), core.config
    if not config.scenario.orders.on:
        return trays_in_line(core, reports, row)
    check_start(reports, state.place[row] != core.places.park or state.source_row[row] or state.target_row[row])
    (rows_s, _), (rows_t, m) = core.source_shape, core.target_shape
    source, table = state.source_cells[row, :rows_s], core.times
    told = None if reports == "any" else state.source_reports[row, :rows_s]
    speed = fastest(core, row, (source == HEALTHY) | (source == POOR))
    grade, rows = state.grade[row].astype(np.int64), core.target_trays[1]
    prices = shares(core.places, table, speed, np.full((rows_t, m), OPEN))
    lacks = np.ones((rows_t, m), bool)
    if told is not None:
        speed[told == EMPTY] = USELESS
        # A cell that is taken to hold what it should is never served.
        lacks = state.target_reports[row, :rows_t] != np.repeat(grade, rows)[:, None]
    known = np.eye(POOR + 1)[source]
    bench = Bench(
        source=core.source_trays,
        cells=lacks.reshape(-1, rows, m).sum(axis=1),
        grade=grade,
        due_s=state.due_s[row].copy(),
        sold=known[..., HEALTHY:].sum(axis=(1, 2)),
        shares=prices,
        row_s=table.row_s[:, 0].copy(),
        turn_s=table.turn_s,
        weights=config.weights,
    )
    believed = known if told is None else _believed(core, told, known)
    return OrderInstance(
        bench=bench,
        tries=_certain(core, prices, speed, source, told, grade),
        hoped=(
            bench._replace(sold=believed[..., HEALTHY:].sum(axis=(1, 2))),
            _likely(core, prices, believed, told, grade),
        ),
        all_cells=rows_t * m,
        config=config,
        words="any reports" if reports == "any" else "reports as drawn",
        core=(copy.deepcopy(core.world(row)), nursery_of(core, row, speed, lacks)) if reports == "drawn" else None,
    )


def _believed(core: TransplantingCore, told: NDArray[np.int8], known: Array) -> Array:
    """Chances (source rows, n, 3) of what cells hold given all reports; what they hold where neighbours say more."""
    if core.perception is None or core.config.scenario.clumped > 0.0:
        return known
    sowing = sown(core.config.scenario.vacancy, core.terms.supply)
    tray = np.arange(len(told)) // core.source_trays[1]
    return held(sowing, np.array(core.perception.source))[tray[:, None], told]


def _certain(
    core: TransplantingCore,
    prices: Shares,
    speed: NDArray[np.int64],
    source: NDArray[np.int8],
    told: NDArray[np.int8] | None,
    grade: NDArray[np.int64],
) -> Tries:
    """Every plug that arrives whole at some speed, for the orders of its grade."""
    row, column = np.nonzero(speed != USELESS)
    plug, order = np.nonzero(source[row, column][:, None] == grade)
    takes_s = prices.plug_s[speed[row, column], column] + float(prices.cell_s.min()) + core.times.handle_s
    closes = np.zeros(len(plug), bool) if told is None else told[row, column][plug] == grade[order]
    sure = np.ones(len(plug))
    return Tries(row, np.ones(len(row)), plug, order, sure, sure, closes, takes_s[plug])


def _likely(
    core: TransplantingCore,
    prices: Shares,
    believed: Array,
    told: NDArray[np.int8] | None,
    grade: NDArray[np.int64],
) -> Tries:
    """Every plug that may be tried, at every speed for every order."""
    holds = believed[..., HEALTHY:].sum(axis=-1)
    row, column = np.nonzero((holds > 0.0) & (True if told is None else told != EMPTY))
    chances, process = core.terms.chances, core.config.process
    right = believed[row, column][:, grade]
    plug, order, speed = (places.ravel() for places in np.indices((*right.shape, len(chances))))
    useful = right[plug, order] > 0.0
    plug, order, speed = plug[useful], order[useful], speed[useful]
    there = holds[row, column]
    grips = there[plug] * process.extraction
    whole = process.extraction * (1.0 - chances[:, H.lose]) * (1.0 - chances[:, H.damage])
    carry_s = prices.plug_s[speed, column[plug]] + float(prices.cell_s.min()) + core.times.handle_s
    return Tries(
        row=row,
        holds=there,
        plug=plug,
        order=order,
        gain=right[plug, order] * whole[speed],
        arrives=grips * (1.0 - chances[speed, H.lose]),
        closes=np.zeros(len(plug), bool) if told is None else told[row, column][plug] == grade[order],
        try_s=grips * carry_s + (1.0 - grips) * process.grip_s,
    )
