"""Beam search over what to do next, as machine code, for any task that can say what one more decision brings.

A problem is a NamedTuple of arrays with a leading world axis, and two compiled functions bound to its type
(``kernels.bind``): ``extend`` and ``prospect``.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import by_kind, compiled

Array = NDArray[np.float64]

MOST_CANDIDATES = 64
"""Candidates that a sequence can keep apart: a bit each."""
NOTHING = -1
"""Answer of the search where no sequence is as good as none."""
TIE = 1e-9
"""Worths that are closer than this are equal: rounding does not decide."""


MOST_WIDTH = 1024
"""Sequences that a search within a budget keeps at most."""


class Taken(NamedTuple):
    """What a sequence has done, a bit for each candidate.

    Attributes:
        used: whether it was treated.
        low: the lower digit of the way in which; ``high`` is the upper one. So there are at most four ways.
        high: see ``low``.
    """

    used: int
    low: int
    high: int


@compiled
def with_one(taken: Taken, candidate: int, option: int) -> Taken:
    """As ``taken``, with one more candidate treated in a way."""
    bit = 1 << candidate
    return Taken(taken.used | bit, taken.low | (bit if option & 1 else 0), taken.high | (bit if option & 2 else 0))


@compiled
def way_of(taken: Taken, candidate: int) -> int:
    """In which way a candidate was treated."""
    return (taken.low >> candidate & 1) + 2 * (taken.high >> candidate & 1)


class Step(NamedTuple):
    """What one more decision brings.

    Attributes:
        x: where the machine is after it; ``y`` and ``z`` alike.
        y: see ``x``.
        z: see ``x``.
        clock_s: seconds from now until it is done.
        gain: value that it is expected to bring.
        possible: whether it can be done.
    """

    x: float
    y: float
    z: float
    clock_s: float
    gain: float
    possible: bool


@by_kind
def extend(
    problem: Any,
    w: int,
    x: float,
    y: float,
    z: float,
    clock_s: float,
    candidate: int,
    option: int,
    taken: Taken,
    first: bool,
) -> Step:
    """Treat one more candidate in world ``w`` after a sequence that ends at a place and a time.

    Args:
        problem: numbers of the problem.
        w: the world.
        x: where the machine is; ``y`` and ``z`` alike.
        y: see ``x``.
        z: see ``x``.
        clock_s: seconds from now.
        candidate: what is treated.
        option: in which way.
        taken: what the sequence has done.
        first: whether the sequence is empty so far.
    """
    raise NotImplementedError


@by_kind
def prospect(problem: Any, w: int, clock_s: float, taken: Taken, last: int) -> float:
    """What may still come after a sequence, less the price of its time.

    Args:
        problem: numbers of the problem.
        w: the world.
        clock_s: when the sequence is done, seconds from now.
        taken: what the sequence has done.
        last: the candidate that it ends at; the number of candidates where it has none.
    """
    raise NotImplementedError


class _Beams(NamedTuple):
    """The best sequences of a length, best first; leading axis is the width."""

    place: Array
    clock_s: Array
    gained: Array
    worth: Array
    used: NDArray[np.int64]
    low: NDArray[np.int64]
    high: NDArray[np.int64]
    first: NDArray[np.int64]


@compiled
def _beams(width: int) -> _Beams:
    whole = np.empty(width, np.int64)
    real = np.empty(width)
    return _Beams(np.empty((width, 3)), real, real.copy(), real.copy(), whole, whole.copy(), whole.copy(), whole.copy())


@compiled
def _place(beams: _Beams, count: int, worth: float) -> int:
    """Where a sequence of this worth comes among the ``count`` best, the others moved; the width where it does not."""
    width = len(beams.worth)
    i = min(count, width)
    while i > 0 and beams.worth[i - 1] < worth:
        i -= 1
    for j in range(min(count, width - 1), i, -1):
        for axis in range(3):
            beams.place[j, axis] = beams.place[j - 1, axis]
        beams.clock_s[j], beams.gained[j], beams.worth[j] = (
            beams.clock_s[j - 1],
            beams.gained[j - 1],
            beams.worth[j - 1],
        )
        beams.used[j], beams.low[j], beams.high[j] = beams.used[j - 1], beams.low[j - 1], beams.high[j - 1]
        beams.first[j] = beams.first[j - 1]
    return i


@compiled
def search(
    problem: Any, start: Array, idle: Array, options: int, candidates: NDArray[np.int64], depth: int, width: int
) -> NDArray[np.int64]:
    """First decision of the best sequence in each world, as ``candidate * options + option``, or ``NOTHING``.

    Sequences of up to ``depth`` decisions are grown; the ``width`` best of each length are kept. Of equals the first
    counts, and doing something before doing nothing.

    Args:
        problem: numbers of the problem.
        start: (B, 3), where the machines are.
        idle: (B,), what doing nothing is worth.
        options: ways to treat a candidate.
        candidates: (B,), the candidates of a world are 0 .. n - 1, at most ``MOST_CANDIDATES``.
        depth: longest sequence.
        width: sequences kept.
    """
    answers = np.empty(len(start), np.int64)
    now, then = _beams(width), _beams(width)
    for w in range(len(start)):
        best, answer, count = idle[w] - 2.0 * TIE, NOTHING, 1
        for axis in range(3):
            now.place[0, axis] = start[w, axis]
        now.clock_s[0], now.gained[0] = 0.0, 0.0
        now.used[0], now.low[0], now.high[0] = 0, 0, 0
        for level in range(depth):
            grown = 0
            for b in range(count):
                x, y, z, clock_s = now.place[b, 0], now.place[b, 1], now.place[b, 2], now.clock_s[b]
                before = Taken(now.used[b], now.low[b], now.high[b])
                for candidate in range(candidates[w]):
                    if now.used[b] >> candidate & 1:
                        continue
                    for option in range(options):
                        step = extend(problem, w, x, y, z, clock_s, candidate, option, before, level == 0)
                        if not step.possible:
                            continue
                        gained, taken = now.gained[b] + step.gain, with_one(before, candidate, option)
                        worth = gained + prospect(problem, w, step.clock_s, taken, candidate)
                        first = candidate * options + option if level == 0 else now.first[b]
                        if worth > best + TIE:
                            best, answer = worth, first
                        if level + 1 == depth:
                            continue
                        i = _place(then, grown, worth)
                        if i < width:
                            then.place[i, 0], then.place[i, 1], then.place[i, 2] = step.x, step.y, step.z
                            then.clock_s[i], then.gained[i], then.worth[i] = step.clock_s, gained, worth
                            then.used[i], then.low[i], then.high[i] = taken.used, taken.low, taken.high
                            then.first[i] = first
                            grown = min(grown + 1, width)
            now, then, count = then, now, grown
        answers[w] = answer
    return answers


def within(budget_ms: float, plan: Callable[[int], NDArray[np.int64]]) -> NDArray[np.int64]:
    """What the widest search says that there is time for: it keeps 1 sequence, then 2, 4, ... as long as that lasts.

    Args:
        budget_ms: wall milliseconds; the narrowest search is done however little that is.
        plan: decisions (B,) of a search that keeps so many sequences.
    """
    began, width = time.perf_counter(), 1
    while True:
        answer = plan(width)
        width *= 2
        # The next one takes about twice as long as the last, which took at most what has passed.
        if width > MOST_WIDTH or 3e3 * (time.perf_counter() - began) > budget_ms:
            return answer
