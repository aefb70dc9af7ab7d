"""Pictures for people of every world of a batch, as Gymnasium's own batches give them."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from .asked import AskedByName
from .assembly import Assembly, choice
from .cameras import Cameras
from .pixels import Shown
from .screen import checked_shot


class Pictured(AskedByName):
    """A batch with ``render``: a view a world, made when somebody looks first.

    Attributes:
        cameras: which see for the rules or draw observations; their views then show people the same worlds.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": ["rgb_array"]}  # noqa: RUF012
    cameras: Cameras | None

    def __init__(self, parts: Assembly[Any], render_mode: str | None, asked: tuple[Any, Any, Any]):
        """Look at nothing yet.

        Args:
            parts: of the task.
            render_mode: of the batch.
            asked: camera, width and height, see ``TaskEnv``.

        Raises:
            ValueError: a mode, a camera or a size that there is not.
        """
        super().__init__()
        if render_mode is not None:
            choice("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode, self._shot = render_mode, checked_shot(parts, *asked)
        self._album: Cameras | None = None

    def drawer(self, shown: Shown) -> Cameras:
        """The worlds' views."""
        raise NotImplementedError

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:  # type: ignore[override]
        """A picture (h, w, 3) of every world's present state with ``render_mode="rgb_array"``, else None.

        Raises:
            gymnasium.error.ResetNeeded: a world was not reset yet.
            gymnasium.error.ClosedEnvironmentError: after ``close``.
        """
        self._refuse_unready()
        if self.render_mode is None:
            return None
        if self._album is None:
            self._album = self.cameras or self.drawer(Shown())
            for view in self._album.views:
                view.shot = self._shot
        return tuple(view.frame() for view in self._album.views)

    def _refuse_unready(self) -> None:
        raise NotImplementedError

    def _close_pictures(self) -> None:
        """Free what cameras and views hold; idempotent."""
        for views in {id(each): each for each in (self.cameras, self._album) if each is not None}.values():
            views.close()
