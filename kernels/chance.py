"""NumPy's own random numbers of many generators in one call, bit for bit, while Python is let go of.

A generator of NumPy's hands out a block in one call, and holds up every other thread before and after it. Here PCG64,
which ``np.random.default_rng`` and Gymnasium make, is stepped where its state lies: numbers and the state that is left
are those of NumPy's ``random`` and ``standard_normal``, in a third of the time.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import config, types
from numba.extending import intrinsic
from numba.np.random._constants import fi_double, ki_double, wi_double, ziggurat_nor_inv_r, ziggurat_nor_r
from numpy.typing import NDArray

from .compiling import compiled

Array = NDArray[np.float64]

_MULTIPLIER = (2549297995355413924 << 64) + 4865540595714422341
"""Of PCG64's steps."""
_LAST_BITS, _SIGN, _MANTISSA = np.uint64(0xFF), np.uint64(0x100), np.uint64(0x000FFFFFFFFFFFFF)
_ONE, _ROTATION, _WORD = np.uint64(1), np.uint64(58), np.uint64(63)
_LAYER, _TAIL, _FINE = np.uint64(9), np.uint64(8), np.uint64(11)
_UNIT = 1.0 / 9007199254740992.0


def fill_blocks(generators: Sequence[np.random.Generator], blocks: Sequence[Array]) -> None:
    """Fill blocks (R, n) with uniform and standard normal numbers in turn; each generator fills its own row of them."""
    places = _places(generators)
    if places is None:
        for row, generator in enumerate(generators):
            for number, block in enumerate(blocks):
                draw = generator.standard_normal if number % 2 else generator.random
                draw(out=block[row])
        return
    _fill(places, tuple(blocks))


def _places(generators: Sequence[np.random.Generator]) -> NDArray[np.int64] | None:
    """Where the state of each generator's PCG64 lies; None where kernels cannot step them all."""
    offset = _offset()
    if offset is None or not all(type(one.bit_generator) is np.random.PCG64 for one in generators):
        return None
    return np.array([id(one.bit_generator) for one in generators], np.int64) + offset


@cache
def _offset() -> int | None:
    """Where in a PCG64 the 128 bits of its state lie, which those of its increment follow, the lower half first.

    None where they lie elsewhere, or where kernels run as Python.
    """
    bits = np.random.PCG64(0)
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return None
    pointer_of = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)
    begin, size = id(bits), type(bits).__basicsize__
    place: int = pointer_of(("PyCapsule_GetPointer", ctypes.pythonapi))(bits.capsule, b"BitGenerator") or 0
    for _ in range(2):  # the interface points to the state, which points to its numbers; all are parts of the object
        if not begin <= place <= begin + size - 8:
            return None
        place = ctypes.c_uint64.from_address(place).value
    if not begin <= place <= begin + size - 32:
        return None
    lower, upper, *odd = (ctypes.c_uint64 * 4).from_address(place)
    known: Any = bits.state["state"]
    same = (upper << 64) + lower == known["state"] and (odd[1] << 64) + odd[0] == known["inc"]
    return place - begin if same else None


@intrinsic
def _words(_: Any, place: Any) -> Any:
    """The four words of a state at ``place``."""
    word = ir.IntType(64)
    signature = types.UniTuple(types.uint64, 4)(types.int64)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        begin = builder.inttoptr(arguments[0], word.as_pointer())
        parts = [builder.load(builder.gep(begin, [ir.IntType(32)(i)])) for i in range(4)]
        return context.make_tuple(builder, signature.return_type, parts)

    return signature, code


@intrinsic
def _put(_: Any, place: Any, low: Any, high: Any) -> Any:
    """Write the two words of a state, not those of its increment."""
    word = ir.IntType(64)
    signature = types.void(types.int64, types.uint64, types.uint64)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        begin = builder.inttoptr(arguments[0], word.as_pointer())
        for i in range(2):
            builder.store(arguments[1 + i], builder.gep(begin, [ir.IntType(32)(i)]))
        return context.get_dummy_value()

    return signature, code


@intrinsic
def _stepped(_: Any, low: Any, high: Any, low_odd: Any, high_odd: Any) -> Any:
    """The next state of PCG64 from one and its increment, each as its lower and its upper half."""
    word, double = ir.IntType(64), ir.IntType(128)
    signature = types.UniTuple(types.uint64, 2)(*[types.uint64] * 4)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        low, high, low_odd, high_odd = (builder.zext(argument, double) for argument in arguments)
        state = builder.or_(low, builder.shl(high, double(64)))
        odd = builder.or_(low_odd, builder.shl(high_odd, double(64)))
        state = builder.add(builder.mul(state, double(_MULTIPLIER)), odd)
        parts = [builder.trunc(part, word) for part in (state, builder.lshr(state, double(64)))]
        return context.make_tuple(builder, signature.return_type, parts)

    return signature, code


@compiled
def _mixed(low: Any, high: Any) -> Any:
    """The 64 random bits of a state."""
    turn, folded = high >> _ROTATION, low ^ high
    return (folded >> turn) | (folded << ((~turn + _ONE) & _WORD))


@compiled
def _uniform(bits: Any) -> float:
    """A number from 0 to below 1."""
    return np.float64(bits >> _FINE) * _UNIT


@compiled
def _normal(low: Any, high: Any, low_odd: Any, high_odd: Any) -> Any:
    """A standard normal number by the ziggurat's 256 layers, and the state after it."""
    while True:
        low, high = _stepped(low, high, low_odd, high_odd)  # type: ignore[call-arg]
        bits = _mixed(low, high)
        layer, whole = bits & _LAST_BITS, (bits >> _LAYER) & _MANTISSA
        x = np.float64(whole) * wi_double[layer]
        if bits & _SIGN:
            x = -x
        if whole < ki_double[layer]:
            return x, low, high
        if layer == 0:
            while True:
                low, high = _stepped(low, high, low_odd, high_odd)  # type: ignore[call-arg]
                beyond = -ziggurat_nor_inv_r * np.log1p(-_uniform(_mixed(low, high)))
                low, high = _stepped(low, high, low_odd, high_odd)  # type: ignore[call-arg]
                rest = -np.log1p(-_uniform(_mixed(low, high)))
                if rest + rest > beyond * beyond:
                    x = ziggurat_nor_r + beyond
                    return (-x if (whole >> _TAIL) & _ONE else x), low, high
        low, high = _stepped(low, high, low_odd, high_odd)  # type: ignore[call-arg]
        step = fi_double[layer - _ONE] - fi_double[layer]
        if step * _uniform(_mixed(low, high)) + fi_double[layer] < np.exp(-0.5 * x * x):
            return x, low, high


@compiled
def _fill(places: NDArray[np.int64], blocks: tuple[Array, ...]) -> None:
    for r in range(len(places)):
        low, high, low_odd, high_odd = _words(places[r])  # type: ignore[call-arg]
        for number in range(len(blocks)):
            row = blocks[number][r]
            if number % 2:
                for i in range(len(row)):
                    row[i], low, high = _normal(low, high, low_odd, high_odd)
            else:
                for i in range(len(row)):
                    low, high = _stepped(low, high, low_odd, high_odd)  # type: ignore[call-arg]
                    row[i] = _uniform(_mixed(low, high))
        _put(places[r], low, high)  # type: ignore[call-arg]
