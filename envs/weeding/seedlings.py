"""Meshes of weeds and crop plants, by species and stage; sizes are assumed."""

from __future__ import annotations

import numpy as np

from ...rendering.shapes import Mesh, flat_shaded, merged, rotation_z, turned
from .config import LEAF_M


def blade(
    length_m: float, width_m: float, rise_m: float, droop_m: float, pieces: int = 5, *, grass: bool = False
) -> Mesh:
    """Leaf along +x from the origin on an arched vein, seen from above.

    Broadleaves have an ellipse-like outline; a ``grass`` is widest at its sheath and tapers to a point.
    """
    along = np.linspace(0.0, 1.0, pieces + 1)
    outline = 1.0 - along**2.5 if grass else np.sin(np.pi * np.clip(along, 0.04, 0.97)) ** 0.7
    half = 0.5 * width_m * np.maximum(outline, 0.05)
    x = length_m * along
    z = rise_m * along - (rise_m + droop_m) * along**2 + 0.001
    left = np.stack([x, half, z + 0.15 * half], -1)
    right = np.stack([x, -half, z + 0.15 * half], -1)
    i, n = np.arange(pieces), pieces + 1
    faces = np.concatenate([np.stack([i, n + i, n + i + 1], -1), np.stack([i, n + i + 1, i + 1], -1)])
    vertices = np.concatenate([left, right])
    mesh = flat_shaded(vertices, faces)
    if mesh.normals[:, 2].mean() < 0.0:
        mesh = flat_shaded(vertices, faces[:, ::-1])
    return mesh


def rosette(leaf: Mesh, count: int, turn_rad: float, start_rad: float = 0.0, height_m: float = 0.004) -> Mesh:
    """``count`` leaves about a stem, ``turn_rad`` apart."""
    return merged(*(turned(leaf, rotation_z(start_rad + k * turn_rad), (0.0, 0.0, height_m)) for k in range(count)))


def weed_mesh(species: int, stage: int) -> Mesh:
    """Seedling of a species and stage; sizes are assumed."""
    half = np.pi
    if species == 0:
        cotyledons = rosette(blade(0.009, 0.005, 0.004, 0.000), 2, half)
        if stage == 0:
            return cotyledons
        if stage == 1:
            return merged(cotyledons, rosette(blade(0.017, 0.009, 0.008, 0.000), 2, half, 0.5 * half, 0.008))
        big = blade(0.028, 0.014, 0.012, 0.002)
        return merged(cotyledons, rosette(big, 4, 0.5 * half, 0.4, 0.010))
    if stage == 0:
        return rosette(blade(0.024, 0.0024, 0.020, 0.002, grass=True), 1, half)
    if stage == 1:
        return rosette(blade(0.038, 0.0032, 0.028, 0.004, grass=True), 2, 0.85 * half)
    return rosette(blade(0.060, 0.0042, 0.040, 0.010, grass=True), 4, 0.55 * half)


def crop_mesh(kind: str) -> Mesh:
    """Crop plant: a beet's rosette or a young maize."""
    if kind == "beet":
        return rosette(blade(LEAF_M[kind], 0.030, 0.030, 0.005, 6), 6, 2.399, 0.0, 0.008)
    return rosette(blade(LEAF_M[kind], 0.016, 0.080, 0.010, 6), 4, 0.9 * np.pi, 0.0, 0.012)
