"""Gymnasium environments for task-level control of agricultural parallel robots.

Importing the package registers its environments:

    import fieldgym, gymnasium
    env = gymnasium.make("fieldgym/SafflowerPicking-v0", scenario="pots")
"""

from fieldgym.envs import TaskSpec, env_ids, register, register_policy, register_task, task, tasks

__version__ = "0.1.0"
__all__ = ["TaskSpec", "__version__", "env_ids", "register_policy", "register_task", "task", "tasks"]

register()
