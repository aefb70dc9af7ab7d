"""What lens, shutter and sensor make of light: blur, motion, exposure, noise of every colour."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled
from .noise import normals
from .shapes import Array

_TAPS = 9
"""Of a blur each way."""


class Optics(NamedTuple):
    """A camera's lens, shutter and sensor.

    Attributes:
        lens_px: standard deviation of the lens's blur.
        moved_px: how far the picture moves down while the shutter is open.
        gain: (3,), of the colours: exposure and white balance.
        read: standard deviation of the sensor's own noise, out of 255.
        shot: variance that a level of light adds, of its level.
        corner: share of the light that the picture's corners lose.
    """

    lens_px: float
    moved_px: float
    gain: Array
    read: float
    shot: float
    corner: float


def taps(lens_px: float, moved_px: float) -> NDArray[np.float32]:
    """Weights (``_TAPS``,) of a blur along a line: a Gaussian smeared over a way."""
    middle, weights = _TAPS // 2, []
    for i in range(_TAPS):
        steps = [i - middle - moved_px * ((k + 0.5) / 8.0 - 0.5) for k in range(8)]
        weights.append(math.fsum(math.exp(-0.5 * (step / max(lens_px, 0.2)) ** 2) for step in steps))
    total = math.fsum(weights)
    return np.array([weight / total for weight in weights], np.float32)


@compiled
def blurred(image: NDArray[np.float32], across: NDArray[np.float32], down: NDArray[np.float32]) -> NDArray[np.float32]:
    """An image (h, w, 3) blurred along its rows and columns; beyond its edges it goes on as it ends."""
    high, wide, _ = image.shape
    size, reach = 3 * wide, _TAPS // 2
    flat, out = np.empty((high, size), np.float32), np.empty((high, size), np.float32)
    low = min(3 * reach, size)
    end = max(size - 3 * reach, low)
    # All weights of a place in one expression: a sum that is written and read again for each takes half as long again.
    a, b, c, d, e = across[0], across[1], across[2], across[3], across[4]
    f, g, h, i = across[5], across[6], across[7], across[8]
    for y in range(high):
        line, shown = image[y].reshape(size), flat[y]
        for k in range(low, end):
            before = a * line[k - 12] + b * line[k - 9] + c * line[k - 6] + d * line[k - 3]
            shown[k] = before + e * line[k] + f * line[k + 3] + g * line[k + 6] + h * line[k + 9] + i * line[k + 12]
        for k in range(low):
            shown[k] = _at_an_edge(line, across, k)
        for k in range(end, size):
            shown[k] = _at_an_edge(line, across, k)
    a, b, c, d, e = down[0], down[1], down[2], down[3], down[4]
    f, g, h, i = down[5], down[6], down[7], down[8]
    last = high - 1
    for y in range(high):
        shown, here = out[y], flat[y]
        l1, l2, l3, l4 = flat[max(y - 1, 0)], flat[max(y - 2, 0)], flat[max(y - 3, 0)], flat[max(y - 4, 0)]
        r1, r2 = flat[min(y + 1, last)], flat[min(y + 2, last)]
        r3, r4 = flat[min(y + 3, last)], flat[min(y + 4, last)]
        for k in range(size):
            before = a * l4[k] + b * l3[k] + c * l2[k] + d * l1[k]
            shown[k] = before + e * here[k] + f * r1[k] + g * r2[k] + h * r3[k] + i * r4[k]
    return out.reshape(high, wide, 3)


@compiled
def _at_an_edge(line: NDArray[np.float32], across: NDArray[np.float32], k: int) -> np.float32:
    """What is blurred along a row (3 w,) at a place near its beginning or its end."""
    total, size = np.float32(0.0), len(line)
    for tap in range(_TAPS):
        at = k + 3 * (tap - _TAPS // 2)
        if at < 0:
            at = k % 3
        elif at >= size:
            at = size - 3 + k % 3
        total += across[tap] * line[at]
    return total


@compiled
def sensed(
    image: NDArray[np.float32], gain: Array, read: float, shot: float, corner: float, state: NDArray[np.uint64]
) -> NDArray[np.uint8]:
    """The bytes (h, w, 3) of an image in light.

    Args:
        image: (h, w, 3).
        gain: see ``Optics``, like the following.
        read: see there.
        shot: see there.
        corner: see there.
        state: of the noise, see ``noise.stream``; moved on.
    """
    high, wide, _ = image.shape
    rgb, line = np.empty((high, wide, 3), np.uint8), np.empty(3 * wide, np.float32)
    far = 1.0 / (0.25 * (high * high + wide * wide))
    for y in range(high):
        normals(state, line)
        v = y - 0.5 * high
        for x in range(wide):
            u = x - 0.5 * wide
            light = 1.0 - corner * (u * u + v * v) * far
            for c in range(3):
                value = image[y, x, c] * gain[c] * light
                value += line[3 * x + c] * np.sqrt(read * read + shot * max(value, 0.0))
                rgb[y, x, c] = np.uint8(min(max(np.rint(value), 0.0), 255.0))
    return rgb
