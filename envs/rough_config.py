"""Numbers of rough ground under four wheels.

Sources: ISO 8608 (classes by the displacement spectral density of the road, geometric means, waviness 2); a paddy soil
track after work (Gd(n0) = 645e-6 m3, waviness 1.24, measured from 0.05 to 3.5 cycles/m with rod and level).
"""

from __future__ import annotations

from dataclasses import dataclass

from ..kernels.config import Config, choice, num

LEVEL = "none"
ISO_M3 = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6}
"""Displacement spectral density at 0.1 cycles/m of the classes' middles [published: ISO 8608]."""
SOIL = "soil"
SOIL_M3, SOIL_WAVINESS = 645e-6, 1.24
"""A paddy soil track after work [published; it lies in class D]."""
ISO_WAVINESS = 2.0
"""Of all classes [published: ISO 8608]."""


@dataclass(frozen=True)
class RoughGround(Config):
    """Ground and the wheels on it; as it stands, a plane."""

    iso_class: str = choice(LEVEL, (LEVEL, *ISO_M3, SOIL))
    """Roughness by ISO 8608, ``"A"`` to ``"D"``; ``"soil"`` as measured on a paddy soil track; ``"none"``: a plane."""
    wheel_base_m: float = num(1.35, 0.2, 5.0, "m")
    """Front wheels before rear wheels, the tool in the middle [assumed: as drawn]."""
    track_m: float = num(1.32, 0.2, 5.0, "m")
    """Left wheels beside right wheels [assumed: as drawn]."""
    footprint_m: float = num(0.10, 0.001, 1.0, "m")
    """Length of ground over which a wheel averages [assumed]."""
    pivot_m: float = num(0.85, 0.0, 3.0, "m")
    """Height of the point whose way the odometry counts, about which the frame tilts; a wheel's encoder counts that of
    its axle, 0.28 m high [assumed: visual odometry by the front camera]."""

    @property
    def rough(self) -> bool:
        """Whether it is no plane."""
        return self.iso_class != LEVEL

    @property
    def roughness_m3(self) -> float:
        """Displacement spectral density at 0.1 cycles/m."""
        return {**ISO_M3, SOIL: SOIL_M3, LEVEL: 0.0}[self.iso_class]

    @property
    def waviness(self) -> float:
        """Exponent by which the density falls with the waves a metre."""
        return SOIL_WAVINESS if self.iso_class == SOIL else ISO_WAVINESS
