"""From drawn faces to colours, depth and identities, as machine code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled
from .instances import Instances
from .noise import normals
from .raster import Layers, Light, View
from .shapes import Array


class Ground(NamedTuple):
    """Level ground that is painted instead of drawn, and what a cheap sensor makes of the picture.

    Attributes:
        colour: (3,) uint8, of lit ground.
        height_m: of the eye above it.
        fall: (3,) float32, how far a ray of depth one falls: at the corner, more a column, more a row.
        shade: of the columns before ``shaded`` (1 is none).
        shaded: columns that lie in the shade.
        noise: standard deviation of what is added to all three colours of a pixel, out of 255.
        state: (6,) uint64, of the generator behind it, see ``noise.stream``; moved on.
    """

    colour: NDArray[np.uint8]
    height_m: float
    fall: NDArray[np.float32]
    shade: float
    shaded: int
    noise: float
    state: NDArray[np.uint64]


@compiled
def _lit(base, light, shine, channel):  # type: ignore[no-untyped-def]
    """A colour channel under light, 0..255."""
    return min(255.0, base * (light.ambient + shine * light.colour[channel]))


@compiled
def _depths(inverse, far, depth):  # type: ignore[no-untyped-def]
    """Depths of a line (w,), ``far`` where nothing is: without a branch, eight pixels at a time."""
    one = np.float32(1.0)
    for x in range(len(depth)):
        near = one / inverse[x]
        depth[x] = near if inverse[x] > 0 else far


@compiled
def resolve(
    things: Instances,
    layers: Layers,
    light: Light,
    far_m: float,
    empty: NDArray[np.uint8],
    rgb: NDArray[np.uint8],
    depth: NDArray[np.float32],
    identity: NDArray[np.int32],
) -> None:
    """Colours (h, w, 3), depths (h, w), identities (h, w) of a drawn picture; ``empty`` (3,) is what nothing shows.

    Identities that nobody wants are an array of shape (0, 0).
    """
    inverse, slots, owner, shading = layers.inverse, layers.slot, layers.owner, layers.light
    height, width = inverse.shape
    told = identity.size > 0
    for y in range(height):
        _depths(inverse[y], np.float32(far_m), depth[y])
        last, flat, who = -2, False, -1
        red, green, blue = np.uint8(0), np.uint8(0), np.uint8(0)
        for x in range(width):
            slot = slots[y, x]
            if slot < 0:
                if told:
                    identity[y, x] = -1
                rgb[y, x, 0], rgb[y, x, 1], rgb[y, x, 2] = empty[0], empty[1], empty[2]
                continue
            if slot != last or not flat:
                i = owner[slot]
                shine = max(0.0, shading[slot, 0] + shading[slot, 1] * x + shading[slot, 2] * y) * light.diffuse
                red = np.uint8(_lit(things.colour[i, 0], light, shine, 0))
                green = np.uint8(_lit(things.colour[i, 1], light, shine, 1))
                blue = np.uint8(_lit(things.colour[i, 2], light, shine, 2))
                who, last = things.identity[i], slot
                flat = shading[slot, 1] == 0.0 and shading[slot, 2] == 0.0
            if told:
                identity[y, x] = who
            rgb[y, x, 0], rgb[y, x, 1], rgb[y, x, 2] = red, green, blue


@compiled
def resolve_ground(
    things: Instances,
    layers: Layers,
    light: Light,
    far_m: float,
    ground: Ground,
    rgb: NDArray[np.uint8],
    depth: NDArray[np.float32],
    identity: NDArray[np.int32],
) -> None:
    """``resolve`` with the ground painted wherever nothing stands above it, in the shade, with noise."""
    inverse, slots, owner, shading = layers.inverse, layers.slot, layers.owner, layers.light
    height, width = inverse.shape
    nothing, white, sigma = np.float32(0.0), np.float32(255.0), np.float32(ground.noise)
    told, far, level = identity.size > 0, np.float32(far_m), np.float32(ground.height_m)
    corner, across, down = ground.fall[0], ground.fall[1], ground.fall[2]
    line, bare = np.empty(width, np.float32), np.empty(width, np.bool_)
    soil, seen, noise = np.empty((3, 3 * width), np.float32)
    shade = np.ones(width, np.float32)
    shade[: max(ground.shaded, 0)] = np.float32(ground.shade)
    slope = np.empty(width, np.float32)
    for x in range(width):
        slope[x] = corner + across * np.float32(x)
        for c in range(3):
            soil[3 * x + c] = np.float32(ground.colour[c]) * shade[x]
    for y in range(height):
        normals(ground.state, line)
        # Loops without a branch, eight pixels at a time.
        _depths(inverse[y], far, depth[y])
        begin, covered = down * np.float32(y), 0
        for x in range(width):
            bare[x] = depth[y, x] * (slope[x] + begin) >= level
        for x in range(width):
            covered += not bare[x]
        for k in range(3 * width):
            seen[k] = soil[k]
        if told:
            for x in range(width):
                identity[y, x] = -1
        last, flat, who = -2, False, -1
        red, green, blue = nothing, nothing, nothing
        if covered:
            for x in range(width):
                if bare[x]:
                    continue
                slot = slots[y, x]
                if slot < 0:
                    red, green, blue, who, last = white, white, white, -1, -2
                elif slot != last or not flat:
                    i = owner[slot]
                    shine = max(0.0, shading[slot, 0] + shading[slot, 1] * x + shading[slot, 2] * y) * light.diffuse
                    red = np.float32(np.uint8(_lit(things.colour[i, 0], light, shine, 0)))
                    green = np.float32(np.uint8(_lit(things.colour[i, 1], light, shine, 1)))
                    blue = np.float32(np.uint8(_lit(things.colour[i, 2], light, shine, 2)))
                    who, last = things.identity[i], slot
                    flat = shading[slot, 1] == 0.0 and shading[slot, 2] == 0.0
                if told:
                    identity[y, x] = who
                seen[3 * x], seen[3 * x + 1], seen[3 * x + 2] = red * shade[x], green * shade[x], blue * shade[x]
        for x in range(width):
            value = line[x] * sigma
            noise[3 * x], noise[3 * x + 1], noise[3 * x + 2] = value, value, value
        shown = rgb[y].reshape(3 * width)
        for k in range(3 * width):
            shown[k] = np.uint8(np.int32(min(max(np.rint(seen[k] + noise[k]), nothing), white)))


@compiled
def resolve_picture(
    things: Instances,
    layers: Layers,
    light: Light,
    view: View,
    sun: View,
    sunlit: NDArray[np.float32],
    dark: float,
    sky: Array,
    rgb: NDArray[np.uint8],
) -> None:
    """A picture (h, w, 3) for people from layers of twice its size each way.

    A pixel whose four samples show one face is lit once, the others four times. What the sun does not reach keeps the
    share ``dark`` of its light; the edge of a shadow is blended over a texel of the map.

    Args:
        things: what was drawn.
        layers: drawn.
        light: the light.
        view: the camera of the layers.
        sun: the camera of the shadow map.
        sunlit: (s, s), the map: how far before ``sun.far_m`` the nearest face lies.
        dark: see above.
        sky: (h, 3), colour of what nothing shows.
        rgb: (h, w, 3), the picture.
    """
    inverse, slots, owner, shading = layers.inverse, layers.slot, layers.owner, layers.light
    height, width = inverse.shape[0] // 2, inverse.shape[1] // 2
    size, texel = sunlit.shape[0] - 1.0, 1.0 / sun.focal
    # From before the camera to before the sun.
    m, o = np.empty((3, 3)), np.empty(3)
    for r in range(3):
        for c in range(3):
            m[r, c] = (
                sun.turn[r, 0] * view.turn[c, 0] + sun.turn[r, 1] * view.turn[c, 1] + sun.turn[r, 2] * view.turn[c, 2]
            )
        o[r] = sun.shift[r] - (m[r, 0] * view.shift[0] + m[r, 1] * view.shift[1] + m[r, 2] * view.shift[2])
    per_focal = 1.0 / view.focal
    for y in range(height):
        for x in range(width):
            slot = slots[2 * y, 2 * x]
            alike = slot == slots[2 * y, 2 * x + 1] == slots[2 * y + 1, 2 * x] == slots[2 * y + 1, 2 * x + 1]
            red, green, blue = 0.0, 0.0, 0.0
            samples = 1 if alike else 4
            for sample in range(samples):
                row, column = 2 * y + (sample >> 1), 2 * x + (sample & 1)
                slot = slots[row, column]
                if slot < 0:
                    red, green, blue = red + sky[y, 0], green + sky[y, 1], blue + sky[y, 2]
                    continue
                u, v, near = float(column), float(row), float(inverse[row, column])
                if alike:
                    u, v, near = u + 0.5, v + 0.5, 0.5 * (near + inverse[row + 1, column + 1])
                shine, cosine = 0.0, shading[slot, 3]
                if cosine > 0.0:
                    shine = max(0.0, shading[slot, 0] + shading[slot, 1] * u + shading[slot, 2] * v) * light.diffuse
                    z = 1.0 / near
                    px, py = (u - view.centre_x) * per_focal * z, (v - view.centre_y) * per_focal * z
                    s = (m[0, 0] * px + m[0, 1] * py + m[0, 2] * z + o[0]) * sun.focal + sun.centre_x
                    t = (m[1, 0] * px + m[1, 1] * py + m[1, 2] * z + o[1]) * sun.focal + sun.centre_y
                    if 0.0 <= s < size and 0.0 <= t < size:
                        i, j = int(s), int(t)
                        # A face shades nobody that is as near to the sun as itself, give or take a texel on its slope.
                        reach = sun.far_m - (m[2, 0] * px + m[2, 1] * py + m[2, 2] * z + o[2])
                        reach += texel * (1.0 + 1.5 / max(cosine, 0.2))
                        a, b = sunlit[j, i] > reach, sunlit[j, i + 1] > reach
                        c, d = sunlit[j + 1, i] > reach, sunlit[j + 1, i + 1] > reach
                        if a or b or c or d:
                            s, t = s - i, t - j
                            hidden = (a * (1.0 - s) + b * s) * (1.0 - t) + (c * (1.0 - s) + d * s) * t
                            shine *= 1.0 - (1.0 - dark) * hidden
                k = owner[slot]
                red += _lit(things.colour[k, 0], light, shine, 0)
                green += _lit(things.colour[k, 1], light, shine, 1)
                blue += _lit(things.colour[k, 2], light, shine, 2)
            share = 1.0 / samples
            rgb[y, x, 0], rgb[y, x, 1], rgb[y, x, 2] = (
                np.uint8(red * share),
                np.uint8(green * share),
                np.uint8(blue * share),
            )
