"""Numbers of the ground that a weeder drives over, and of how its cart and its cameras take it.

Sources beside those of ``rough_config``: wheel slip of 10-19 % at drawbar work; an autonomous tractor between rows
(SD 14.3 mm); visual odometry in a crop field (3.76 % of the way).
"""

from __future__ import annotations

from dataclasses import dataclass

from ...kernels.config import flag, num
from ..rough_config import RoughGround

LARGEST_SLIP = 0.045
"""Slip strays from its mean by at most this: half of the published range of 10-19 %."""


@dataclass(frozen=True)
class GroundConfig(RoughGround):
    """The ground under the cart, and what shakes with it; as it stands, a plane that the cart drives over on rails."""

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
        return self.rough or self.slip_share > 0.0 or self.wander_m > 0.0

    @property
    def uneven(self) -> bool:
        """Whether fields say how the ground lies and how the odometry errs on it.

        Where they do, level or not, the tool camera looks after the move.
        """
        return self.shakes or self.second_motion or self.drift_share is not None
