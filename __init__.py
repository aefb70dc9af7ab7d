"""Gymnasium environments for task-level control of agricultural parallel robots.

Importing the package registers its environments:

    import fieldgym, gymnasium
    env = gymnasium.make("fieldgym/SafflowerPicking-v0", scenario="pots")
"""

from fieldgym.envs import ENV_IDS, describe, register

__version__ = "0.1.0"
__all__ = ["ENV_IDS", "__version__", "describe"]

register()
