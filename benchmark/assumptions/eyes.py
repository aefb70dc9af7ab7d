"""Changes of the perception models: worse and better eyes than the fitted ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..trials import Eyes

_COPIES = 8
"""Of each measured sighting, each with an error of its own."""
_ALONG, _ACROSS = 2, 3
"""Where a weeder's sighting tells the place that its tool camera corrects to."""


def with_numbers(**numbers: Any) -> Eyes:
    """Other numbers of the model."""
    return lambda model: replace(model, **numbers)


def aiming(sigma_m: float, added: bool = False) -> Eyes:
    """A tool camera with a Gaussian error of ``sigma_m`` an axis, or with that ``added`` to the measured one."""

    def changed(model: Any) -> Any:
        generator = np.random.default_rng(0)
        classes = []
        for rows in model.sightings:
            table = np.repeat(np.array(rows), _COPIES, axis=0)
            error = sigma_m * generator.standard_normal((len(table), 2))
            table[:, [_ALONG, _ACROSS]] = error + (table[:, [_ALONG, _ACROSS]] if added else 0.0)
            classes.append(tuple(tuple(row) for row in table.tolist()))
        return replace(model, sightings=tuple(classes))

    return changed


def tracking(added_m: float) -> Eyes:
    """Tracks that are worse by a Gaussian error an axis, as on a frame that tilts; the tool camera sees as before."""

    def changed(model: Any) -> Any:
        generator = np.random.default_rng(0)
        classes = []
        for rows in model.sightings:
            table = np.repeat(np.array(rows), _COPIES, axis=0)
            table[:, :2] += added_m * generator.standard_normal((len(table), 2))
            classes.append(tuple(tuple(row) for row in table.tolist()))
        return replace(model, sightings=tuple(classes))

    return changed


def scaled(name: str, factor: float, most: float = np.inf) -> Eyes:
    """All numbers of one part of the model times ``factor``, none above ``most``."""

    def changed(model: Any) -> Any:
        return replace(model, **{name: _times(getattr(model, name), factor, most)})

    return changed


def _times(value: Any, factor: float, most: float) -> Any:
    if isinstance(value, tuple):
        return tuple(_times(item, factor, most) for item in value)
    return min(value * factor, most)


def mixed(name: str, share: float) -> Eyes:
    """A confusion matrix of which a ``share`` is spread evenly over all reports."""

    def changed(model: Any) -> Any:
        table = np.array(getattr(model, name))
        table = (1.0 - share) * table + share / table.shape[1]
        return replace(model, **{name: tuple(tuple(row) for row in table.tolist())})

    return changed


def both(*eyes: Callable[[Any], Any]) -> Eyes:
    """One change after the other."""

    def changed(model: Any) -> Any:
        for each in eyes:
            model = each(model)
        return model

    return changed
