"""The rasteriser: instances of meshes into a buffer of inverse depth and of what is nearest, as machine code.

A picture's sample lies at a pixel's whole coordinates. Faces are filled line by line between their edges, each edge
worked out from its upper corner alone, so that neighbours leave no gap; on a tie the face that came first stays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled
from .instances import Instances
from .library import Meshes
from .shapes import Array


class View(NamedTuple):
    """A camera where it stands: x to the right, y down, z ahead.

    Attributes:
        turn: (3, 3), world to camera.
        shift: (3,), added behind it.
        focal: pixels; pixels a metre without perspective.
        centre_x: pixels.
        centre_y: pixels.
        near_m: what is nearer is cut away.
        far_m: balls about a mesh that are farther are left out.
        parallel: whether there is no perspective; "inverse depth" then is the distance before ``far_m``.
    """

    turn: Array
    shift: Array
    focal: float
    centre_x: float
    centre_y: float
    near_m: float
    far_m: float
    parallel: bool


class Light(NamedTuple):
    """Light from far away, as PyBullet's software renderer has it.

    Attributes:
        towards: (3,), unit, to the light.
        ambient: share of its colour that every face shows.
        diffuse: share that a face towards the light adds.
        specular: share of the highlight, seen from straight above.
        colour: (3,), of what is added.
    """

    towards: Array
    ambient: float
    diffuse: float
    specular: float
    colour: Array


class Layers(NamedTuple):
    """What is drawn into.

    Attributes:
        inverse: (h, w) float32, inverse depth; 0 where nothing is.
        slot: (h, w) int32, the drawn face; -1 where nothing is.
        owner: (s,) int32, a drawn face's instance.
        light: (s, 4), light on a drawn face at pixel (0, 0), its slopes in x and y, and the cosine to the light.
        point: (v, 6), a mesh's vertices in the picture (x, y, inverse depth) and before the camera (x, y, z).
        shine: (v,), light at a mesh's vertices.
    """

    inverse: NDArray[np.float32]
    slot: NDArray[np.int32]
    owner: NDArray[np.int32]
    light: Array
    point: Array
    shine: Array


@compiled
def _fill(inverse, slots, x0, y0, q0, x1, y1, q1, x2, y2, q2, doubled, slot):  # type: ignore[no-untyped-def]
    """Write a triangle where it is nearest; whether it has a line of samples."""
    height, width = inverse.shape
    first = int(max(0.0, np.ceil(min(y0, y1, y2))))
    last = int(min(height - 1.0, np.floor(max(y0, y1, y2))))
    across = ((q1 - q0) * (y2 - y0) - (q2 - q0) * (y1 - y0)) / doubled
    down = ((q2 - q0) * (x1 - x0) - (q1 - q0) * (x2 - x0)) / doubled
    ax, ay, bx, by, cx, cy = x0, y0, x1, y1, x2, y2
    if ay > by:
        ax, ay, bx, by = bx, by, ax, ay
    if by > cy:
        bx, by, cx, cy = cx, cy, bx, by
    if ay > by:
        ax, ay, bx, by = bx, by, ax, ay
    long_slope = (cx - ax) / (cy - ay) if cy > ay else 0.0
    upper_slope = (bx - ax) / (by - ay) if by > ay else 0.0
    lower_slope = (cx - bx) / (cy - by) if cy > by else 0.0
    step = np.float32(across)
    found = False
    for y in range(first, last + 1):
        left = ax + (y - ay) * long_slope
        right = ax + (y - ay) * upper_slope if y < by else bx + (y - by) * lower_slope
        if left > right:
            left, right = right, left
        if right < 0.0 or left > width - 1:
            continue
        begin, end = int(np.ceil(max(left, 0.0))), int(np.floor(min(right, width - 1.0)))
        if begin > end:
            continue
        start = np.float32(q0 + (begin - x0) * across + (y - y0) * down)
        line, owners = inverse[y], slots[y]
        for x in range(begin, end + 1):
            value = start + step * np.float32(x - begin)
            if value > line[x]:
                line[x] = value
                owners[x] = slot
        found = True
    return found


@compiled
def _shine(nx, ny, nz, towards, diffuse, specular):  # type: ignore[no-untyped-def]
    """Light on a surface with a normal, in parts of ``diffuse``."""
    cosine = nx * towards[0] + ny * towards[1] + nz * towards[2]
    mirrored = max(0.0, 2.0 * cosine * nz - towards[2])
    return max(0.0, cosine) + specular * mirrored * mirrored / diffuse


@compiled
def draw(
    meshes: Meshes, things: Instances, first: int, last: int, view: View, light: Light, layers: Layers, lit: bool
) -> int:
    """Draw the instances ``first`` to ``last``; gives the number of slots used.

    Args:
        meshes: of the library.
        things: instances.
        first: of the instances to draw.
        last: behind them.
        view: the camera.
        light: the light; only for ``lit`` drawings.
        layers: cleared layers, with room for all faces and for the vertices of the largest mesh.
        lit: make slots; else only the inverse depth is of use.
    """
    inverse, slots, owner, shading = layers.inverse, layers.slot, layers.owner, layers.light
    point, shine = layers.point, layers.shine
    height, width = inverse.shape
    focal, centre_x, centre_y, near, far = view.focal, view.centre_x, view.centre_y, view.near_m, view.far_m
    parallel, turn, shift = view.parallel, view.turn, view.shift
    towards, diffuse, specular = light.towards, light.diffuse, light.specular
    right, low = max(centre_x, width - centre_x) / focal, max(centre_y, height - centre_y) / focal
    right_slant, low_slant = np.sqrt(1.0 + right * right), np.sqrt(1.0 + low * low)
    m, cof = np.empty((3, 3)), np.empty((3, 3))
    o = np.empty(3)
    clip, pict = np.empty((4, 4)), np.empty((4, 3))
    slot = 0
    for i in range(first, last):
        kind, a = things.mesh[i], things.turn[i]
        at = things.shift[i]
        for r in range(3):
            for c in range(3):
                m[r, c] = turn[r, 0] * a[0, c] + turn[r, 1] * a[1, c] + turn[r, 2] * a[2, c]
            o[r] = turn[r, 0] * at[0] + turn[r, 1] * at[1] + turn[r, 2] * at[2] + shift[r]
        # The ball about the mesh, against the view's sides.
        size = 0.0
        for c in range(3):
            size = max(size, a[0, c] * a[0, c] + a[1, c] * a[1, c] + a[2, c] * a[2, c])
        scaled = abs(size - 1.0) > 1e-6
        for c in range(3):
            square = a[0, c] * a[0, c] + a[1, c] * a[1, c] + a[2, c] * a[2, c]
            scaled = scaled or abs(square - 1.0) > 1e-6
        radius = meshes.radius[kind] * np.sqrt(size)
        mx, my, mz = meshes.centre[kind, 0], meshes.centre[kind, 1], meshes.centre[kind, 2]
        x = m[0, 0] * mx + m[0, 1] * my + m[0, 2] * mz + o[0]
        y = m[1, 0] * mx + m[1, 1] * my + m[1, 2] * mz + o[1]
        z = m[2, 0] * mx + m[2, 1] * my + m[2, 2] * mz + o[2]
        if parallel:
            if abs(x) > right + radius or abs(y) > low + radius:
                continue
        elif (
            z + radius < near
            or z - radius > far
            or abs(x) - z * right > radius * right_slant
            or abs(y) - z * low > radius * low_slant
        ):
            continue
        # Normals turn with the cofactors; they are the rotation itself where there is no scale.
        for r in range(3):
            r1, r2 = (r + 1) % 3, (r + 2) % 3
            for c in range(3):
                c1, c2 = (c + 1) % 3, (c + 2) % 3
                cof[r, c] = a[r1, c1] * a[r2, c2] - a[r1, c2] * a[r2, c1] if scaled else a[r, c]
        base = meshes.first_vertex[kind]
        smooth = lit and meshes.smooth[kind] != 0
        whole = True
        for k in range(meshes.first_vertex[kind + 1] - base):
            vx, vy, vz = meshes.vertex[base + k, 0], meshes.vertex[base + k, 1], meshes.vertex[base + k, 2]
            x = m[0, 0] * vx + m[0, 1] * vy + m[0, 2] * vz + o[0]
            y = m[1, 0] * vx + m[1, 1] * vy + m[1, 2] * vz + o[1]
            z = m[2, 0] * vx + m[2, 1] * vy + m[2, 2] * vz + o[2]
            point[k, 3], point[k, 4], point[k, 5] = x, y, z
            if parallel:
                point[k, 0], point[k, 1], point[k, 2] = x * focal + centre_x, y * focal + centre_y, far - z
            elif z >= near:
                q = 1.0 / z
                point[k, 0], point[k, 1], point[k, 2] = x * q * focal + centre_x, y * q * focal + centre_y, q
            else:
                whole = False
            if smooth:
                vx, vy, vz = meshes.normal[base + k, 0], meshes.normal[base + k, 1], meshes.normal[base + k, 2]
                nx = cof[0, 0] * vx + cof[0, 1] * vy + cof[0, 2] * vz
                ny = cof[1, 0] * vx + cof[1, 1] * vy + cof[1, 2] * vz
                nz = cof[2, 0] * vx + cof[2, 1] * vy + cof[2, 2] * vz
                if scaled:
                    length = np.sqrt(nx * nx + ny * ny + nz * nz)
                    nx, ny, nz = nx / length, ny / length, nz / length
                shine[k] = _shine(nx, ny, nz, towards, diffuse, specular)
        for f in range(meshes.first_face[kind], meshes.first_face[kind + 1]):
            p, q, r = meshes.face[f, 0], meshes.face[f, 1], meshes.face[f, 2]
            cut = not (parallel or whole) and (point[p, 5] < near or point[q, 5] < near or point[r, 5] < near)
            x0, y0, x1, y1, x2, y2 = point[p, 0], point[p, 1], point[q, 0], point[q, 1], point[r, 0], point[r, 1]
            doubled = 0.0
            if not cut:
                left, rightmost = min(x0, x1, x2), max(x0, x1, x2)
                top, bottom = min(y0, y1, y2), max(y0, y1, y2)
                if rightmost < 0.0 or left > width - 1 or bottom < 0.0 or top > height - 1:
                    continue
                doubled = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
                # In the picture y points down: faces that go round the other way show their front.
                if doubled == 0.0 or (doubled > 0.0 and meshes.two_sided[f] == 0):
                    continue
                if np.ceil(top) > np.floor(bottom) or np.ceil(left) > np.floor(rightmost):
                    continue
                front = doubled < 0.0
                found = _fill(
                    inverse, slots, x0, y0, point[p, 2], x1, y1, point[q, 2], x2, y2, point[r, 2], doubled, slot
                )
            else:
                if point[p, 5] < near and point[q, 5] < near and point[r, 5] < near:
                    continue
                ux, uy, uz = point[q, 3] - point[p, 3], point[q, 4] - point[p, 4], point[q, 5] - point[p, 5]
                wx, wy, wz = point[r, 3] - point[p, 3], point[r, 4] - point[p, 4], point[r, 5] - point[p, 5]
                nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
                front = nx * point[p, 3] + ny * point[p, 4] + nz * point[p, 5] < 0.0
                if not front and meshes.two_sided[f] == 0:
                    continue
                corners = 0
                for e in range(3):
                    one, other = meshes.face[f, e], meshes.face[f, (e + 1) % 3]
                    before, behind = point[one, 5] >= near, point[other, 5] >= near
                    if before:
                        clip[corners, 0], clip[corners, 1], clip[corners, 2] = (
                            point[one, 3],
                            point[one, 4],
                            point[one, 5],
                        )
                        corners += 1
                    if before != behind:
                        share = (near - point[one, 5]) / (point[other, 5] - point[one, 5])
                        clip[corners, 0] = point[one, 3] + share * (point[other, 3] - point[one, 3])
                        clip[corners, 1] = point[one, 4] + share * (point[other, 4] - point[one, 4])
                        clip[corners, 2] = near
                        corners += 1
                for e in range(corners):
                    pict[e, 2] = 1.0 / clip[e, 2]
                    pict[e, 0] = clip[e, 0] * pict[e, 2] * focal + centre_x
                    pict[e, 1] = clip[e, 1] * pict[e, 2] * focal + centre_y
                found = False
                for e in range(1, corners - 1):
                    ux, uy = pict[e, 0] - pict[0, 0], pict[e, 1] - pict[0, 1]
                    wx, wy = pict[e + 1, 0] - pict[0, 0], pict[e + 1, 1] - pict[0, 1]
                    area = ux * wy - wx * uy
                    if area != 0.0 and _fill(
                        inverse, slots, pict[0, 0], pict[0, 1], pict[0, 2], pict[e, 0], pict[e, 1], pict[e, 2],
                        pict[e + 1, 0], pict[e + 1, 1], pict[e + 1, 2], area, slot,
                    ):  # fmt: skip
                        found = True
            if not (found and lit):
                continue
            vx, vy, vz = meshes.face_normal[f, 0], meshes.face_normal[f, 1], meshes.face_normal[f, 2]
            nx = cof[0, 0] * vx + cof[0, 1] * vy + cof[0, 2] * vz
            ny = cof[1, 0] * vx + cof[1, 1] * vy + cof[1, 2] * vz
            nz = cof[2, 0] * vx + cof[2, 1] * vy + cof[2, 2] * vz
            if scaled:
                length = np.sqrt(nx * nx + ny * ny + nz * nz)
                nx, ny, nz = nx / length, ny / length, nz / length
            if not front:
                nx, ny, nz = -nx, -ny, -nz
            owner[slot] = i
            shading[slot, 3] = nx * towards[0] + ny * towards[1] + nz * towards[2]
            if smooth and not cut:
                s0, s1, s2 = shine[p], shine[q], shine[r]
                slope_x = ((s1 - s0) * (y2 - y0) - (s2 - s0) * (y1 - y0)) / doubled
                slope_y = ((s2 - s0) * (x1 - x0) - (s1 - s0) * (x2 - x0)) / doubled
                shading[slot, 0], shading[slot, 1] = s0 - slope_x * x0 - slope_y * y0, slope_x
                shading[slot, 2] = slope_y
            else:
                shading[slot, 0] = _shine(nx, ny, nz, towards, diffuse, specular)
                shading[slot, 1] = shading[slot, 2] = 0.0
            slot += 1
    return slot
