"""Sums whose last digit does not depend on the Python that adds them up."""

from __future__ import annotations

from collections.abc import Iterable


def in_order(numbers: Iterable[float]) -> float:
    """The sum from left to right, rounded after each number; Python's ``sum`` of floats is another one since 3.12."""
    total = 0.0
    for number in numbers:
        total += number
    return total
