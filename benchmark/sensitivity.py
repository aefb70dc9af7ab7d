"""One assumption at a time: how far each moves a task's headline figures, on the same seeds with the same luck."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..kernels.files import appendable, read_file
from ..kernels.seeds import SHOWN
from .assumptions.declared import Dossier, End, Yardstick
from .rates import WORK
from .statistics import Difference, Estimate, mean, paired_difference
from .store import MOST_BYTES, source_digest
from .trials import trial

FIGURES = ("net_rate", "cycle_time_s", "return", WORK)
"""Scores that are compared."""
EPISODES = 200
Values = Mapping[str, list[float]]


class Effect(NamedTuple):
    """What one end of a parameter does.

    Attributes:
        name: of the parameter.
        end: ``"low"`` or ``"high"``.
        means: of ``FIGURES`` at that end.
        differences: to the task as it is, paired by seed.
    """

    name: str
    end: str
    means: Mapping[str, Estimate]
    differences: Mapping[str, Difference]


class Study(NamedTuple):
    """A task as it is, and what every end of every parameter does to it.

    Attributes:
        base: means of ``FIGURES`` and of the yardsticks' scores.
        effects: in the order of the assumptions.
        episodes: of each mean.
    """

    base: Mapping[str, Estimate]
    effects: tuple[Effect, ...]
    episodes: int


def study(
    dossier: Dossier, episodes: int, kept: Path | None = None, on_trial: Callable[[str], None] = lambda what: None
) -> Study:
    """Play the task's reference on its headline scenario, as it is and with one end of a parameter at a time.

    Args:
        dossier: what to vary.
        episodes: so many shown seeds.
        kept: file of what was played; what stands there from this state of the code is not played again.
        on_trial: told before each trial what is played.

    Raises:
        OSError: ``kept`` is no file, or cannot be read or written.
    """
    seeds = SHOWN.take(episodes)
    wanted = tuple(dict.fromkeys((*FIGURES, *(item.score for item in dossier.yardsticks))))
    shelf, source = _Shelf(kept), source_digest()

    def played(what: str, end: End | None) -> Values:
        # An end is told by its words and numbers; eyes are told by their words alone.
        told = [source, dossier.env_id, episodes, what, *([end.text, end.numbers] if end else []), wanted]
        mark = hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:16]
        found: Values | None = shelf.get(mark, wanted, episodes)
        if found is None:
            on_trial(what)
            scores = trial(dossier.env_id, seeds, end.numbers if end else None, end.eyes if end else None)
            found = {name: [float(value) for value in scores[name]] for name in wanted}
            shelf.put(mark, found)
        return found

    base = played("as it is", None)
    effects = []
    for item in dossier.assumptions:
        for name, end in item.ends.items():
            values = played(f"{item.name}: {name}", end)
            means = {figure: mean(values[figure]) for figure in FIGURES}
            apart = {figure: paired_difference(values[figure], base[figure]) for figure in FIGURES}
            effects.append(Effect(item.name, name, means, apart))
    return Study({name: mean(values) for name, values in base.items()}, tuple(effects), episodes)


class _Shelf:
    """Values of trials in a file of JSON lines, NaN as null; a line that a stop cut off or that holds none is left out.

    Raises:
        OSError: the file is none, or cannot be read or written.
    """

    def __init__(self, path: Path | None):
        self._path, self._found = path, dict[str, dict[str, list[float]]]()
        if path is None:
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        appendable(path)
        for line in read_file(path, MOST_BYTES).splitlines() if path.exists() else ():
            try:
                held = json.loads(line)
                mark = held.pop("trial")
                values = {str(name): [np.nan if x is None else float(x) for x in row] for name, row in held.items()}
                self._found[str(mark)] = values
            except (ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError, RecursionError):
                continue

    def get(self, mark: str, wanted: Collection[str], episodes: int) -> Values | None:
        """What was kept of a trial, where it is all that is wanted."""
        held = self._found.get(mark, {})
        return held if all(len(held.get(name, ())) == episodes for name in wanted) else None

    def put(self, mark: str, values: Values) -> None:
        held = {name: [None if np.isnan(x) else x for x in row] for name, row in values.items()}
        if self._path is not None:
            with self._path.open("a", encoding="utf-8") as lines:
                lines.write("\n" + json.dumps({"trial": mark, **held}))


def beside(yardstick: Yardstick, base: Mapping[str, Any]) -> Estimate:
    """Our figure of a yardstick in its unit."""
    own = base[yardstick.score]
    scale = yardstick.scale
    return Estimate(scale * own.value, scale * own.low, scale * own.high, own.n)
