"""The first limit that a motion of the 3-PRRS breaks, looked for along the whole motion."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..mechanisms import ThreePRRS


class Violation(NamedTuple):
    """A broken limit: its name among the mechanism's margins, the margin there (negative) and the sample."""

    limit: str
    margin: float
    sample: int


def first_violation(mechanism: ThreePRRS, pose: ArrayLike) -> Violation | None:
    """The first sample of a motion, poses (n, 6), that breaks a limit; None where the whole motion is within them.

    Of several limits broken at once the one with the smallest margin is named.
    """
    margins = mechanism.margins(pose)
    table = np.stack(list(margins.values()), axis=-1)
    broken = table < 0.0
    bad = broken.any(axis=-1)
    if not bad.any():
        return None
    sample = int(bad.argmax())
    column = int(np.where(broken[sample], table[sample], np.inf).argmin())
    return Violation(list(margins)[column], float(table[sample, column]), sample)
