"""What a kernel works on, handed over as one thing: in one world, taking arrays one by one costs more than the rules.

Numba takes every array of a NamedTuple out of its Python object at every call, some 0.2 us each. A desk keeps them
taken out: a kernel that is handed a desk begins at once. Arrays stay the caller's own; both may read and write them.
"""

from __future__ import annotations

from typing import Any

from numba.core import config, types
from numba.experimental import structref

from .compiling import compiled


@structref.register
class DeskType(types.StructRef):
    """Numba's type of a desk."""

    def preprocess_fields(self, fields: Any) -> Any:
        """Numbers by their type, not by their value."""
        return tuple((name, types.unliteral(kind)) for name, kind in fields)


class Desk(structref.StructRefProxy):
    """What lies on a desk, as kernels take it.

    Attributes:
        rules: what the rules look up; the same in every world.
        worlds: state of B worlds.
        plan: what the machine has to do; a kernel that plans puts its own here.
    """

    def __new__(cls, rules: Any, worlds: Any, plan: Any) -> Any:
        """Lay the parts on a desk; they are NamedTuples of arrays and numbers, or tuples of such."""
        return _laid(rules, worlds, plan)


class PlainDesk:
    """A desk where kernels run as Python."""

    def __init__(self, rules: Any, worlds: Any, plan: Any):
        """See ``Desk``."""
        self.rules, self.worlds, self.plan = rules, worlds, plan


structref.define_proxy(Desk, DeskType, ["rules", "worlds", "plan"])


@compiled
def _laid(rules: Any, worlds: Any, plan: Any) -> Any:
    """A desk, by machine code that is kept: Numba's own constructor is compiled anew in every process."""
    return Desk(rules, worlds, plan)


def desk(rules: Any, worlds: Any, plan: Any) -> Any:
    """A desk with these parts, see ``Desk``."""
    made = PlainDesk if config.DISABLE_JIT else Desk  # type: ignore[attr-defined]
    return made(rules, worlds, plan)


@compiled
def planned(desk: Any) -> Any:
    """The plan that lies on a desk."""
    return desk.plan
