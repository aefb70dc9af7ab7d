"""Checked configurations: what they take, what they refuse, and that the refusal says what to do."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan

import pytest

from fieldgym.kernels.config import Config, ConfigError, num


@dataclass(frozen=True)
class Process(Config):
    """One field of the safflower picker."""

    locate_s: float = num(7.304, 0.0, 600.0, "s", "Locating one head [identified: 16 s per head].")


def test_the_refusal_names_field_value_range_and_unit() -> None:
    with pytest.raises(ConfigError) as caught:
        Process(locate_s=nan)
    assert str(caught.value) == "Process.locate_s = nan: give a number in [0, 600] s"
