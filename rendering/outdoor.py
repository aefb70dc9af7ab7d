"""Pictures of the ground outdoors: soil with relief and moisture, sun and sky, shadows of plants, an edge of shade.

What stands in the scene is drawn at twice the size each way; a pixel is the mean of its four samples. Ground is not
drawn but worked out where nothing stands above the plane z = 0, from a tile of noise that repeats every metre.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled
from .instances import Instances
from .optics import Optics
from .raster import Layers, Light, View
from .shapes import Array

TILE = 1024
"""Places of the tile each way, a millimetre apart."""
_OCTAVES = (8, 16, 32, 64, 128, 256, 512)
"""Cells of the lattices that the tile is made of."""
_FINE, _COARSE = 2.7, 1.0 / 9.0
"""The tile is laid over itself, finer and coarser by these."""


class Soil(NamedTuple):
    """Bare ground.

    Attributes:
        colour: (3,), red, green, blue in 0..255 of dry, level ground in full light.
        grain: share by which its colour varies over millimetres.
        patch: share by which it is darker where it is moist.
        relief: how much its little slopes catch or lose of the sun.
        turn: (2,), cosine and sine of how the tile lies.
        shift: (2,), metres.
    """

    colour: Array
    grain: float
    patch: float
    relief: float
    turn: Array
    shift: Array


class Shade(NamedTuple):
    """What stands between the sun and a half of the ground, a machine or a tree.

    Attributes:
        normal: (2,), unit, from the edge into the shade.
        edge_m: of the edge along it.
        soft_m: over which the edge fades.
        sun: share of the sun's light that is left in it.
    """

    normal: Array
    edge_m: float
    soft_m: float
    sun: float


class Outdoors(NamedTuple):
    """A picture's ground, light and camera.

    Attributes:
        light: sun and sky.
        dark: share of the sun's light that a plant's shadow leaves.
        soil: bare ground.
        shade: an edge of shade; ``sun`` 1 where there is none.
        optics: of the camera.
        seed: of the sensor's noise.
    """

    light: Light
    dark: float
    soil: Soil
    shade: Shade
    optics: Optics
    seed: int


@lru_cache(maxsize=1)
def tile() -> NDArray[np.float32]:
    """Heights (``TILE``, ``TILE``) of clods and grains, mean 0, deviation 1; the same whoever asks."""
    rng = np.random.default_rng(20)
    heights = np.zeros((TILE, TILE), np.float32)
    for cells in _OCTAVES:
        ridged = 32 <= cells <= 128
        _add_lattice(heights, rng.random((cells, cells)).astype(np.float32), (8.0 / cells) ** 0.45, ridged)
    mean, spread = float(heights.mean(dtype=np.float64)), float(heights.std(dtype=np.float64))
    return ((heights - np.float32(mean)) / np.float32(spread)).astype(np.float32)


@compiled
def _add_lattice(heights: NDArray[np.float32], lattice: NDArray[np.float32], scale: float, ridged: bool) -> None:
    """Add a lattice (n, n), smooth between its points and around the edges; ``ridged`` ones make clods with gaps."""
    size, cells = len(heights), len(lattice)
    step, three, two, one = np.float32(cells / size), np.float32(3.0), np.float32(2.0), np.float32(1.0)
    for y in range(size):
        v = np.float32(y) * step
        j = int(v)
        b = v - np.float32(j)
        b = b * b * (three - two * b)
        above, below = lattice[j % cells], lattice[(j + 1) % cells]
        for x in range(size):
            u = np.float32(x) * step
            i = int(u)
            a = u - np.float32(i)
            a = a * a * (three - two * a)
            right = (i + 1) % cells
            value = (above[i] * (one - a) + above[right] * a) * (one - b) + (
                below[i] * (one - a) + below[right] * a
            ) * b
            if ridged:
                value = one - abs(two * value - one)
            heights[y, x] += np.float32(scale) * value


@compiled
def height(heights: NDArray[np.float32], x_m: float, y_m: float, finer: float) -> float:
    """The tile's height at a place, linear between its places."""
    u, v = x_m * 1000.0 * finer, y_m * 1000.0 * finer
    i, j = int(np.floor(u)), int(np.floor(v))
    a, b = u - i, v - j
    # A power of two: the tile goes on around its edges.
    i, j = i & (TILE - 1), j & (TILE - 1)
    right, below = (i + 1) & (TILE - 1), (j + 1) & (TILE - 1)
    above_line, below_line = heights[j], heights[below]
    return (above_line[i] * (1.0 - a) + above_line[right] * a) * (1.0 - b) + (
        below_line[i] * (1.0 - a) + below_line[right] * a
    ) * b


@compiled
def sun_share(
    sun: View, sunlit: NDArray[np.float32], x: float, y: float, z: float, slack_m: float, left: float
) -> float:
    """Share of the sun's light that reaches a point: ``left`` where something stands before it, blended at edges."""
    size = len(sunlit) - 1.0
    s = (sun.turn[0, 0] * x + sun.turn[0, 1] * y + sun.turn[0, 2] * z + sun.shift[0]) * sun.focal + sun.centre_x
    t = (sun.turn[1, 0] * x + sun.turn[1, 1] * y + sun.turn[1, 2] * z + sun.shift[1]) * sun.focal + sun.centre_y
    if not (0.0 <= s < size and 0.0 <= t < size):
        return 1.0
    reach = sun.far_m - (sun.turn[2, 0] * x + sun.turn[2, 1] * y + sun.turn[2, 2] * z + sun.shift[2]) + slack_m
    i, j = int(s), int(t)
    a, b = sunlit[j, i] > reach, sunlit[j, i + 1] > reach
    c, d = sunlit[j + 1, i] > reach, sunlit[j + 1, i + 1] > reach
    s, t = s - i, t - j
    hidden = (a * (1.0 - s) + b * s) * (1.0 - t) + (c * (1.0 - s) + d * s) * t
    return 1.0 - (1.0 - left) * hidden


@compiled
def shade_share(shade: Shade, x: float, y: float) -> float:
    """Share of the sun's light that the edge of a shade lets through to a place."""
    inside = (shade.normal[0] * x + shade.normal[1] * y - shade.edge_m) / shade.soft_m
    return 1.0 - (1.0 - shade.sun) * min(max(inside + 0.5, 0.0), 1.0)


@compiled
def resolve_outdoor(
    things: Instances,
    layers: Layers,
    view: View,
    light: Light,
    sun: View,
    sunlit: NDArray[np.float32],
    dark: float,
    soil: Soil,
    shade: Shade,
    heights: NDArray[np.float32],
    image: NDArray[np.float32],
    depth: NDArray[np.float32],
    identity: NDArray[np.int32],
) -> None:
    """Colours (h, w, 3), not cut off above, of a picture drawn at twice its size; depth and identity of a sample each.

    Args:
        things: what was drawn.
        layers: drawn, (2 h, 2 w).
        view: their camera.
        light: sun and sky; its ``diffuse`` is what shadows take away.
        sun: camera of the map of what the sun reaches.
        sunlit: the map, see ``resolve_picture``.
        dark: share of the sun's light that a plant's shadow leaves.
        soil: the ground.
        shade: an edge of shade.
        heights: see ``tile``.
        image: is written.
        depth: is written, (h, w).
        identity: is written, (h, w); of no size where nobody wants it.
    """
    inverse, slots, owner, shading = layers.inverse, layers.slot, layers.owner, layers.light
    high, wide = depth.shape
    told, per_focal, texel = identity.size > 0, 1.0 / view.focal, 1.0 / sun.focal
    turn, shift, towards = view.turn, view.shift, light.towards
    ex = -(turn[0, 0] * shift[0] + turn[1, 0] * shift[1] + turn[2, 0] * shift[2])
    ey = -(turn[0, 1] * shift[0] + turn[1, 1] * shift[1] + turn[2, 1] * shift[2])
    ez = -(turn[0, 2] * shift[0] + turn[1, 2] * shift[1] + turn[2, 2] * shift[2])
    flat = np.sqrt(towards[0] * towards[0] + towards[1] * towards[1])
    step_x, step_y = 0.0015 * towards[0] / max(flat, 1e-9), 0.0015 * towards[1] / max(flat, 1e-9)
    slope = soil.relief * flat / max(towards[2], 0.2)
    level = light.diffuse * towards[2]
    for y in range(high):
        for x in range(wide):
            px, py = (2.0 * x + 0.5 - view.centre_x) * per_focal, (2.0 * y + 0.5 - view.centre_y) * per_focal
            dx = turn[0, 0] * px + turn[1, 0] * py + turn[2, 0]
            dy = turn[0, 1] * px + turn[1, 1] * py + turn[2, 1]
            dz = turn[0, 2] * px + turn[1, 2] * py + turn[2, 2]
            ground_z = -ez / dz
            gx, gy = ex + ground_z * dx, ey + ground_z * dy
            shaded = shade_share(shade, gx, gy)
            known, red, green, blue = False, 0.0, 0.0, 0.0
            soil_red, soil_green, soil_blue = 0.0, 0.0, 0.0
            who, near = -1, ground_z
            last, plant_red, plant_green, plant_blue = -1, 0.0, 0.0, 0.0
            for sample in range(4):
                row, column = 2 * y + (sample >> 1), 2 * x + (sample & 1)
                q, slot = inverse[row, column], slots[row, column]
                covered = q > 0.0 and slot >= 0 and ez + dz / q > 0.0
                if covered:
                    k = owner[slot]
                    who, near = things.identity[k], 1.0 / q
                    if slot != last:
                        last = slot
                        shine = max(0.0, shading[slot, 0] + shading[slot, 1] * column + shading[slot, 2] * row)
                        shine *= light.diffuse
                        cosine = shading[slot, 3]
                        if cosine > 0.0:
                            slack = texel * (1.0 + 1.5 / max(cosine, 0.2))
                            z = 1.0 / q
                            shine *= shaded * sun_share(sun, sunlit, ex + z * dx, ey + z * dy, ez + z * dz, slack, dark)
                        plant_red = things.colour[k, 0] * (light.ambient + shine * light.colour[0])
                        plant_green = things.colour[k, 1] * (light.ambient + shine * light.colour[1])
                        plant_blue = things.colour[k, 2] * (light.ambient + shine * light.colour[2])
                    red, green, blue = red + plant_red, green + plant_green, blue + plant_blue
                    continue
                if not known:
                    known = True
                    tx = soil.turn[0] * gx - soil.turn[1] * gy + soil.shift[0]
                    ty = soil.turn[1] * gx + soil.turn[0] * gy + soil.shift[1]
                    sx = soil.turn[0] * step_x - soil.turn[1] * step_y
                    sy = soil.turn[1] * step_x + soil.turn[0] * step_y
                    here = height(heights, tx, ty, 1.0)
                    fine = height(heights, tx, ty, _FINE)
                    moist = min(max(0.5 + 0.5 * height(heights, tx, ty, _COARSE), 0.0), 1.0)
                    lit = max(1.0 - slope * (height(heights, tx + sx, ty + sy, 1.0) - here), 0.0)
                    share = shaded * sun_share(sun, sunlit, gx, gy, 0.0, 2.0 * texel, dark)
                    tone = max(1.0 + soil.grain * (0.6 * here + 0.4 * fine), 0.1) * (1.0 - soil.patch * moist)
                    soil_red = soil.colour[0] * tone * (light.ambient + level * lit * share * light.colour[0])
                    soil_green = soil.colour[1] * tone * (light.ambient + level * lit * share * light.colour[1])
                    soil_blue = soil.colour[2] * tone * (light.ambient + level * lit * share * light.colour[2])
                red, green, blue = red + soil_red, green + soil_green, blue + soil_blue
            image[y, x, 0], image[y, x, 1], image[y, x, 2] = 0.25 * red, 0.25 * green, 0.25 * blue
            depth[y, x] = near
            if told:
                identity[y, x] = who
