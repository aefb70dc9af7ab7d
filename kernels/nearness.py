"""Numbers that are looked at before they are needed, so that memory is waited for once and not number after number.

A kernel that treats world after world waits for each one's numbers where they lie far from the processor. Reads that
depend on nothing go on side by side: a short loop that wants those of the next worlds has them brought near at once.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, overload

from .binding import OPTIONS


def want(number: Any) -> None:
    """Have a number read now, whatever becomes of it."""


@intrinsic
def _want(_: Any, number: Any) -> Any:
    """An empty instruction that takes the number: no compiler leaves the reading out."""
    word = ir.IntType(64)
    signature = types.void(number)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        bits = arguments[0]
        if number == types.float32:
            bits = builder.zext(builder.bitcast(bits, ir.IntType(32)), word)
        elif number == types.float64:
            bits = builder.bitcast(bits, word)
        builder.call(ir.InlineAsm(ir.FunctionType(ir.VoidType(), [word]), "", "r", side_effect=True), [bits])
        return context.get_dummy_value()

    return (signature, code) if number in (types.float32, types.float64, types.int64) else None


@overload(want, strict=False, jit_options=OPTIONS)
def _compiled_want(number: Any) -> Any:
    return lambda number: _want(number)  # type: ignore[call-arg]
