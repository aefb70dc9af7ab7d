"""What closed-form dynamics are made of: bodies by mass, centre and inertia, and efforts by what they scale with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .batching import Array
from .linear import apply

GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class Bar:
    """A slender body on a leg's line. What it turns with about that line itself is left out.

    Attributes:
        mass_kg: its mass.
        centre_m: its centre of mass from the end that it hangs on, along the line.
        across_kg_m2: inertia about its centre of mass, across the line.
    """

    mass_kg: float
    centre_m: float
    across_kg_m2: float


@dataclass(frozen=True)
class Solid:
    """A rigid body.

    Attributes:
        mass_kg: its mass.
        centre_m: its centre of mass in the body's frame.
        tensor_kg_m2: inertia about that centre, in the body's axes, row by row.
    """

    mass_kg: float
    centre_m: tuple[float, float, float]
    tensor_kg_m2: tuple[tuple[float, float, float], ...]

    def wrench(self, rotation: Array, acceleration: Array, spin: Array, spin_rate: Array, gravity: Array) -> Array:
        """Force and moment about the frame's origin (..., 6) that move the body (Newton and Euler).

        Args:
            rotation: the frame's axes as columns, (..., 3, 3).
            acceleration: of its origin, (..., 3), m/s2.
            spin: angular velocity, (..., 3), rad/s.
            spin_rate: its time derivative, (..., 3), rad/s2.
            gravity: (3,), m/s2.
        """
        arm = apply(rotation, np.asarray(self.centre_m))
        tensor = rotation @ np.asarray(self.tensor_kg_m2) @ np.swapaxes(rotation, -1, -2)
        centre = acceleration + np.cross(spin_rate, arm) + np.cross(spin, np.cross(spin, arm))
        force = self.mass_kg * (centre - gravity)
        moment = np.cross(arm, force) + apply(tensor, spin_rate) + np.cross(spin, apply(tensor, spin))
        return np.concatenate(np.broadcast_arrays(force, moment), axis=-1)


class Dynamics(Protocol):
    """A machine whose motors' efforts are known in closed form.

    ``position``, ``velocity`` and ``acceleration`` are what the machine's own kinematics take, (..., n).
    """

    @property
    def viscous(self) -> tuple[float, ...]:
        """Friction that grows with the rate, N s/m or N m s/rad a motor."""
        ...

    def efforts(
        self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike, gravity_m_s2: float = GRAVITY_M_S2
    ) -> Array:
        """Forces and torques (..., motors) that the motors exert along a motion without friction, N and N m."""
        ...

    def rates(self, position: ArrayLike, velocity: ArrayLike) -> Array:
        """Rates (..., motors) of the motors, m/s and rad/s."""
        ...


class EffortTerms(NamedTuple):
    """Efforts of the motors along a fixed path run in any time T: A / T^2 + B / T + G, each (..., motors).

    Attributes:
        inertia: A, N s2 or N m s2.
        viscous: B, N s or N m s.
        steady: G, N or N m: weight and load.
    """

    inertia: Array
    viscous: Array
    steady: Array

    def at(self, duration_s: ArrayLike) -> Array:
        """Efforts (..., motors) of the motion run in ``duration_s`` (...)."""
        time = np.asarray(duration_s, dtype=np.float64)[..., None]
        return self.inertia / time**2 + self.viscous / time + self.steady


def effort_terms(machine: Dynamics, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> EffortTerms:
    """The terms of a motion that is given as if it took one second.

    Velocity products scale with 1 / T^2 as accelerations do, which is why two terms and the friction's tell all.
    """
    v = np.asarray(velocity, dtype=np.float64)
    steady = machine.efforts(position, np.zeros_like(v), np.zeros_like(v))
    inertia = machine.efforts(position, v, acceleration, 0.0)
    if not any(machine.viscous):
        return EffortTerms(inertia, np.zeros_like(inertia), steady)
    return EffortTerms(inertia, machine.rates(position, v) * np.array(machine.viscous), steady)
