"""Convolutions over pictures as machine code: channels first, float32, sums in a fixed order.

A matrix product of a library would be as quick, but its last digits depend on the processor; these do not. Every loop
over a line of a picture reads and writes so few arrays that the compiler can see that they lie apart: that is what the
steps of two channels are for, so channels come in pairs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled

Planes = NDArray[np.float32]
"""(channels, rows, columns)."""

_TOGETHER = 256
"""Places of a picture that are worked on at a time, so that all of their channels stay near the processor."""


@compiled
def apart(picture: Planes) -> tuple[Planes, Planes]:
    """Even and odd columns of a picture of even width, (c, h, w / 2) each."""
    channels, height, width = picture.shape
    even = np.empty((channels, height, width // 2), np.float32)
    odd = np.empty((channels, height, width // 2), np.float32)
    for c in range(channels):
        for y in range(height):
            for x in range(width // 2):
                even[c, y, x], odd[c, y, x] = picture[c, y, 2 * x], picture[c, y, 2 * x + 1]
    return even, odd


@compiled
def colours_apart(rgb: NDArray[np.uint8], middle: float, spread: float) -> tuple[Planes, Planes]:
    """``apart`` of a picture (h, w, 3) in bytes, each less ``middle`` in parts of ``spread``."""
    height, width, channels = rgb.shape
    even = np.empty((channels, height, width // 2), np.float32)
    odd = np.empty((channels, height, width // 2), np.float32)
    less, share = np.float32(middle), np.float32(1.0 / spread)
    for y in range(height):
        for x in range(width // 2):
            for c in range(channels):
                even[c, y, x] = (np.float32(rgb[y, 2 * x, c]) - less) * share
                odd[c, y, x] = (np.float32(rgb[y, 2 * x + 1, c]) - less) * share
    return even, odd


@compiled
def _three(one, two, left, middle, right, first, w, o, c, k):  # type: ignore[no-untyped-def]
    """Add a line's three taps to two channels' lines; before the first place there is nothing."""
    a, b, d = w[o, c, k, 0], w[o, c, k, 1], w[o, c, k, 2]
    e, f, g = w[o + 1, c, k, 0], w[o + 1, c, k, 1], w[o + 1, c, k, 2]
    one[0] += b * middle[0] + d * right[0] + a * first
    two[0] += f * middle[0] + g * right[0] + e * first
    _two_lines(one[1:], two[1:], left, middle[1:], right[1:], a, b, d, e, f, g)


@compiled
def _two_lines(one, two, left, middle, right, a, b, d, e, f, g):  # type: ignore[no-untyped-def]
    # No place is counted from another one: eight are worked on at a time.
    for x in range(len(one)):
        one[x] += a * left[x] + b * middle[x] + d * right[x]
        two[x] += e * left[x] + f * middle[x] + g * right[x]


@compiled
def halving(even: Planes, odd: Planes, weight: Planes, bias: Planes) -> Planes:
    """Every other place of a 3 x 3 convolution of a picture that came ``apart``, negative values cut.

    What comes out is (o, h / 2, w / 2).

    Args:
        even: (c, h, w / 2).
        odd: (c, h, w / 2).
        weight: (o, c, 3, 3), o even.
        bias: (o,).
    """
    channels, height, width = even.shape
    outs, low = weight.shape[0], np.float32(0.0)
    out = np.empty((outs, height // 2, width), np.float32)
    for y in range(height // 2):
        for o in range(0, outs, 2):
            one, two = out[o, y], out[o + 1, y]
            for x in range(width):
                one[x], two[x] = bias[o], bias[o + 1]
            for c in range(channels):
                for k in range(3):
                    line = 2 * y + k - 1
                    if line >= 0:
                        _three(one, two, odd[c, line], even[c, line], odd[c, line], low, weight, o, c, k)
            for x in range(width):
                one[x] = max(one[x], low)
            for x in range(width):
                two[x] = max(two[x], low)
    return out


@compiled
def _one_line(line, left, middle, right, a, b, d):  # type: ignore[no-untyped-def]
    for x in range(len(line)):
        line[x] += a * left[x] + b * middle[x] + d * right[x]


@compiled
def _each_line(line, picture, weight, y, reach):  # type: ignore[no-untyped-def]
    """Write a line of one channel's convolution."""
    height, width = picture.shape
    for x in range(width):
        line[x] = np.float32(0.0)
    for k in range(3):
        above = y + (k - 1) * reach
        if above < 0 or above >= height:
            continue
        seen, a, b, d = picture[above], weight[k, 0], weight[k, 1], weight[k, 2]
        for x in range(reach):
            line[x] += b * seen[x] + d * seen[x + reach]
        _one_line(line[reach : width - reach], seen, seen[reach:], seen[2 * reach :], a, b, d)
        for x in range(width - reach, width):
            line[x] += a * seen[x - reach] + b * seen[x]


@compiled
def each(picture: Planes, weight: Planes, reach: int) -> Planes:
    """Each channel by itself: a 3 x 3 convolution whose taps lie ``reach`` places apart, (c, h, w).

    Args:
        picture: (c, h, w).
        weight: (c, 3, 3).
        reach: from tap to tap, less than half the width.
    """
    out = np.empty(picture.shape, np.float32)
    for c in range(len(picture)):
        for y in range(picture.shape[1]):
            _each_line(out[c, y], picture[c], weight[c], y, reach)
    return out


@compiled
def _mix(places, weight, bias, out, begin, end):  # type: ignore[no-untyped-def]
    """Write ``weight @ places + bias`` of some places; channels come in pairs."""
    for o in range(0, len(weight), 2):
        one, two = out[o, begin:end], out[o + 1, begin:end]
        for i in range(len(one)):
            one[i], two[i] = bias[o], bias[o + 1]
        for c in range(0, len(places), 2):
            p, q = places[c, begin:end], places[c + 1, begin:end]
            a, b, d, e = weight[o, c], weight[o, c + 1], weight[o + 1, c], weight[o + 1, c + 1]
            for i in range(len(one)):
                one[i] += a * p[i] + b * q[i]
                two[i] += d * p[i] + e * q[i]


@compiled
def mixed(places: NDArray[np.float32], weight: NDArray[np.float32], bias: Planes) -> NDArray[np.float32]:
    """All channels of each place into new ones: ``weight @ places + bias``, (o, n).

    Args:
        places: (c, n), c even.
        weight: (o, c), o even.
        bias: (o,).
    """
    n = places.shape[1]
    out = np.empty((len(weight), n), np.float32)
    for begin in range(0, n, _TOGETHER):
        _mix(places, weight, bias, out, begin, min(begin + _TOGETHER, n))
    return out


@compiled
def _cut_line(line):  # type: ignore[no-untyped-def]
    low = np.float32(0.0)
    for i in range(len(line)):
        line[i] = max(line[i], low)


@compiled
def concluded(
    coarse: Planes,
    fine: Planes,
    near: Planes,
    head: NDArray[np.float32],
    head_bias: NDArray[np.float32],
    answer: NDArray[np.float32],
    answer_bias: NDArray[np.float32],
) -> Planes:
    """What a network's last layers make of a coarse picture, doubled, over a fine one, line by line: (o, 2 h, 2 w).

    ``each`` with ``near``, mixed into a ``head`` whose negative values are cut, mixed into answers.

    Args:
        coarse: (c, h, w).
        fine: (d, 2 h, 2 w).
        near: (c + d, 3, 3).
        head: (k, c + d).
        head_bias: (k,).
        answer: (o, k).
        answer_bias: (o,).
    """
    many, high, wide = len(coarse), 2 * coarse.shape[1], 2 * coarse.shape[2]
    # Three lines of the doubled picture, the one in the middle that of the answer.
    lines = np.zeros((many, 3, wide), np.float32)
    seen, told = np.empty((many + len(fine), wide), np.float32), np.empty((len(head), wide), np.float32)
    line = np.empty((len(answer), wide), np.float32)
    out, spare = np.empty((len(answer), high, wide), np.float32), np.empty(wide // 2, np.float32)
    for c in range(many):
        _doubled_line(coarse[c], 0, spare, lines[c, 2])
    for y in range(high):
        for c in range(many):
            for x in range(wide):
                lines[c, 0, x], lines[c, 1, x] = lines[c, 1, x], lines[c, 2, x]
            if y + 1 < high:
                _doubled_line(coarse[c], y + 1, spare, lines[c, 2])
            else:
                for x in range(wide):
                    lines[c, 2, x] = np.float32(0.0)
            _each_line(seen[c], lines[c], near[c], 1, 1)
        for c in range(len(fine)):
            _each_line(seen[many + c], fine[c], near[many + c], y, 1)
        _mix(seen, head, head_bias, told, 0, wide)
        for k in range(len(told)):
            _cut_line(told[k])
        _mix(told, answer, answer_bias, line, 0, wide)
        for o in range(len(answer)):
            for x in range(wide):
                out[o, y, x] = line[o, x]
    return out


@compiled
def add_cut(sums: NDArray[np.float32], values: NDArray[np.float32]) -> None:
    """Add what is positive of ``values`` (c, n) to ``sums`` (c, n)."""
    low = np.float32(0.0)
    for c in range(len(values)):
        line, more = sums[c], values[c]
        for i in range(len(line)):
            line[i] += max(more[i], low)


@compiled
def _doubled_line(picture, y, spare, shown):  # type: ignore[no-untyped-def]
    """Write line ``y`` of a picture (h, w) of twice the size, linear between the middles of places."""
    height, width = picture.shape
    near, far = np.float32(0.75), np.float32(0.25)
    one = picture[y // 2]
    two = picture[max(y // 2 - 1, 0)] if y % 2 == 0 else picture[min(y // 2 + 1, height - 1)]
    for x in range(width):
        spare[x] = near * one[x] + far * two[x]
    shown[0], shown[2 * width - 1] = spare[0], spare[width - 1]
    for x in range(1, width):
        shown[2 * x - 1] = near * spare[x - 1] + far * spare[x]
        shown[2 * x] = near * spare[x] + far * spare[x - 1]
