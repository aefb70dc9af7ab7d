"""Bounds in expectation: no schedule's means are above them on any field, and no policy's results on average."""
