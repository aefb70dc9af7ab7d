"""The planar five-bar that carries the safflower picker's cutting head."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .batching import Array
from .errors import positive_length
from .two_legs import Conditioning, Leg, TwoLegs

__all__ = ["Conditioning", "FiveBar", "FiveBarChains"]


class FiveBarChains(NamedTuple):
    """Every joint of a posed five-bar, shape (..., 2) each, in the paper's letters (Fig. 3)."""

    b: Array
    c: Array
    d: Array
    e: Array
    q: Array
    """Angles of the driven-by-motor arms (q1, q4), radians."""
    q_passive: Array
    """Angles of the forearms (q2, q3), radians."""


@dataclass(frozen=True)
class FiveBar(TwoLegs):
    """Two-degree-of-freedom planar five-bar A-B-C-T-D-E-F after the safflower paper, eqs 1-34 with their corrections.

    The motors sit at A = (0, 0) and F = (base, 0); the arms AB and FE are driven, the forearms BC and ED carry the
    platform CD, which stays level, and the tool centre T lies ``tool_drop_m`` below the middle of CD. The tool hangs
    below the motors, elbows outwards. Positions are T = (x, y) in metres, x across the row, y upwards; joints are
    (q1, q4). ``TwoLegs`` documents the limits and the angles' range.

    The paper's equations behind the methods, all in their corrected form: ``inverse`` 1-13, ``forward`` 23-28,
    ``jacobian`` 18, ``joint_rates`` 17, ``pose_rates`` 19-20, ``joint_accelerations`` 22, ``transmission_angles`` 30
    (with the parallel singularity that it lacks), ``pose_error`` 31-33, ``workspace`` Fig. 6.

    Attributes:
        arm_m: driven arms, (l1, l6).
        forearm_m: forearms, (l2, l5).
        half_platform_m: half the platform's width, l3.
        tool_drop_m: tool centre below the platform joints, l4.
        base_m: distance of the motors, l7.
    """

    arm_m: tuple[float, float]
    forearm_m: tuple[float, float]
    half_platform_m: float
    tool_drop_m: float
    base_m: float

    _JOINTS: ClassVar[tuple[str, str]] = ("q1", "q4")

    def __post_init__(self) -> None:
        """Check the lengths and limits."""
        positive_length(l1=self.arm_m[0], l2=self.forearm_m[0], l5=self.forearm_m[1], l6=self.arm_m[1], l7=self.base_m)
        for name in ("half_platform_m", "tool_drop_m"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} = {getattr(self, name)} m: give a length >= 0")
        self._check_limits()

    @classmethod
    def safflower(cls) -> FiveBar:
        """The picker's geometry.

        l1 = l6 = 175 mm, l2 = l5 = 350 mm and l7 - 2 l3 = 500 mm are identified from the paper's workspace (an
        equilateral triangle of side 0.35 m, Fig. 6) and Table 1; how the 500 mm split into l7 and l3, and l4, do not
        change the motion and are assumed.
        """
        return cls.from_lengths(0.175, 0.350, 0.040, 0.060, 0.350, 0.175, 0.580)

    @classmethod
    def from_lengths(
        cls, l1: float, l2: float, l3: float, l4: float, l5: float, l6: float, l7: float, **limits: object
    ) -> FiveBar:
        """Build from the paper's link names (metres); ``limits`` are the keyword limits of the class."""
        return replace(cls((l1, l6), (l2, l5), l3, l4, l7), **limits)  # type: ignore[arg-type]

    def chains(self, position: ArrayLike) -> FiveBarChains:
        """All joint positions and angles at tool positions (..., 2); NaN where unreachable."""
        pose = self._pose(position)
        elbows, wrists = pose.elbow, pose.wrist
        return FiveBarChains(
            elbows[..., 0, :], wrists[..., 0, :], wrists[..., 1, :], elbows[..., 1, :], pose.arm, pose.forearm
        )

    @property
    def _legs(self) -> tuple[Leg, Leg]:
        return (
            Leg(self.arm_m[0], self.forearm_m[0], 0.0, -self.half_platform_m, 1.0),
            Leg(self.arm_m[1], self.forearm_m[1], self.base_m, self.half_platform_m, -1.0),
        )

    @property
    def _drop_m(self) -> float:
        return self.tool_drop_m
