"""What a bag that fills up costs at least: the fuller it is, the more of what is cut drops.

Of the u_i grams that pick i would lose with every gram that lies in the bag it loses at least u_i times what was picked
before it since the bag was emptied, v_j grams each at least. Two picks of a bag lose no less than min(u_i v_j, u_j v_i)
= v_i v_j min(r_i, r_j), r = u / v, whichever comes first. Layer by layer of r that is the sum over all pairs of a bag's
grams B: half of B squared less the squares of each, and for any b no square is less than 2 b B - b squared. So every
pick costs its share of 2 b B, every bag saves b squared: worth it as long as emptying a bag costs more than that. All
of this holds on every path, whatever the picks; b is a price that falls with the layer as the number of heads in it.

Known luck has u and v as they are. In expectation u is a mean, since luck that decides what a pick brings has nothing
to do with what lay in the bag before; what v is of each head may be known.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Clogging(NamedTuple):
    """What picks cost at least, of all options of all stops.

    Attributes:
        costs: (n, E) a stop, in grams.
        saved: grams that every bag saves, the first one too.
    """

    costs: list[Array]
    saved: float


def clogging(more: list[Array], least: list[Array], saved: float) -> Clogging:
    """Costs of picks at which no bag saves more than so many grams.

    Args:
        more: (n, E) a stop, u of every option.
        least: (n, E) a stop, v.
        saved: grams.
    """
    ratios = [u / np.where(v > 0.0, v, np.inf) for u, v in zip(more, least, strict=True)]
    # One option a head will do for the layers: any prices are valid.
    layers = np.sort(np.concatenate([ratio[:, ratio.shape[1] // 2] for ratio in ratios]))
    heights = np.arange(len(layers), 0, -1) / max(len(layers), 1)
    widths = np.diff(layers, prepend=0.0)
    square = float((heights * heights) @ widths)
    if square <= 0.0 or saved <= 0.0:
        return Clogging([np.zeros(u.shape) for u in more], 0.0)
    price = math.sqrt(2.0 * saved / square)
    corners, sums = np.append(0.0, layers), price * np.append(0.0, np.cumsum(heights * widths))
    costs = [v * np.interp(ratio, corners, sums) - 0.5 * v * u for u, v, ratio in zip(more, least, ratios, strict=True)]
    return Clogging(costs, saved)
