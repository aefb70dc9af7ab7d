"""What every machine in PyBullet shares: the world that it lives in, how it leaves it, where its motions may begin."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .assets import asset_path
from .client import PhysicsClient
from .closed_loop import ClosedLoopMachine

MachineT = TypeVar("MachineT", bound="LoopMachine")

START_TOLERANCE_M = 0.003
"""How far a commanded trajectory may start from where the machine stands; a jump could flip a closed loop over."""


class LostMachineError(ValueError):
    """A motion was to begin where the machine does not stand."""


class LoopMachine:
    """A closed-loop machine in a world of its own, or in one that was lent.

    Usable as a context manager. A subclass makes ``_machine`` in its constructor.

    Attributes:
        parameters: the numbers that it was built from.
        client: the world that it lives in; it holds nothing else unless it was lent.
    """

    parameters: Any
    _machine: ClosedLoopMachine

    def __init__(self, parameters: Any, client: PhysicsClient | None, **own: Any) -> None:
        """Enter the world.

        Args:
            parameters: the machine's numbers; ``physics_hz`` is the rate of a world of its own.
            client: a world to build in; the machine makes its own, and closes it, where this is None.
            **own: further arguments of a ``PhysicsClient`` of its own.
        """
        self.parameters = parameters
        self._owns_client = client is None
        self.client = client or PhysicsClient(parameters.physics_hz, **own)
        self._open = True

    @property
    def body_id(self) -> int:
        """PyBullet's number of the machine's body, the first where it has several."""
        return next(iter(self._machine.body_ids.values()))

    def close(self) -> None:
        """Leave the world: close it if it is the machine's own, else remove the bodies. Again does nothing."""
        if self._open and not self.client.closed:
            if self._owns_client:
                self.client.close()
            else:
                self._remove()
        self._open = False

    def __enter__(self: MachineT) -> MachineT:
        """Return the machine itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()

    def motors_at(self, saturated: NDArray[np.bool_]) -> list[str]:
        """Names of the motors that are at their limits, from a report's ``saturated``."""
        return [motor.joint for motor, weak in zip(self._machine.motors, saturated.tolist(), strict=True) if weak]

    def _remove(self) -> None:
        """Take everything out of a world that was lent."""
        self._machine.remove()

    def _require_rate(self) -> None:
        """Raise a ValueError where a lent world runs at another rate than trajectories are sampled at."""
        if self.client.physics_hz != self.parameters.physics_hz:
            raise ValueError(
                f"the client runs at {self.client.physics_hz} Hz, the machine's parameters say "
                f"{self.parameters.physics_hz} Hz: give {type(self).__name__} no client, or one of its own rate"
            )

    def _require_start(self, jump_m: float) -> None:
        """Raise a LostMachineError where a trajectory starts too far from where the machine stands."""
        if jump_m > START_TOLERANCE_M:
            raise LostMachineError(
                f"the trajectory starts {1e3 * jump_m:.1f} mm from where the machine stands; at most "
                f"{1e3 * START_TOLERANCE_M:.0f} mm is allowed: start at the last commanded pose, call reset(), or give "
                "stronger motors if the last motion's report says that they were saturated"
            )


@contextmanager
def urdf_file(shipped: str | None, write: Callable[[], str]) -> Iterator[Path]:
    """Path of a shipped URDF, or of one that is written for the moment.

    Args:
        shipped: name of the asset; None where the machine's numbers are not the shipped ones.
        write: gives the text of the other one.
    """
    if shipped is not None:
        with asset_path(shipped) as path:
            yield path
        return
    handle, name = tempfile.mkstemp(suffix=".urdf", prefix="fieldgym-")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(write())
        yield Path(name)
    finally:
        os.unlink(name)
