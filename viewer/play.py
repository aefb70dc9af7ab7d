"""What a viewer plays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Play:
    """What is played.

    Attributes:
        env_id: the task.
        policy: who decides.
        against: who decides on the same field beside it; empty for nobody.
        seed: of the field and its luck.
        settings: keywords of ``gymnasium.make``: scenario, backend, perception, overrides.
        field: a field or its file that is played instead of the seed's.
    """

    env_id: str
    policy: str
    against: str = ""
    seed: int = 0
    settings: dict[str, Any] = field(default_factory=dict)
    field: Any = None
