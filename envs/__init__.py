"""Gymnasium environments: one folder a task, and what all tasks share."""

from .safflower.spec import PICKING
from .sorting.spec import SORTING
from .task import TaskSpec, env_ids, load_plugins, register_policy, register_task, task, tasks
from .transplanting.spec import TRANSPLANTING
from .weeding.spec import HOE_WEEDING, LASER_WEEDING, LASER_WEEDING_SPEED

__all__ = ["TaskSpec", "env_ids", "register", "register_policy", "register_task", "task", "tasks"]


def register() -> None:
    """Register the package's own tasks, then what installed packages announce; again changes nothing."""
    for spec in (PICKING, TRANSPLANTING, LASER_WEEDING, LASER_WEEDING_SPEED, HOE_WEEDING, SORTING):
        register_task(spec)
    load_plugins(search=True)
