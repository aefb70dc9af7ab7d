"""Gymnasium environments for task-level control of agricultural parallel robots."""
