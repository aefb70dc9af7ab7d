"""Low-poly parts of plants by formula: leaves, whorls, tufts."""

from __future__ import annotations

import numpy as np

from .shapes import Mesh, flat_shaded, merged, rotation_z, surface_of_revolution, turned


def spiny_leaf(length_m: float, width_m: float, droop_m: float, spines: int = 4) -> Mesh:
    """Lance-shaped leaf along +x with a toothed edge, folded along its vein and drooping at its tip."""
    along = np.linspace(0.0, 1.0, 2 * spines + 1)
    half = 0.5 * width_m * np.sin(np.pi * np.clip(along, 0.02, 1.0)) ** 0.7
    half = half * np.where(np.arange(len(along)) % 2 == 1, 1.0, 0.68)
    x, z = length_m * along, 0.35 * length_m * along - (droop_m + 0.35 * length_m) * along**2
    vein = np.stack([x, np.zeros_like(x), z], axis=-1)
    left, right = vein + np.stack([0 * x, half, 0.4 * half], -1), vein + np.stack([0 * x, -half, 0.4 * half], -1)
    vertices = np.concatenate([vein, left, right])
    n = len(along)
    i = np.arange(n - 1)
    triangles = np.concatenate(
        [
            np.stack([i, i + 1, n + i + 1], -1),
            np.stack([i, n + i + 1, n + i], -1),
            np.stack([i, 2 * n + i + 1, i + 1], -1),
            np.stack([i, 2 * n + i, 2 * n + i + 1], -1),
        ]
    )
    return flat_shaded(vertices, triangles, two_sided=True)


def whorl(leaves: int, leaf: Mesh, rise_m: float) -> Mesh:
    """Leaves around a stem, each a golden angle on and a little higher."""
    golden = np.pi * (3.0 - np.sqrt(5.0))
    parts = [turned(leaf, rotation_z(k * golden), (0.0, 0.0, rise_m * k / leaves)) for k in range(leaves)]
    return merged(*parts)


def tuft(radius_m: float, height_m: float, florets: int = 26) -> Mesh:
    """Brush of filaments: a domed cushion with narrow blades standing out of it, its centre at the origin."""
    golden = np.pi * (3.0 - np.sqrt(5.0))
    bottom = -0.5 * height_m
    rings = np.array([0.45, 0.80, 0.72, 0.40, 0.02])
    levels = bottom + height_m * np.array([0.0, 0.35, 0.62, 0.80, 0.88])
    parts = [surface_of_revolution(radius_m * rings, levels, 9)]
    for k in range(florets):
        lean = np.sqrt((k + 0.5) / florets)
        angle = k * golden
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        side = np.array([-np.sin(angle), np.cos(angle), 0.0]) * 0.10 * radius_m
        foot = 0.55 * radius_m * lean * out + np.array([0.0, 0.0, bottom + 0.45 * height_m])
        tip = radius_m * lean * out + np.array([0.0, 0.0, bottom + height_m * (1.0 - 0.35 * lean**2)])
        parts.append(flat_shaded(np.stack([foot - side, foot + side, tip]), np.array([[0, 1, 2]]), two_sided=True))
    return merged(*parts)
