"""NumPy's own random numbers of many generators in one call, bit for bit, while Python is let go of.

A generator of NumPy's hands out a block in one call, and holds up every other thread before and after it. Here PCG64,
which ``np.random.default_rng`` and Gymnasium make, is stepped where its state lies: numbers and the state that is left
are those of NumPy's ``random`` and ``standard_normal``, in a third of the time.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba.core import config, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from .binding import bind
from .compiling import compiled
from .ziggurat import normals, uniforms

Array = NDArray[np.float64]

_MULTIPLIER = (2549297995355413924 << 64) + 4865540595714422341
"""Of PCG64's steps."""
_ONE, _ROTATION, _WORD = np.uint64(1), np.uint64(58), np.uint64(63)


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


class Pcg(NamedTuple):
    """State of PCG64 and its increment, each as its lower and its upper half."""

    low: Any
    high: Any
    low_odd: Any
    high_odd: Any


@compiled
def stepped(state: Pcg) -> Any:
    """See ``ziggurat``."""
    low, high = _stepped(state.low, state.high, state.low_odd, state.high_odd)  # type: ignore[call-arg]
    turn, folded = high >> _ROTATION, low ^ high
    bits = (folded >> turn) | (folded << ((~turn + _ONE) & _WORD))
    return bits, Pcg(low, high, state.low_odd, state.high_odd)


bind(Pcg, stepped)


@compiled
def _fill(places: NDArray[np.int64], blocks: tuple[Array, ...]) -> None:
    for r in range(len(places)):
        low, high, low_odd, high_odd = _words(places[r])  # type: ignore[call-arg]
        state = Pcg(low, high, low_odd, high_odd)
        for number in range(len(blocks)):
            state = normals(state, blocks[number][r]) if number % 2 else uniforms(state, blocks[number][r])
        _put(places[r], state.low, state.high)  # type: ignore[call-arg]
