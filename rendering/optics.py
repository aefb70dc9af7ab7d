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
    reach = len(across) // 2
    flat, out = np.empty((high, 3 * wide), np.float32), np.zeros((high, 3 * wide), np.float32)
    for y in range(high):
        line, shown = image[y].reshape(3 * wide), flat[y]
        for k in range(3 * wide):
            shown[k] = np.float32(0.0)
        for i in range(len(across)):
            weight, by = across[i], 3 * (i - reach)
            low, end = max(-by, 0), 3 * wide - max(by, 0)
            for k in range(low, end):
                shown[k] += weight * line[k + by]
            for k in range(low):
                shown[k] += weight * line[k % 3]
            for k in range(end, 3 * wide):
                shown[k] += weight * line[3 * wide - 3 + k % 3]
    for y in range(high):
        shown = out[y]
        for i in range(len(down)):
            weight, line = down[i], flat[min(max(y + i - reach, 0), high - 1)]
            for k in range(3 * wide):
                shown[k] += weight * line[k]
    return out.reshape(high, wide, 3)


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
