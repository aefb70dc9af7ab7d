"""Replays for a report: of each policy the first minute of the episode that its Gantt chart shows, a page each."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fieldgym.scripts.view import seat_of

if TYPE_CHECKING:
    from fieldgym.benchmark.report.reader import Study, Tier
    from fieldgym.viewer.play import Play

SECONDS = 60.0
"""Of a replay, simulated."""


def write(study: Study, page: Path, tell: Callable[[str], None]) -> dict[str, dict[str, str]]:
    """Write the replays beside a report's page.

    Args:
        study: whose headline tiers are shown.
        page: of the report; replays go into a folder of its name.
        tell: is told what was written, and what could not be.

    Returns:
        By environment and policy, where the report finds them.

    Raises:
        OSError: one could not be written.
    """
    from fieldgym.viewer.record import record

    folder = page.with_name(f"{page.stem}-replays")
    found: dict[str, dict[str, str]] = {}
    for chapter in study.chapters:
        for policy, play in plays(chapter.headline).items():
            path = folder / f"{_plain(chapter.task.name)}-{_plain(policy)}.html"
            folder.mkdir(parents=True, exist_ok=True)
            try:
                record(path, play, seat_of, SECONDS)
            except (ValueError, ImportError) as error:
                tell(f"No replay of {policy} in {chapter.task.id}: {error}")
                continue
            found.setdefault(chapter.task.id, {})[policy] = f"{folder.name}/{path.name}"
            tell(f"Replay: {path} ({path.stat().st_size / 1e6:.2f} MB)")
    return found


def plays(tier: Tier) -> Mapping[str, Play]:
    """What is replayed of a tier, by policy: the episodes of the Gantt chart."""
    from fieldgym.viewer.play import Play

    condition = tier.condition
    settings: dict[str, Any] = {"backend": condition.backend, **condition.settings}
    shown = {}
    for policy, timeline in tier.timelines.items():
        drawn = isinstance(timeline.field, int)
        field = None if drawn else str(Path(condition.fields) / str(timeline.field))
        seed = int(timeline.field) if drawn else 0
        shown[policy] = Play(condition.env_id, policy, seed=seed, settings=settings, field=field)
    return shown


def _plain(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-")
