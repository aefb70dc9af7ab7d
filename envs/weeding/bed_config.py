"""How the crop stands across the working width: rows, ridges under them, its height, and where weeds are left."""

from __future__ import annotations

from dataclasses import dataclass

from ...kernels.config import Config, num

USUAL_CROP_M = 0.05
"""Height of the crop that the tools' own heights over ground are meant for [assumed: a beet of six leaves]."""


@dataclass(frozen=True)
class BedConfig(Config):
    """Rows within the working width; as it stands, one in its middle and weeds all over. Lengths in metres."""

    rows: int = num(1, 1, 8, "")
    """Crop rows within the working width, ``row_m`` apart, about its middle [assumed]."""
    row_band_m: float | None = num(None, 0.01, 2.0, "m")
    """Width about each row in which weeds grow: what lies between has been hoed. None: they grow over the whole width
    [assumed]."""
    crop_height_m: float = num(USUAL_CROP_M, 0.0, 0.6, "m")
    """Height of the crop: platform or blade passes as much higher over the ground as it is taller than 0.05 m
    [assumed]."""
    ridge_m: float = num(0.0, 0.0, 0.3, "m")
    """Height of the ridge under each row over the furrows; 0: flat [assumed; no usable source was found]."""
    ridge_width_m: float = num(0.2, 0.02, 2.0, "m")
    """Width of a ridge at its foot; it rises and falls without an edge [assumed]."""
    frame_m: float = num(0.0, -0.3, 0.3, "m")
    """How much higher than usual the machine's frame is set over the furrows before it drives, as one sets a tool bar,
    so that the tool reaches furrow and ridge [assumed]."""

    @property
    def levels_m(self) -> tuple[float, float]:
        """Height of furrows and of ridges over the level that the tool is mounted for."""
        return 0.0 - self.frame_m, self.ridge_m - self.frame_m

    @property
    def flat(self) -> bool:
        """Whether the ground lies all over where the tool is mounted for, under the usual crop."""
        return self.levels_m == (0.0, 0.0) and self.taller_m == 0.0

    @property
    def taller_m(self) -> float:
        """How much the crop is taller than the usual one."""
        return self.crop_height_m - USUAL_CROP_M

    @property
    def beside(self) -> int:
        """So many crop plants on either side along of the nearest one may stand beside it: of every other row two."""
        return 2 * self.rows - 1
