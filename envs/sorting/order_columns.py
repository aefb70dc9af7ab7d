"""Names of the numbers that there are where produce is packed to order, behind those of ``columns``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple, get_type_hints

from ..columns import Says, names, numbered
from .columns import LIMIT, Machine, Scores
from .config import GRADES

LINES_SHOWN = 3
"""Open order lines of a grade that policies are shown, those that are due first."""
LEFT_SCALE = 6.0
DUE_SCALE_S = 20.0
READY_SCALE_S = 4.0
"""What the features are divided by, to be of order one."""


def _extended(name: str, block: type[Any], others: Mapping[str, Says]) -> Any:
    """A block with names behind it; those that it has mean something else."""
    more = {key: Annotated[int, says] for key, says in others.items()}
    return NamedTuple(name, list({**get_type_hints(block, include_extras=True), **more}.items()))  # type: ignore[misc]


def _shown() -> dict[str, Says]:
    """What is shown of bins and lines, grade by grade."""
    said: dict[str, Says] = {}
    for grade in GRADES:
        said[f"{grade}_fill"] = Says("", f"items in the bin of {grade} / what it holds", 1.0, 0.0, 1.0)
        said[f"{grade}_ready"] = Says("s", "until an empty bin stands there", READY_SCALE_S, 0.0, LIMIT)
        for line in range(1, LINES_SHOWN + 1):
            said[f"{grade}_left_{line}"] = Says("", f"items that open line {line} still needs", LEFT_SCALE, 0.0, LIMIT)
            said[f"{grade}_due_{line}"] = Says("s", "until it is due; 0 where there is none", DUE_SCALE_S, 0.0, LIMIT)
    return said


OrderedMachine = _extended("OrderedMachine", Machine, _shown())
"""What policies are shown of the machine, its bins and the order lines that are open, by grade."""
OrderedScores = _extended(
    "OrderedScores",
    Scores,
    {
        "net_rate": Says("", "items that fill an order line in time / items ordered"),
        "cycle_time_s": Says("s", "time until the last item filled a line / such items"),
        "throughput_per_min": Says("1/min", "items that fill a line, a minute"),
        "done": Says("", "items that fill a line in time"),
        "missed": Says("", "items ordered and not delivered in time"),
        "value_rate": Says("", "value of the items that fill a line / value of all that is ordered"),
        "total": Says("", "items ordered"),
        "surplus": Says("", "items in the bins of their grades that no line waits for"),
        "swaps": Says("", "bins that were full"),
        "lines_full": Says("", "order lines filled in time / order lines"),
    },
)
"""The scorecard where there are orders."""


class Tallies(NamedTuple):
    """Running totals of a world that there are with orders alone."""

    surplus: Annotated[int, Says("", "items in the bins of their grades that no line waited for")]
    swaps: Annotated[int, Says("", "bins that were full")]


TALLY = numbered(Tallies)
BOOK = len(names(Machine))
"""Place of the first number of bins and lines among the machine's."""
STRIDE = 2 + 2 * LINES_SHOWN
"""Numbers of a grade there."""
FULL = names(OrderedScores).index("lines_full")
assert names(OrderedMachine)[:BOOK] == names(Machine) and names(OrderedScores)[: len(names(Scores))] == names(Scores)
assert names(OrderedScores)[FULL - len(names(Tallies)) :] == (*names(Tallies), "lines_full")
assert len(names(OrderedMachine)) == BOOK + STRIDE * len(GRADES)
