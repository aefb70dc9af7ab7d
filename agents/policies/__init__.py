"""Scripted, planning and learned policies: what chooses the next target, one file a task."""
