"""Gymnasium environments: one folder a task, and what all tasks share."""

from .registry import ENV_IDS, TaskDescription, describe, register

__all__ = ["ENV_IDS", "TaskDescription", "describe", "register"]
