"""What the Gymnasium environments of all weeders share."""

from __future__ import annotations

from typing import Any

from ..single import TaskEnv
from .core import WeederOutcome
from .state import WeederPlan


class WeedingEnv(TaskEnv[WeederPlan, WeederOutcome]):
    """One strip of field under a tool; the environments of the tools say what can be passed."""

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Carry out one decision; with a camera, the plant that is worked on is marked, its aim perhaps corrected.

        Raises:
            ValueError: the action is no integer of the action space.
        """
        if self._sensing:
            view = self.view
            assert hasattr(view, "attend")
            view.attend(self._checked(action))  # type: ignore[attr-defined]
        return super().step(action)
