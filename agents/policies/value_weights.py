"""The form of what a sorting planner with a learned value has learned: plain arrays; see ``sorting_value``."""

from __future__ import annotations

FORMAT = "fieldgym-sorting-value-1"
GAINS, ARRIVALS, LEFT, ENDS = 12, 4, 8, 5
"""Weights of an item's expected reward, numbers of the arrivals, knots of the time left and of the time to the end."""
PAIRS = LEFT * (LEFT + 1) // 2 + LEFT * LEFT
VALUE = 2 * LEFT + PAIRS + ENDS + 4
"""Features of a belt."""
SHAPES = {"gain": (GAINS,), "arrivals": (ARRIVALS,), "value": (VALUE,)}
