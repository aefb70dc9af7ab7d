"""What the weeding rules ask of a tool's work on plants; they know nothing else about it.

The work is a set of numbers, a NamedTuple of plain floats and tuples; ``dose`` is a function of them that each tool
compiles and binds to the type of its numbers (see ``timing``).
"""

from __future__ import annotations

from typing import Any, Protocol

from ...kernels import by_kind
from ..core import Array
from .response import Response


class WeedingProcess(Protocol):
    """What a tool does to plants. Doses add up; a plant dies when its sum reaches its tolerance."""

    @property
    def modes(self) -> tuple[str, str, str]:
        """Names of the three modes."""
        ...

    @property
    def phases(self) -> type[Any]:
        """Declares the phases on the target."""
        ...

    @property
    def work(self) -> Any:
        """Numbers for ``dose``; beyond their ``reach_m`` the work does nothing to growing points and roots.

        Within their ``leaf_m[mode]`` of the work's middle leaves are lost.
        """
        ...

    work_s: Array
    """Seconds (M, phases) of each phase by mode."""
    energy_j: Array
    """Energy (M,) by mode."""

    response: Response
    """What plants can take."""


@by_kind
def dose(work: Any, mode: int, along_m: float, across_m: float, kind: int) -> float:
    """Dose on a plant at an offset from the tool's work; its kind is a weed's stage, or 3 for a crop plant."""
    raise NotImplementedError
