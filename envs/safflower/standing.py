"""How the picker's cart stands at its stops on ground that is no plane, and where that puts the tool.

At a stop the frame is the plane that fits its four wheels best: it heaves, pitches and rolls against the ground under
the row, on which the plants stand. Nothing measures that; the arm works as if the frame stood level. What the ground is
like is ``rough``'s. The stands are those of the field, and are drawn from numbers of their own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled
from ..core import Array
from ..drives import settled
from ..field import FieldError
from ..rough import STEP_M, heights_of, summed_up, waves_of
from ..shaking import Frame, Shape, U, at_line, carried, frame_at
from .batch import stop_centres
from .config import SafflowerConfig
from .field import Stands

_JUMPS = 2
"""So far ahead of a field's own numbers; those of its drives lie one jump ahead."""


def draw_stands(config: SafflowerConfig, generators: Sequence[np.random.Generator]) -> Array | None:
    """How carts stand at their stops (R, S, 3), as ``Stands``, from numbers far ahead; None on a plane.

    Nothing is taken from the generators: what else they draw is the same on any ground.
    """
    ground, stops = config.scenario.ground, stop_centres(config.scenario)
    if not ground.rough:
        return None
    before = 0.5 * ground.wheel_base_m + ground.footprint_m
    first = float(stops[0]) - before
    rows = math.ceil((float(stops[-1]) + before - first) / STEP_M) + 1
    waves = waves_of(ground, first, rows)
    shape = Shape(first, STEP_M, ground.wheel_base_m, ground.track_m, ground.footprint_m, ground.pivot_m, 0.0, 0.0, 0.0)
    surface = np.zeros((len(generators), rows, len(U)))
    for row, generator in enumerate(generators):
        ahead = generator.bit_generator.jumped(_JUMPS)  # type: ignore[attr-defined]
        luck = np.random.Generator(ahead).standard_normal((len(waves.mix), 3, 2))
        surface[row, :, : U.right + 1] = heights_of(waves, luck)
    summed_up(surface)
    stands = np.empty((len(generators), len(stops), 3))
    for row in range(len(generators)):
        _stand(surface[row], shape, stops, stands[row])
    return stands


def whole_stands(config: SafflowerConfig, given: Stands | None, generator: np.random.Generator) -> Stands | None:
    """The stands of a field that was given; drawn where it says nothing, none on a plane.

    Raises:
        FieldError: they are those of a row with other stops.
    """
    drawn = draw_stands(config, [generator])
    if drawn is None:
        return None
    if given is None or not len(given):
        return Stands(*drawn[0].T.copy())
    if len(given) != drawn.shape[1]:
        raise FieldError(f"{len(given)} rows: this row has {drawn.shape[1]} stops, give a row each", "stands", 0)
    return given


def stand_error(config: SafflowerConfig, stands: Array, stop: NDArray[np.int64], tool: Array) -> Array:
    """What a tool at (cart, u, v), (B, 3), is off by against the plants because of how its frame stands, (B, 3).

    Args:
        config: the task's numbers.
        stands: (B, S, 3), as ``Stands``.
        stop: (B,), where the cart stands.
        tool: where it was sent.
    """
    off, machine, scenario = np.empty(tool.shape), config.machine.picker, config.scenario
    _offsets(stands, stop, scenario.ground.pivot_m, 0.5 * machine.five_bar.base_m, scenario.motor_height_m, tool, off)
    return settled(off)


@compiled
def _stand(surface: Array, shape: Shape, stops_m: Array, stands: Array) -> None:
    for i in range(len(stops_m)):
        frame = frame_at(surface, shape, stops_m[i])
        stands[i, 0] = frame.heave_m - at_line(surface, shape, U.middle, stops_m[i])
        stands[i, 1], stands[i, 2] = frame.pitch_rad, frame.roll_rad


@compiled
def _offsets(
    stands: Array, stop: NDArray[np.int64], pivot_m: float, half_m: float, high_m: float, tool: Array, off: Array
) -> None:
    for w in range(len(stop)):
        heave, pitch, roll = stands[w, stop[w], 0], stands[w, stop[w], 1], stands[w, stop[w], 2]
        across, up = tool[w, 1] - half_m, tool[w, 2] + high_m
        x, y, z = carried(Frame(heave, pitch, roll, 0.0, 0.0), pivot_m, 0.0, 0.0, across, up)
        off[w, 0], off[w, 1], off[w, 2] = x, y - across, z - up
