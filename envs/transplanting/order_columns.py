"""What policies are shown of the machine where trays are ordered: ``Machine``, then both carousels."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, get_type_hints

from ..columns import Says, names
from .columns import SHOWN, Machine
from .config import MOST_ORDERS, MOST_SOURCES

LEFT_SCALE_S = 60.0
"""What the times until lorries leave are divided by."""


class SourceTray(NamedTuple):
    """A source tray; all is 0 where none stands."""

    rows: Annotated[int, Says("", "its rows behind the one that it presents / its rows", 1.0, 0.0, 1.0)]
    first: Annotated[int, Says("", "seedlings reported healthy in that row / columns, 0 before a look", 1.0, 0.0, 1.0)]
    second: Annotated[int, Says("", "seedlings reported poor in that row / columns, 0 before a look", 1.0, 0.0, 1.0)]
    share: Annotated[int, Says("", "share of the second grade in its sowing", 1.0, 0.0, 1.0)]


class Order(NamedTuple):
    """A target tray; all is 0 where none stands, and when its lorry has left or all its rows have gone."""

    open: Annotated[int, Says("", "whether it can still be served", 1.0, 0.0, 1.0)]
    second: Annotated[int, Says("", "whether it wants the second grade", 1.0, 0.0, 1.0)]
    left: Annotated[int, Says("s", "until its lorry leaves", LEFT_SCALE_S, 0.0, SHOWN)]
    cells: Annotated[int, Says("", "cells of the rows that have not gone that lack it / cells", 1.0, 0.0, 1.0)]


SOURCES_AT = len(names(Machine))
ORDERS_AT = SOURCES_AT + MOST_SOURCES * len(names(SourceTray))
"""Where the carousels stand behind ``Machine``; each begins with the tray that is presented and goes round."""


def _order_machine() -> Any:
    hints = dict(get_type_hints(Machine, include_extras=True))
    for kind, block, most in (("source", SourceTray, MOST_SOURCES), ("order", Order, MOST_ORDERS)):
        for place in range(most):
            for name, hint in get_type_hints(block, include_extras=True).items():
                says: Says = hint.__metadata__[0]
                where = "presented" if place == 0 else f"{place} on"
                hints[f"{kind}_{place}_{name}"] = Annotated[int, says._replace(doc=f"{where}: {says.doc}")]
    made = NamedTuple("OrderMachine", list(hints.items()))  # type: ignore[misc]
    made.__module__ = __name__
    return made


OrderMachine = _order_machine()
"""``Machine``, then ``SourceTray`` and ``Order`` of every place of the carousels."""
