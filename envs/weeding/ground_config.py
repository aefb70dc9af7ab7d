"""Numbers of the ground that a weeder drives over, and of how its cart and its cameras take it.

Sources: ISO 8608 (classes by the displacement spectral density of the road, geometric means, waviness 2); a paddy soil
track after work (Gd(n0) = 645e-6 m3, waviness 1.24, measured from 0.05 to 3.5 cycles/m with rod and level); wheel slip
of 10-19 % at drawbar work; an autonomous tractor between rows (SD 14.3 mm); visual odometry in a crop field (3.76 % of
the way).
"""

from __future__ import annotations

from dataclasses import dataclass

from ...kernels.config import Config, choice, flag, num

LEVEL = "none"
ISO_M3 = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6}
"""Displacement spectral density at 0.1 cycles/m of the classes' middles [published: ISO 8608]."""
SOIL = "soil"
SOIL_M3, SOIL_WAVINESS = 645e-6, 1.24
"""A paddy soil track after work [published; it lies in class D]."""
ISO_WAVINESS = 2.0
"""Of all classes [published: ISO 8608]."""
LARGEST_SLIP = 0.045
"""Slip strays from its mean by at most this: half of the published range of 10-19 %."""


@dataclass(frozen=True)
class GroundConfig(Config):
    """The ground under the cart, and what shakes with it; as it stands, a plane that the cart drives over on rails."""

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
    drift_share: float | None = num(None, 0.0, 0.5, "")
    """Standard deviation of the odometry's error per distance driven, one value a strip, for rendered and statistical
    cameras alike; None: that of each camera's own [published: 0.6-3.8 % for visual odometry]."""
    slip_share: float = num(0.0, 0.0, 0.1, "")
    """Standard deviation of how the wheels' slip strays from its mean, which the odometry takes for way; at most 4.5 %
    [assumed; the bound is half of the published range of 10-19 %]."""
    wander_m: float = num(0.0, 0.0, 0.1, "m")
    """Standard deviation of the cart's way beside the row, in waves of 5-20 m [published: 14.3 mm for an autonomous
    tractor between rows; waves assumed]."""
    tool_camera: bool = flag(True)
    """Whether a tool with a camera of its own uses it."""
    second_motion: bool = flag(False)
    """Whether the tool camera looks after the move, from where the tool then is, and its correction is a motion of its
    own; on ground that shakes, or with a drift of its own, it always is."""

    @property
    def shakes(self) -> bool:
        """Whether the frame moves with the ground."""
        return self.iso_class != LEVEL or self.slip_share > 0.0 or self.wander_m > 0.0

    @property
    def uneven(self) -> bool:
        """Whether fields say how the ground lies and how the odometry errs on it.

        Where they do, level or not, the tool camera looks after the move.
        """
        return self.shakes or self.second_motion or self.drift_share is not None

    @property
    def roughness_m3(self) -> float:
        """Displacement spectral density at 0.1 cycles/m."""
        return {**ISO_M3, SOIL: SOIL_M3, LEVEL: 0.0}[self.iso_class]

    @property
    def waviness(self) -> float:
        """Exponent by which the density falls with the waves a metre."""
        return SOIL_WAVINESS if self.iso_class == SOIL else ISO_WAVINESS
