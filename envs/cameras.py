"""The cameras of a batch: a view for every world, all of them drawing the same meshes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from .core import TaskCore, View
from .pixels import Pixels, Shown

_ONE_ROW = np.zeros(1, np.int64)


class Played(NamedTuple):
    """What leads back to where a world stands: nothing else does, for a view remembers its pictures.

    Attributes:
        begun: the state of the generator that its field was drawn from, or the field.
        decisions: those that were taken since.
    """

    begun: Any
    decisions: tuple[int, ...] = ()


class Cameras:
    """Looks for every world of a batch of rules; each world sees what it would see alone.

    Attributes:
        senses: whether the rules take the views' reports.
        views: of the worlds, in their order.
        played: of the worlds, likewise.
    """

    def __init__(self, core: TaskCore[Any, Any], make_view: Callable[[Any], View[Any]], senses: bool, shown: Shown):
        """Make the views; meshes are made once.

        Args:
            core: the rules.
            make_view: makes the view of one world.
            senses: whether the rules take the views' reports.
            shown: what observations hold.
        """
        self.senses = senses
        self._worlds = [core.world(row) for row in range(core.worlds)]
        first = make_view(self._worlds[0])
        self.views = [first, *(first.beside(world) for world in self._worlds[1:])]
        self.played = [Played(None)] * core.worlds
        self._pixels = Pixels(self.views, shown) if shown.draws else None

    @property
    def marks(self) -> NDArray[np.int64]:
        """See ``View.slot_marks``."""
        return self.views[0].slot_marks()

    def space(self, features: spaces.Dict) -> spaces.Dict:
        """The space of observations, from that of the features."""
        return self._pixels.space(features) if self._pixels else features

    def observe(self, features: dict[str, Any], rows: NDArray[np.bool_] | None) -> dict[str, Any]:
        """See ``Pixels.observe``."""
        return self._pixels.observe(features, rows) if self._pixels else features

    def begin(self, rows: NDArray[np.int64], begun: Sequence[Any]) -> None:
        """Look at new episodes, which began with these fields or states of generators."""
        if not self.senses:
            return
        for row, how in zip(rows.tolist(), begun, strict=True):
            self.played[row] = Played(how)
            self.views[row].sense()

    def attend(self, awake: NDArray[np.bool_], actions: NDArray[np.int64]) -> None:
        """Look at what the worlds ``awake`` (B,) are about to work on, if there is a camera for it; note decisions."""
        if not self.senses:
            return
        for row in np.flatnonzero(awake).tolist():
            action = int(actions[row])
            self.views[row].attend(action)
            self.played[row] = self.played[row]._replace(decisions=(*self.played[row].decisions, action))

    def sense(self, awake: NDArray[np.bool_]) -> None:
        """Hand the worlds ``awake`` (B,) their cameras' reports where a look is due."""
        if not self.senses:
            return
        for row in np.flatnonzero(awake).tolist():
            self.views[row].sense()

    def play_again(self, played: Sequence[Played]) -> None:
        """Bring worlds to where these decisions lead, with all that was seen on the way."""
        self.played = list(played)
        for world, view, (begun, decisions) in zip(self._worlds, self.views, played, strict=True):
            if begun is None:
                continue
            if isinstance(begun, Mapping):
                generator = np.random.Generator(np.random.PCG64())
                generator.bit_generator.state = begun
                world.reset_rows(_ONE_ROW, [generator])
            else:
                world.load(_ONE_ROW, world.stack([begun]))
            view.sense()
            for decision in decisions:
                view.attend(decision)
                plan = world.plan(np.array([decision]))
                world.apply(plan, world.nominal(plan))
                view.sense()

    def close(self) -> None:
        """Close the views; idempotent."""
        for view in self.views:
            view.close()
