"""The translational five-bar that moves plug seedlings between trays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .batching import Array
from .dynamics import LinkMasses, motor_torques
from .errors import positive_length
from .two_legs import Leg, TwoLegs

Corner = tuple[float, float]


@dataclass(frozen=True)
class TranslationalFiveBar(TwoLegs):
    """Two-degree-of-freedom translational parallel machine after the transplanting paper, eqs 11-16, corrected.

    Two driven arms, two forearms and parallelogram chains beside them that keep the gripper upright. The motors stand
    at (+e, 0) for leg 1 and (-e, 0) for leg 2, e being half the motors' distance less half the platform's width, so
    that both forearms meet in the tool point r = (x, y), metres, x across the machine, y upwards; the machine works
    at y < 0 with its elbows outwards. Joints are (theta1, theta2), the paper's theta_1i, right leg first. ``TwoLegs``
    documents the methods, the limits and the angles' range.

    The inverse is the corrected eq. 12, theta = atan2(A, B) - sgn(i) arccos(-C / sqrt(A^2 + B^2)), in its half-angle
    form about the hanging direction: the printed quotient is 0/0 where C = B, which lies inside the workspace.

    Attributes:
        motor_offset_m: e.
        arm_m: l1.
        forearm_m: l2.
        window_m: lower left and upper right corner of the working rectangle, metres.
        masses: of the links, for ``inverse_dynamics``; None where the geometry alone is meant.
    """

    motor_offset_m: float
    arm_m: float
    forearm_m: float
    window_m: tuple[Corner, Corner]
    masses: LinkMasses | None = None

    _JOINTS: ClassVar[tuple[str, str]] = ("theta1", "theta2")

    def __post_init__(self) -> None:
        """Check the lengths, the window and the limits."""
        positive_length(motor_offset_m=self.motor_offset_m, arm_m=self.arm_m, forearm_m=self.forearm_m)
        (left, bottom), (right, top) = self.window_m
        if not (left < right and bottom < top < 0.0):
            raise ValueError(
                f"window_m = {self.window_m}: give the lower left and the upper right corner of a rectangle below y = 0"
            )
        self._check_limits()

    @classmethod
    def transplanter(cls) -> TranslationalFiveBar:
        """The tray transplanter: a window of 600 x 150 mm (published) below y = -510 mm.

        The paper prints no lengths. e = 150, l1 = 360 and l2 = 640 mm are assumed, chosen so that the window is well
        conditioned: condition number at most 1.222, forearms never closer than 78.7 deg to one line, 16.5 rad/s at the
        motors for the published 4.5 m/s. The masses are assumed: light bars, arm and parallel bar 0.9 kg, forearm pair
        0.5 kg, elbow bracket 0.25 kg, platform with gripper 0.8 kg, rotor and gear 0.012 kg m2 at the arm. So are the
        limits: arm from -205 to -60 deg (left), elbows 30 deg and forearms 45 deg off their singularities.
        """
        return cls(
            0.150,
            0.360,
            0.640,
            ((-0.300, -0.660), (0.300, -0.510)),
            LinkMasses.of_uniform_bars(0.9, 0.360, 0.5, 0.640, 0.25, 0.8, 0.012),
            arm_range_rad=(np.deg2rad(-205.0), np.deg2rad(-60.0)),
            min_forearm_angle_rad=np.deg2rad(45.0),
            min_elbow_angle_rad=np.deg2rad(30.0),
        )

    def inverse_dynamics(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        payload_kg: ArrayLike = 0.0,
        gravity: float = 9.81,
    ) -> Array:
        """Motor torques (..., 2) in N m along a motion; see ``motor_torques``.

        Raises:
            ValueError: the machine has no masses.
        """
        if self.masses is None:
            raise ValueError("this machine has no masses: build it with masses=LinkMasses(...), or use transplanter()")
        return motor_torques(self, self.masses, position, velocity, acceleration, payload_kg, gravity)

    def window_grid(self, across: int, up: int) -> Array:
        """Positions (up, across, 2) that cover the working rectangle, edges included."""
        (left, bottom), (right, top) = self.window_m
        x, y = np.meshgrid(np.linspace(left, right, across), np.linspace(bottom, top, up))
        return np.stack([x, y], axis=-1)

    @property
    def _legs(self) -> tuple[Leg, Leg]:
        return (
            Leg(self.arm_m, self.forearm_m, self.motor_offset_m, 0.0, -1.0),
            Leg(self.arm_m, self.forearm_m, -self.motor_offset_m, 0.0, 1.0),
        )

    @property
    def _drop_m(self) -> float:
        return 0.0
