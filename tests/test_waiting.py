"""Tests wait for what has to happen, and for nothing else."""

import re
import time
from pathlib import Path

import pytest
from waiting import over_and_over, soon, until

TESTS = Path(__file__).parent


def test_no_test_waits_for_a_fixed_time() -> None:
    """Too short on a slow machine, too long on every other one: ``waiting.py`` waits for a condition.

    No wait are 0 s, which let others go on, and 600 s: a case that hangs until what is tested ends it.
    """
    naps = re.compile(r"\bsleep\((?!0\)|600\.0\))|\bwait_for_timeout\(")
    found = {path.name for path in TESTS.glob("*.py") if naps.search(path.read_text("utf-8"))}
    assert found == {"waiting.py"}


def test_waiting_ends_with_what_is_waited_for() -> None:
    asked: list[int] = []
    until(lambda: asked.append(1) or len(asked) == 3)
    assert len(asked) == 3
    assert not soon(lambda: False, 0.0)
    with pytest.raises(AssertionError, match="no bus came"):
        until(lambda: False, "no bus came", patience_s=0.0)


def test_what_does_not_work_at_once_is_done_again() -> None:
    done: list[float] = []
    over_and_over(lambda: done.append(time.monotonic()), lambda: len(done) == 3, "never", again_s=0.0)
    assert len(done) == 3
