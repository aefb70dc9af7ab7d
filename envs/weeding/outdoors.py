"""What a strip's day and ground look like, all of it from the one number of its looks: light, soil, litter, camera.

Ranges are those of days on which one weeds and of soils in daylight [assumed]; a sun below 25 degrees or rain is not
among them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...kernels.elementary import exp
from ...rendering.instances import Instances, about_z, instances
from ...rendering.library import MeshLibrary
from ...rendering.optics import Optics
from ...rendering.outdoor import Outdoors, Shade, Soil
from ...rendering.raster import Light
from ...rendering.shapes import ball, box, surface_of_revolution
from ..core import Array

SOILS = {
    "dry loam": (142.0, 116.0, 90.0),
    "moist loam": (96.0, 76.0, 58.0),
    "clay": (136.0, 98.0, 70.0),
    "silt": (126.0, 116.0, 102.0),
    "peat": (66.0, 57.0, 50.0),
    "sand": (160.0, 139.0, 110.0),
}
"""Colours in full light."""
_STRAW, _STONE, _MOSS, _WOOD = (0.66, 0.58, 0.40), (0.50, 0.47, 0.43), (0.30, 0.37, 0.18), (0.36, 0.29, 0.22)
_MEAN_LIGHT = 96.0
"""What the exposure aims at for bare ground, out of 255."""
_TREES, _CLOUDY = 0.5, 0.35
"""How often an edge of shade falls into sunny pictures; how often the sky is overcast."""


class Day(NamedTuple):
    """Light, soil and camera of one strip.

    Attributes:
        light: sun and sky.
        dark: share of the sun's light that a plant's shadow leaves.
        soil: bare ground.
        shade: (3,), direction of the shade's edge in radians, how far from the picture's middle it lies and how far it
            comes and goes, metres.
        shade_sun: share of the sun's light within it, 1 where there is none.
        soft_m: over which the edge fades.
        gain: (3,), of the colours.
        lens_px: blur.
        open_s: how long the shutter is open.
        read: noise, see ``Optics``.
        shot: see ``Optics``.
        corner: see ``Optics``.
        litter: (4,), straw, stones, moss, crumbs of wood, a square metre.
    """

    light: Light
    dark: float
    soil: Soil
    shade: Array
    shade_sun: float
    soft_m: float
    gain: Array
    lens_px: float
    open_s: float
    read: float
    shot: float
    corner: float
    litter: Array


def day_of(look: float) -> Day:
    """The day of a strip with this uniform number."""
    rng = np.random.default_rng([int(look * 2.0**53), 1])
    cloudy = rng.random() < _CLOUDY
    height, azimuth = np.deg2rad(rng.uniform(25.0, 65.0)), rng.uniform(0.0, 2.0 * np.pi)
    if cloudy:
        height = np.deg2rad(75.0)
    towards = np.array([np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth), np.sin(height)])
    ambient, diffuse = (rng.uniform(0.70, 0.85), rng.uniform(0.10, 0.25)) if cloudy else (
        rng.uniform(0.30, 0.50), rng.uniform(0.65, 0.95)
    )  # fmt: skip
    warm = rng.uniform(0.0, 0.08)
    light = Light(towards, ambient, diffuse, 0.03, np.array([1.0 + 0.3 * warm, 1.0, 1.0 - warm]))
    names = sorted(SOILS)
    base = np.array(SOILS[names[int(rng.integers(len(names)))]]) * exp(0.03 * rng.standard_normal(3))
    turn = rng.uniform(0.0, 2.0 * np.pi)
    soil = Soil(
        base,
        float(rng.uniform(0.08, 0.26)),
        float(rng.uniform(0.0, 0.45)),
        float(rng.uniform(0.4, 1.3)),
        np.array([np.cos(turn), np.sin(turn)]),
        rng.uniform(0.0, 9.0, 2),
    )
    shaded = not cloudy and rng.random() < _TREES
    level = ambient + diffuse * towards[2] * (0.6 if shaded else 1.0)
    exposure = (
        _MEAN_LIGHT / (max(base.mean(), 90.0) * level * (1.0 - 0.5 * soil.patch)) * exp(0.15 * rng.standard_normal())
    )
    return Day(
        light,
        float(rng.uniform(0.05, 0.30)),
        soil,
        np.array([rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-0.12, 0.12), rng.uniform(0.0, 0.08)]),
        float(rng.uniform(0.05, 0.30)) if shaded else 1.0,
        float(rng.uniform(0.003, 0.025)),
        exposure * exp(0.025 * rng.standard_normal(3)),
        float(rng.uniform(0.45, 0.80)),
        float(rng.uniform(0.003, 0.008) if cloudy else rng.uniform(0.001, 0.003)),
        float(rng.uniform(1.5, 3.5)),
        float(rng.uniform(0.05, 0.25)),
        float(rng.uniform(0.0, 0.25)),
        np.array([rng.choice([0.0, 15.0, 80.0]), rng.uniform(20.0, 200.0), rng.choice([0.0, 2.0, 12.0]), 20.0]),
    )


def seen_by(day: Day, eye: Array, speed_m_s: float, pixel_m: float, seed: int) -> Outdoors:
    """What a camera at ``eye`` (3,) over a strip is to see.

    Args:
        day: of the strip.
        eye: metres.
        speed_m_s: of the cart, along the picture.
        pixel_m: of the ground under it.
        seed: of the noise.
    """
    angle, away_m, sway_m = day.shade.tolist()
    normal = np.array([np.cos(angle), np.sin(angle)])
    # The machine's own shade goes along with it, give or take how its parts move.
    edge_m = float(normal @ eye[:2]) + away_m + sway_m * np.sin(2.1 * float(eye[0]) + angle)
    shade = Shade(normal, edge_m, day.soft_m, day.shade_sun)
    optics = Optics(
        day.lens_px, min(speed_m_s * day.open_s / pixel_m, 4.0), day.gain, day.read, day.shot, day.corner
    )  # fmt: skip
    return Outdoors(day.light, day.dark, day.soil, shade, optics, seed)


class Litter:
    """Straw, stones, moss and crumbs of wood, metre by metre."""

    def __init__(self, library: MeshLibrary):
        """Add the meshes."""
        moss = surface_of_revolution(np.array([1.0, 0.8, 0.0]), np.array([0.02, 0.12, 0.16]), 9)
        self._kinds: list[tuple[int, ArrayLike, tuple[float, float], tuple[float, float, float]]] = [
            (library.add(box((1.0, 1.0, 1.0), bottom=False)), _STRAW, (0.010, 0.070), (1.0, 0.045, 0.03)),
            (library.add(ball(1.0, 6, 8)), _STONE, (0.002, 0.012), (1.0, 0.8, 0.5)),
            (library.add(moss), _MOSS, (0.005, 0.025), (1.0, 0.8, 0.12)),
            (library.add(box((1.0, 1.0, 1.0), bottom=False)), _WOOD, (0.004, 0.020), (1.0, 0.25, 0.2)),
        ]

    def between(self, low_m: float, high_m: float, half_m: float, look: float, day: Day) -> Iterator[Instances]:
        """What lies between two places along, so far to both sides, on a strip with this uniform number."""
        for metre in range(int(np.floor(low_m)), int(np.ceil(high_m))):
            rng = np.random.default_rng([int(look * 2.0**53), 2, metre + 1000])
            for (mesh, colour, (small_m, large_m), form), each in zip(self._kinds, day.litter.tolist(), strict=True):
                n = int(rng.poisson(each * 2.0 * half_m))
                if not n:
                    continue
                at = np.column_stack([metre + rng.random(n), rng.uniform(-half_m, half_m, n), np.zeros(n)])
                size = small_m * (large_m / small_m) ** rng.random(n)
                scale = size[:, None] * np.array(form) * exp(0.2 * rng.standard_normal((n, 3)))
                turn = about_z(rng.uniform(0.0, 2.0 * np.pi, n)) * scale[:, None, :]
                tone = np.array(colour) * exp(0.12 * rng.standard_normal((n, 1)) + 0.03 * rng.standard_normal((n, 3)))
                at[:, 2] = 0.25 * scale[:, 2]
                yield instances(mesh, at, turn, np.clip(tone, 0.0, 1.0))
