"""What weeders have in common is tried with the laser's; the others try it once a night."""

from typing import Any

import pytest

_AGAIN = ("fieldgym/LaserWeedingSpeed-v0", "fieldgym/HoeWeeding-v0")


def at_night(env_id: str) -> list[Any]:
    """Marks of a test with this id."""
    return [pytest.mark.slow, pytest.mark.long] * (env_id in _AGAIN)
