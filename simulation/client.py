"""One private PyBullet world."""

from __future__ import annotations

import os
import sys
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

GRAVITY_M_S2 = 9.81


@contextmanager
def _silent_stderr() -> Iterator[None]:
    """Close the process's error stream for a moment, below Python's own ``sys.stderr``."""
    if sys.stderr is not None:
        sys.stderr.flush()
    kept = os.dup(2)
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(null)


def _import_pybullet() -> Any:
    """PyBullet, without the build date that its C code prints on import into whatever the program is displaying.

    Raises:
        ImportError: it is not installed; one line says what to install.
    """
    if (known := sys.modules.get("pybullet")) is not None:
        return known
    try:
        with _silent_stderr():
            import pybullet
    except ImportError:
        package = "pybullet" if sys.version_info < (3, 12) else "pybullet-arm64"
        told = f'backend="pybullet" needs PyBullet, which is not installed: pip install {package}, or take "analytic"'
        raise ImportError(f"{told}, which computes the same motion", name="pybullet") from None
    return pybullet


class _Later:
    """The module, imported when something of it is used: pictures are drawn, and numbers asked for, without it."""

    def __getattr__(self, name: str) -> Any:
        """Find a name in the module, and keep it."""
        found = getattr(_import_pybullet(), name)
        setattr(self, name, found)
        return found


pybullet: Any = _Later()
"""The module; typed as ``Any`` because it is a C extension without stubs."""


class PhysicsClient:
    """A PyBullet client of its own: two of them never see each other's bodies.

    Usable as a context manager; it disconnects when it is closed, collected, or when the interpreter ends.

    Attributes:
        id: PyBullet's number of the client; pass it as ``physicsClientId`` to every PyBullet call.
        physics_hz: steps a simulated second.
    """

    def __init__(
        self,
        physics_hz: float = 240.0,
        *,
        solver_iterations: int = 25,
        erp: float = 0.8,
        gravity_m_s2: float = GRAVITY_M_S2,
    ) -> None:
        """Connect and set up the engine.

        Args:
            physics_hz: steps a simulated second, > 0; the error of closed loops falls with its square.
            solver_iterations: sweeps over the constraints a step, all in the same direction: for closed loops that
                converges about twice as fast as PyBullet's own alternating sweeps.
            erp: share of a constraint's position error that is taken back each step. Only this engine-wide value acts
                on point-to-point constraints.
            gravity_m_s2: downwards.

        Raises:
            ValueError: a number is out of range.
            RuntimeError: PyBullet refused to connect.
        """
        if not 0.0 < physics_hz < float("inf"):
            raise ValueError(f"physics_hz = {physics_hz}: give a positive rate, 240 is usual")
        if solver_iterations < 1 or not 0.0 < erp <= 1.0:
            raise ValueError(f"solver_iterations = {solver_iterations} must be >= 1 and erp = {erp} in (0, 1]")
        self.physics_hz = float(physics_hz)
        try:
            self.id: int = pybullet.connect(pybullet.DIRECT)
        except pybullet.error as error:
            raise RuntimeError(f"PyBullet did not connect ({error}): close another client first") from error
        if self.id < 0:
            raise RuntimeError("PyBullet did not connect: too many clients are open, close some")
        self._finalizer = weakref.finalize(self, _disconnect, self.id)
        pybullet.setGravity(0.0, 0.0, -gravity_m_s2, physicsClientId=self.id)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1.0 / self.physics_hz,
            numSolverIterations=1,
            numNonContactInnerIterations=solver_iterations,
            erp=erp,
            deterministicOverlappingPairs=1,
            physicsClientId=self.id,
        )

    @property
    def step_s(self) -> float:
        """Simulated seconds a step."""
        return 1.0 / self.physics_hz

    @property
    def closed(self) -> bool:
        """Whether ``close`` has been called."""
        return not self._finalizer.alive

    def step(self) -> None:
        """Advance the world by one step."""
        pybullet.stepSimulation(physicsClientId=self.id)

    def close(self) -> None:
        """Disconnect; calling it again does nothing."""
        self._finalizer()

    def __enter__(self) -> PhysicsClient:
        """Return the client itself."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Close."""
        self.close()


def _disconnect(client_id: int) -> None:
    # The window may be gone already, or the interpreter may have torn PyBullet down first.
    if pybullet.isConnected(physicsClientId=client_id):
        pybullet.disconnect(physicsClientId=client_id)
