"""How the crop stands across the working width: rows, and where between them weeds are left."""

from __future__ import annotations

from dataclasses import dataclass

from ...kernels.config import Config, num


@dataclass(frozen=True)
class BedConfig(Config):
    """Rows within the working width; as it stands, one in its middle and weeds all over. Lengths in metres."""

    rows: int = num(1, 1, 8, "")
    """Crop rows within the working width, ``row_m`` apart, about its middle [assumed]."""
    row_band_m: float | None = num(None, 0.01, 2.0, "m")
    """Width about each row in which weeds grow: what lies between has been hoed. None: they grow over the whole width
    [published: hoes between rows leave 0.08-0.12 m about a row]."""

    @property
    def beside(self) -> int:
        """So many crop plants on either side along of the nearest one may stand beside it: of every other row two."""
        return 2 * self.rows - 1
