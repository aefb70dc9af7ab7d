"""Order books: how they are drawn, which line an item fills, and the bins that fill and are swapped.

A line wants a count of one grade by a time. An item that is let go over the bin of its grade fills, of the lines of
that grade that are not over, the one that is due first: no other choice fills more (earliest due date first, Jackson
1955, for units that all take as long). An item that no line waits for is surplus.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled, fill
from ..core import Array
from ..field import FieldError
from .columns import KINDS, TOTAL
from .field import Orders
from .order_columns import BOOK, DUE_SCALE_S, LEFT_SCALE, LINES_SHOWN, READY_SCALE_S, STRIDE, TALLY
from .order_config import OrderConfig
from .state import Worlds


class Line(NamedTuple):
    """Columns of an order book's rows."""

    grade: int
    wants: int
    due_s: int


LINE = Line(0, 1, 2)


def draw_orders(orders: OrderConfig, generators: Sequence[np.random.Generator]) -> Array | None:
    """Books (R, lines, ``Line``) from each generator, lines in the order of their cut-offs; None without any."""
    if not orders.shipments:
        return None
    low, high = orders.count
    books = np.empty((len(generators), orders.max_lines, len(LINE)))
    due_s = orders.every_s * (1.0 + np.arange(orders.shipments))
    for book, generator in zip(books, generators, strict=True):
        luck = generator.random((orders.shipments, KINDS + orders.lines))
        # The grades of a shipment are the first of a shuffled order.
        book[:, LINE.grade] = luck[:, :KINDS].argsort(axis=1)[:, : orders.lines].ravel()
        book[:, LINE.wants] = low + np.floor(luck[:, KINDS:] * (high - low + 1)).ravel()
        book[:, LINE.due_s] = due_s.repeat(orders.lines)
    return books


def whole_book(book: Orders | None, orders: OrderConfig, generator: np.random.Generator) -> Orders | None:
    """The order book of a field: its own, or a drawn one where it says none; None where nothing is ordered.

    Raises:
        FieldError: there are orders in a scenario without any, no line at all, or more than there is room for.
    """
    if not orders.shipments:
        if book is not None:
            raise FieldError(
                "orders are given, the scenario has none: leave them out, or set scenario.orders.shipments"
            )
        return None
    if book is None:
        drawn = draw_orders(orders, [generator])
        return Orders(*drawn[0].T) if drawn is not None else None
    if not len(book):
        raise FieldError("orders has no line: give at least one, or leave the table out to have them drawn")
    book.keep_to("orders", orders.max_lines, "set scenario.orders.shipments higher")
    return book


def open_books(worlds: Worlds, rows: NDArray[np.int64], books: Array) -> None:
    """Put books (R, lines, ``Line``) into the worlds ``rows``, what is due first in front."""
    order = books[..., LINE.due_s].argsort(axis=1, kind="stable")
    sorted_books = np.take_along_axis(books, order[..., None], axis=1)
    worlds.line_grade[rows] = sorted_books[..., LINE.grade]
    worlds.line_count[rows] = sorted_books[..., LINE.wants]
    worlds.line_due_s[rows] = sorted_books[..., LINE.due_s]


@compiled
def begin_orders(worlds: Worlds, w: int, values: Array) -> None:
    """Nothing is delivered, the bins are empty; what is ordered is what counts."""
    totals = worlds.totals[w]
    totals[TOTAL.items], totals[TOTAL.worth] = 0.0, 0.0
    for line in range(worlds.line_left.shape[1]):
        count = worlds.line_count[w, line]
        worlds.line_left[w, line] = count
        totals[TOTAL.items] += count
        totals[TOTAL.worth] += count * values[worlds.line_grade[w, line]]
    fill(worlds.bin_items[w], 0)
    fill(worlds.bin_ready_s[w], 0.0)
    fill(worlds.tallies[w], 0.0)


@compiled
def waiting_line(worlds: Worlds, w: int, grade: int, time_s: float) -> int:
    """The line that an item of a grade fills at a time; -1 where none waits for it."""
    for line in range(worlds.line_left.shape[1]):
        if (
            worlds.line_grade[w, line] == grade
            and worlds.line_left[w, line] > 0
            and worlds.line_due_s[w, line] >= time_s
        ):
            return line
    return -1


@compiled
def blocked_s(worlds: Worlds, w: int, grade: int, time_s: float) -> float:
    """Seconds that a machine over a bin at a time has to wait for an empty one."""
    return max(worlds.bin_ready_s[w, grade] - time_s, 0.0) if worlds.bin_ready_s.shape[1] else 0.0


@compiled
def fill_bin(worlds: Worlds, w: int, bin_grade: int, holds: int, swap_s: float, time_s: float) -> None:
    """One more item lies in a bin; the one that fills it has it swapped."""
    worlds.bin_items[w, bin_grade] += 1
    if worlds.bin_items[w, bin_grade] >= holds:
        worlds.bin_items[w, bin_grade] = 0
        worlds.bin_ready_s[w, bin_grade] = time_s + swap_s
        worlds.tallies[w, TALLY.swaps] += 1.0


@compiled
def deliver(worlds: Worlds, w: int, grade: int, time_s: float) -> bool:
    """Whether a line takes an item that lies in the bin of its grade."""
    line = waiting_line(worlds, w, grade, time_s)
    if line < 0:
        worlds.tallies[w, TALLY.surplus] += 1.0
        return False
    worlds.line_left[w, line] -= 1
    return True


@compiled
def lines_full(worlds: Worlds, w: int) -> float:
    """Share of the lines to which nothing is lacking."""
    lines, full = 0, 0
    for line in range(worlds.line_left.shape[1]):
        lines += worlds.line_count[w, line] > 0
        full += worlds.line_count[w, line] > 0 and worlds.line_left[w, line] == 0
    return full / max(lines, 1)


@compiled
def show_book(worlds: Worlds, w: int, holds: int, limit: float, machine: NDArray[np.float32]) -> None:
    """Write the features of bins and open lines, behind the machine's own."""
    time_s = worlds.totals[w, TOTAL.time_s]
    for grade in range(KINDS):
        place = BOOK + STRIDE * grade
        machine[place] = worlds.bin_items[w, grade] / holds
        machine[place + 1] = min(blocked_s(worlds, w, grade, time_s) / READY_SCALE_S, limit)
        for number in range(2, STRIDE):
            machine[place + number] = 0.0
        shown = 0
        for line in range(worlds.line_left.shape[1]):
            left, due_s = worlds.line_left[w, line], worlds.line_due_s[w, line]
            if worlds.line_grade[w, line] == grade and left > 0 and due_s >= time_s and shown < LINES_SHOWN:
                machine[place + 2 + 2 * shown] = min(left / LEFT_SCALE, limit)
                machine[place + 3 + 2 * shown] = min((due_s - time_s) / DUE_SCALE_S, limit)
                shown += 1
