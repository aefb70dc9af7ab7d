"""Sensor noise: NumPy's own normal numbers, bit by bit, three times as fast.

``numpy.random.Generator(PCG64(seed)).standard_normal(dtype=float32)`` as machine code: PCG64 (O'Neill 2014,
HMC-CS-2014-0905), whose 64-bit words are used half by half, the lower half first, and the ziggurat with 256 layers
(Marsaglia and Tsang 2000, J. Stat. Soft. 5(8)).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled
from ..kernels.wide import product

_LAYERS, _EDGE, _AREA, _SCALE = 256, 3.6541528853610088, 0.00492867323399, 2.0**23
"""Layers of the ziggurat, where its tail begins, the area of a layer, and what a 23-bit number is divided by."""
_U64, _HALF, _LOW = np.uint64, np.uint64(32), np.uint64(0xFFFFFFFF)
_FACTOR_HIGH, _FACTOR_LOW = np.uint64(2549297995355413924), np.uint64(4865540595714422341)


def _ziggurat() -> tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32]]:
    """Widths of the layers per step, the steps that lie wholly within a layer, and the density at their edges."""
    edge = np.empty(_LAYERS)
    edge[0], edge[255] = _AREA / math.exp(-0.5 * _EDGE**2), _EDGE
    for i in range(254, 0, -1):
        outer = float(edge[i + 1])
        edge[i] = math.sqrt(-2.0 * math.log(_AREA / outer + math.exp(-0.5 * outer**2)))
    inner = [_EDGE / edge[0], 0.0, *(edge[1:255] / edge[2:])]
    density = [1.0, *(math.exp(-0.5 * x * x) for x in edge[1:].tolist())]
    return (
        (edge / _SCALE).astype(np.float32),
        (np.array(inner) * _SCALE).round().astype(np.uint32),
        np.array(density, np.float32),
    )


_WIDTH, _WHOLE, _DENSITY = _ziggurat()
_EDGE_F, _PER_EDGE_F = np.float32(_EDGE), np.float32(1.0 / _EDGE)
_UNIT = np.float32(1.0 / 2**24)


def stream(seed: int | Sequence[int]) -> NDArray[np.uint64]:
    """The state (6,) of a fresh ``numpy.random.default_rng(seed)``; ``normals`` moves it on."""
    inner: dict[str, int] = np.random.PCG64(seed).state["state"]  # type: ignore[assignment]
    low = (1 << 64) - 1
    words = [inner["state"] >> 64, inner["state"] & low, inner["inc"] >> 64, inner["inc"] & low, 0, 0]
    return np.array(words, np.uint64)


@compiled
def _word(high, low, add_high, add_low, kept, left):  # type: ignore[no-untyped-def]
    """The next 32 random bits, the generator's state behind them, and what is left of its last word."""
    if left:
        return kept, high, low, kept, False
    # 128-bit state times factor, plus increment.
    above, below = product(low, _FACTOR_LOW)
    above += high * _FACTOR_LOW + low * _FACTOR_HIGH
    low = below + add_low
    high = above + add_high + (_U64(1) if low < below else _U64(0))
    folded, turn = high ^ low, high >> _U64(58)
    value = (folded >> turn) | (folded << ((_U64(64) - turn) & _U64(63)))
    return value & _LOW, high, low, value >> _HALF, True


@compiled
def normals(state: NDArray[np.uint64], out: NDArray[np.float32]) -> None:
    """Fill ``out`` (n,) with standard normal numbers, as the generator of ``state`` would give them next."""
    high, low, add_high, add_low = state[0], state[1], state[2], state[3]
    kept, left = state[5], state[4] != _U64(0)
    for i in range(len(out)):
        while True:
            bits, high, low, kept, left = _word(high, low, add_high, add_low, kept, left)
            layer, steps = np.int64(bits & _U64(255)), (bits >> _U64(9)) & _U64(0x7FFFFF)
            x = np.float32(np.int64(steps)) * _WIDTH[layer]
            if bits & _U64(256):
                x = -x
            if steps < _WHOLE[layer]:
                break
            bits, high, low, kept, left = _word(high, low, add_high, add_low, kept, left)
            chance = np.float32(np.int64(bits >> _U64(8))) * _UNIT
            if layer > 0:
                between = (_DENSITY[layer - 1] - _DENSITY[layer]) * chance + _DENSITY[layer]
                if between < math.exp(-0.5 * np.float64(x) * np.float64(x)):
                    break
                continue
            # The tail, one in some thousands.
            while True:
                beyond = -_PER_EDGE_F * np.float32(math.log1p(-chance))
                bits, high, low, kept, left = _word(high, low, add_high, add_low, kept, left)
                height = -np.float32(math.log1p(-np.float32(np.int64(bits >> _U64(8))) * _UNIT))
                if height + height > beyond * beyond:
                    break
                bits, high, low, kept, left = _word(high, low, add_high, add_low, kept, left)
                chance = np.float32(np.int64(bits >> _U64(8))) * _UNIT
            x = _EDGE_F + beyond
            if (steps >> _U64(8)) & _U64(1):
                x = -x
            break
        out[i] = x
    state[0], state[1], state[4], state[5] = high, low, _U64(1) if left else _U64(0), kept


@compiled
def add_noise(
    state: NDArray[np.uint64],
    rgb: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
    gain_sigma: float,
    colour_sigma: float,
    depth_sigma_m: float,
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """What a cheap camera makes of colours (h, w, 3) and depths (h, w): channels' gains drift, every value is noisy.

    Args:
        state: see ``stream``; moved on.
        rgb: the picture.
        depth_m: along the view.
        gain_sigma: of each channel's gain about 1.
        colour_sigma: of a colour value, out of 255.
        depth_sigma_m: of a depth.
    """
    height, width, _ = rgb.shape
    one, top, none = np.float32(1.0), np.float32(255.0), np.float32(0.0)
    gain, colour, far = np.float32(gain_sigma), np.float32(colour_sigma), np.float32(depth_sigma_m)
    gains, line = np.empty(3, np.float32), np.empty(3 * width, np.float32)
    seen, depth = np.empty((height, width, 3), np.uint8), np.empty((height, width), np.float32)
    normals(state, gains)
    for c in range(3):
        gains[c] = one + gain * gains[c]
    for y in range(height):
        normals(state, line)
        for x in range(width):
            for c in range(3):
                value = np.rint(np.float32(rgb[y, x, c]) * gains[c] + colour * line[3 * x + c])
                seen[y, x, c] = np.uint8(min(max(value, none), top))
    row = line[:width]
    for y in range(height):
        normals(state, row)
        for x in range(width):
            depth[y, x] = depth_m[y, x] + far * row[x]
    return seen, depth
