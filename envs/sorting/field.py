"""A stream of produce as a value: what comes down the belt, how it lies, its luck, and what a camera says of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..columns import names
from ..drives import DriveLuck
from ..field import ABSENT, Array, Field, Table, Toy, Whole, label, number, whole
from .columns import REPORT, Item, Report
from .config import GRADES

_LONGEST_S, _WIDEST_M, _ROUND = 1e5, 1.5, 2.5 * pi


@dataclass(frozen=True, eq=False)
class Items(Table):
    """What comes down the belt, one row an item.

    The columns are those of ``columns.Item``.
    """

    passing_s: Array = number("s", -_LONGEST_S, _LONGEST_S, "when its centre passes the machine's middle, x = 0")
    across_m: Array = number("m", -_WIDEST_M, _WIDEST_M, "its centre across the belt, from the middle")
    up_m: Array = number("m", 0.0, 0.5, "its centre above the belt, which it touches", "task")
    yaw_rad: Array = number("rad", -_ROUND, _ROUND, "direction of its long axis, from the belt's", 0.0)
    tilt_rad: Array = number("rad", 0.0, 0.5 * pi, "lean of its short axis", 0.0)
    azimuth_rad: Array = number("rad", -_ROUND, _ROUND, "where that leans to", 0.0)
    length_m: Array = number("m", 0.005, 0.3, "full length; the mean of its grade", "task")
    width: Array = number("", 0.02, 1.0, "full width / length; the mean of its grade", "task")
    thickness: Array = number("", 0.02, 1.0, "full thickness / length; the mean of its grade", "task")
    grade: Whole = label(GRADES, "where it belongs")
    ripeness: Array = number("", 0.0, 1.0, "of a fruit; the mean of its grade", "task")
    skin: Array = number("", 0.0, 1.0, "ripeness that the skin's colour suggests; its own", "task")
    grip_luck: Array = number("", 0.0, 1.0, "luck of the grip: it holds where this is below its quality", "uniform")
    way_luck: Array = number("", 0.0, 1.0, "luck of the way: it slips where this is small", "uniform")
    slip_along_m: Array = number("m", -0.5, 0.5, "how far it has left its place when it is gripped, drawn", "task")
    slip_across_m: Array = number("m", -0.5, 0.5, "the same across the belt, drawn", "task")


@dataclass(frozen=True, eq=False)
class Reports(Table):
    """What a camera says, one row a report.

    The columns are those of ``columns.Report``.
    """

    passing_s: Array = number("s", -_LONGEST_S, _LONGEST_S, "when the centre passes the machine's middle, x = 0")
    across_m: Array = number("m", -4.0, 4.0, "the centre across the belt, from the middle")
    up_m: Array = number("m", -2.0, 2.0, "the centre above the belt", "task")
    yaw_rad: Array = number("rad", -50.0, 50.0, "direction of the long axis, from the belt's", 0.0)
    tilt_rad: Array = number("rad", 0.0, 50.0, "lean of the short axis", 0.0)
    azimuth_rad: Array = number("rad", -_ROUND, _ROUND, "where that leans to", 0.0)
    length_m: Array = number("m", 0.001, 1.0, "full length; the mean of its grade", "task")
    width: Array = number("", 0.001, 1.0, "full width / length; the mean of its grade", "task")
    thickness: Array = number("", 0.001, 1.0, "full thickness / length; the mean of its grade", "task")
    grade: Whole = label(GRADES, "which grade is reported")
    seen_s: Array = number("s", -_LONGEST_S, _LONGEST_S, "when the report arrives; as the camera's place says", "task")
    item: Whole = whole(0, 1e6, "row of the item behind it, from 0; none where it is not given", "task")


@dataclass(frozen=True, eq=False)
class Sensor(Table):
    """The camera, one row."""

    noise_seed: Whole = whole(0, 2.0**53, "of the noise of rendered pictures, drawn", "task")
    code: Whole = whole(0, 2**32 - 1, "check sum of what the reports were drawn from; another makes its own", "task")


@dataclass(frozen=True, eq=False)
class Orders(Table):
    """An order book, a row a line."""

    grade: Whole = label(GRADES, "what it wants")
    count: Whole = whole(1, 10_000, "how many items of it")
    due_s: Array = number("s", 0.0, _LONGEST_S, "until when, from the beginning of the episode")


assert tuple(Items.columns()) == names(Item) and tuple(Reports.columns()) == names(Report)


@dataclass(frozen=True, eq=False)
class ProduceField(Field):
    """One stream: what comes, with all of its luck, and what the camera says of it.

    Attributes:
        items: what comes; a file needs ``passing_s``, ``across_m`` and ``grade``.
        reports: what the camera says; None: it is made from the items.
        camera: of the reports and of pictures.
        drives: luck of the machine's drives; None where none errs.
        orders: what is packed; None where every item counts, or where the book is drawn.
    """

    task: ClassVar[str] = "sorting"
    main: ClassVar[str] = "items"
    places: ClassVar[tuple[str, ...]] = ("passing_s", "across_m")

    items: Items
    reports: Reports | None = None
    camera: Sensor | None = None
    drives: DriveLuck | None = None
    orders: Orders | None = None

    @classmethod
    def toy(cls) -> tuple[Toy, ...]:
        """Instances for ``perfect`` reports in which every grip holds, with their optimum."""
        small = {"scenario.stream_s": 10.0, "scenario.time_limit_s": 30.0}

        def stream(**columns: Any) -> ProduceField:
            still = {"grip_luck": 0.0, "way_luck": 0.99, "slip_along_m": 0.0, "slip_across_m": 0.0}
            rows = len(columns["passing_s"])
            given = {name: np.full(rows, value) for name, value in (still | columns).items() if np.isscalar(value)}
            return cls(replace(Items.empty(rows), **columns, **given))

        ware, seed, ripe, green = range(len(GRADES))
        return (
            Toy(
                "one",
                stream(passing_s=[2.0], across_m=[0.03], grade=[ripe]),
                small,
                1.0,
                0.8,
                "one ripe fruit, which is worth 0.8, comes within reach and every grip holds",
            ),
            Toy(
                "either",
                stream(passing_s=[-2.4, -2.4], across_m=[0.06, -0.06], grade=[seed, ware]),
                small,
                0.5,
                1.0,
                "both leave the reach together, sooner than one pick takes: the one that is worth more is taken",
            ),
            Toy(
                "in-turn",
                stream(passing_s=[-2.0, -0.4, 0.9], across_m=[0.0, 0.04, -0.04], grade=[ware, green, ripe]),
                small,
                1.0,
                2.1,
                "there is time for all three in the order in which they leave, and in no other",
            ),
        )


class Streams(NamedTuple):
    """R streams side by side, in the form that is drawn and loaded; what does not exist passes at infinity.

    Attributes:
        items: (R, N + 1, ``Item``), the last one stands for none.
        reports: (R, M, ``Report``); none at all where they come from outside.
        noise_seed: (R,), of rendered pictures.
        luck: (R, J), of the machines' drives; None where none errs.
        orders: (R, lines, 3), grade, count and cut-off of order lines, empty ones at infinity; None without orders.
    """

    items: Array
    reports: Array
    noise_seed: Whole
    luck: Array | None = None
    orders: Array | None = None


def stacked(fields: Sequence[ProduceField], items: int, reports: int) -> Streams:
    """Complete fields side by side, with room for so many items and reports."""
    streams = Streams(
        np.full((len(fields), items + 1, len(Item._fields)), np.inf),
        np.full((len(fields), reports, len(Report._fields)), np.inf),
        np.zeros(len(fields), np.int64),
    )
    for row, field in enumerate(fields):
        streams.items[row, : len(field.items)] = _rows(field.items)
        if reports and field.reports is not None:
            said = _rows(field.reports)
            said[said[:, REPORT.item] == ABSENT, REPORT.item] = items
            streams.reports[row, : len(said)] = said
        if field.camera is not None:
            streams.noise_seed[row] = field.camera.noise_seed[0]
    return streams


def unstacked(streams: Streams, code: int) -> list[ProduceField]:
    """The fields of streams, with the ``code`` of the camera whose reports they are."""
    fields, last = [], streams.items.shape[1] - 1
    for items, said, seed in zip(*streams[:3], strict=True):
        there, reports = items[np.isfinite(items[:, 0])], None
        if len(said):
            reports = reports_of(said, last)
        sensor = Sensor(np.array([seed]), np.array([code]))
        fields.append(ProduceField(Items(*there.T), reports, sensor))
    if streams.orders is None:
        return fields
    books = [Orders(*book[np.isfinite(book[:, -1])].T) for book in streams.orders]
    return [replace(field, orders=book) for field, book in zip(fields, books, strict=True)]


def booked(fields: Sequence[ProduceField], lines: int) -> Array | None:
    """The order books of complete fields side by side, with room for so many lines; None without any."""
    if not lines:
        return None
    books = np.zeros((len(fields), lines, len(Orders.columns())))
    books[..., -1] = np.inf
    for book, field in zip(books, fields, strict=True):
        if field.orders is not None:
            book[: len(field.orders)] = _rows(field.orders)
    return books


def reports_of(said: Array, last: int) -> Reports:
    """The table of reports (M, ``Report``); item ``last`` stands for none."""
    there = said[np.isfinite(said[:, REPORT.passing_s])]
    columns = dict(zip(names(Report), there.T, strict=True))
    item = columns["item"]
    return Reports(**columns | {"item": np.where(item == last, ABSENT, item)})


def _rows(table: Table) -> Array:
    """A table's rows (n, columns)."""
    return np.stack([np.asarray(values, float) for values in table.arrays().values()], axis=-1)
