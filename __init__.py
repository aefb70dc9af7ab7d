"""Gymnasium environments for task-level control of agricultural parallel robots.

Importing the package registers its environments:

    import fieldgym, gymnasium
    env = gymnasium.make("fieldgym/SafflowerPicking-v0", scenario="pots")
"""

import os
import signal
import sys

if os.path.splitext(os.path.basename(sys.argv[0] if sys.argv else ""))[0] == "fieldgym":
    # The command is loading; until it can say "stopped" itself (scripts.common.execute), Ctrl-C just ends it.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)

from fieldgym.envs import TaskSpec, env_ids, register, register_policy, register_task, task, tasks

__version__ = "0.1.0"
__all__ = ["TaskSpec", "__version__", "env_ids", "register_policy", "register_task", "task", "tasks"]

register()
