"""What no policy can beat on the field that is played."""

from __future__ import annotations

from ..bounds import instance
from ..envs.task import task
from .play import Play


def bound_of(play: Play) -> dict[str, float] | None:
    """Parts of a scorecard that no policy can better, by name; None where nobody knows them."""
    if task(play.env_id).bound is None:
        return None
    try:
        found = instance(play.env_id, play.seed, field=play.field, carried_out=False, **play.settings).bound()
    except ValueError:  # a bound may know less than the task: what it cannot do is not shown
        return None
    return {"net_rate": found.net_rate, "cycle_time_s": found.cycle_time_s}
