"""Products of 64-bit words in full: 128 bits, which neither NumPy nor Numba have."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, overload

from .binding import OPTIONS


def product(a: np.uint64, b: np.uint64) -> tuple[np.uint64, np.uint64]:
    """The upper and the lower 64 bits of ``a * b``."""
    whole = int(a) * int(b)
    return np.uint64(whole >> 64), np.uint64(whole & 0xFFFFFFFFFFFFFFFF)


@intrinsic
def _product(_: Any, a: Any, b: Any) -> Any:
    """One instruction where the processor has it, as all with 64 bits do."""
    word, double = ir.IntType(64), ir.IntType(128)
    signature = types.UniTuple(types.uint64, 2)(types.uint64, types.uint64)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        whole = builder.mul(*(builder.zext(argument, double) for argument in arguments))
        parts = [builder.trunc(part, word) for part in (builder.lshr(whole, double(64)), whole)]
        return context.make_tuple(builder, signature.return_type, parts)

    return signature, code


@overload(product, strict=False, jit_options=OPTIONS)
def _compiled_product(a: Any, b: Any) -> Any:
    return lambda a, b: _product(a, b)  # type: ignore[call-arg]
