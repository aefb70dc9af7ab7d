"""What a task of one's own is made of, in one place: see ``docs/your-machine.md`` and ``examples/strawberry``."""

from .envs.assembly import Assembly
from .envs.core import COMMON_SCORES, Executor, NominalExecutor, StepResult, TaskCore, View, observation_space
from .envs.field import Array, Field, FieldError, Flags, Table, Toy, Whole, flag, label, number, whole
from .envs.single import TaskEnv
from .envs.task import TaskSpec, register_policy, register_task
from .envs.vector import TaskVectorEnv
from .kernels.config import Config, ConfigError, choice, nested, num, text
from .kernels.config import flag as switch

__all__ = [
    "COMMON_SCORES",
    "Array",
    "Assembly",
    "Config",
    "ConfigError",
    "Executor",
    "Field",
    "FieldError",
    "Flags",
    "NominalExecutor",
    "StepResult",
    "Table",
    "TaskCore",
    "TaskEnv",
    "TaskSpec",
    "TaskVectorEnv",
    "Toy",
    "View",
    "Whole",
    "choice",
    "flag",
    "label",
    "nested",
    "num",
    "number",
    "observation_space",
    "register_policy",
    "register_task",
    "switch",
    "text",
    "whole",
]
