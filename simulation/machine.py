"""What every machine in PyBullet shares: the world that it lives in, how it leaves it, where its motions may begin."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from .assembly import Assembly
from .assets import asset_path
from .client import PhysicsClient
from .closed_loop import Array, Body, ClosedLoopMachine

MachineT = TypeVar("MachineT", bound="LoopMachine")

START_TOLERANCE_M = 0.003
"""How far a commanded trajectory may start from where the machine stands; a jump could flip a closed loop over."""


class LostMachineError(ValueError):
    """A motion was to begin where the machine does not stand."""


class LoopMachine:
    """A closed-loop machine in a world of its own, or in one that was lent.

    Usable as a context manager. A subclass says ``numbers`` and makes ``_machine`` in ``_build``.

    Attributes:
        parameters: the numbers that it was built from.
        client: the world that it lives in; it holds nothing else unless it was lent.
    """

    numbers: ClassVar[type]
    """Class of the parameters."""
    world: ClassVar[Mapping[str, Any]] = {}
    """Further arguments of a ``PhysicsClient`` of its own."""
    parameters: Any
    _machine: ClosedLoopMachine

    def __init__(self, parameters: Any = None, client: PhysicsClient | None = None) -> None:
        """Enter the world and build the machine there.

        Args:
            parameters: its numbers, by default those of its class; ``physics_hz`` is the rate of a world of its own.
            client: a world to build in; the machine makes its own, and closes it, where this is left out.
        """
        self.parameters = parameters or self.numbers()
        self._owns_client = client is None
        self.client = client or PhysicsClient(self.parameters.physics_hz, **self.world)
        self._open = True
        self._build()

    def _build(self) -> None:
        """Make ``_machine`` and put it where it begins."""
        raise NotImplementedError

    def _build_tree(self, asset: str, assembly: Assembly) -> None:
        """Make ``_machine`` of one tree: of the shipped URDF where its numbers are the shipped ones."""
        shipped = asset if self.parameters == self.numbers() else None
        (part,) = assembly.parts
        with urdf_file(shipped, part.robot.to_xml) as path:
            self._machine = ClosedLoopMachine(self.client, [Body(part.name, path)], assembly.closures, assembly.motors)

    def _follow(
        self,
        targets: Array,
        look: Callable[[int], None],
        on_step: Callable[[int], None] | None,
        measure: bool,
    ) -> float:
        """Drive the motors along ``targets`` (n, motors); ``look`` at every row that is reached, or at the last alone.

        Returns:
            Simulated seconds.
        """
        last = len(targets) - 1

        def watch(row: int) -> None:
            look(row)
            if on_step is not None:
                on_step(row)

        self._machine.follow(targets, watch if measure else on_step)
        if not measure or last == 0:
            look(last)
        return last * self.client.step_s

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
                self._machine.remove()
        self._open = False

    def __enter__(self: MachineT) -> MachineT:
        """Return the machine itself."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Close."""
        self.close()

    def motors_at(self, saturated: NDArray[np.bool_]) -> list[str]:
        """Names of the motors that are at their limits, from a report's ``saturated``."""
        return [motor.joint for motor, weak in zip(self._machine.motors, saturated.tolist(), strict=True) if weak]

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
