"""What a test leaves behind is noticed, and what it registers is forgotten."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import leftovers
import numpy as np
import pytest

from fieldgym import env_ids, register_policy, register_task, task

ID = "fieldgym/HoeWeeding-v0"


def test_nothing_is_told_where_nothing_changed() -> None:
    assert leftovers.changed(leftovers.state(), leftovers.state()) == []


def test_every_test_is_looked_after(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """And fails where it leaves something changed."""
    assert {"_nothing_is_left_behind", "_restored_after_a_module"} <= set(request.fixturenames)
    definitions = request._fixturemanager.getfixturedefs("_nothing_is_left_behind", request.node)
    assert definitions
    monkeypatch.setenv("FIELDGYM_X", "0")
    watch: Any = definitions[-1].func()
    next(watch)
    monkeypatch.setenv("FIELDGYM_X", "1")
    with pytest.raises(AssertionError, match=r"the test leaves changed: \$FIELDGYM_X"):
        next(watch)


@pytest.mark.parametrize("name", ["the working folder", "NumPy's handling of errors", "$FIELDGYM_X"])
def test_what_is_left_is_named(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    monkeypatch.setenv("FIELDGYM_X", "0")
    before = leftovers.state()
    with np.errstate(all=None):
        if name == "the working folder":
            monkeypatch.chdir(tmp_path)
        elif name.startswith("$"):
            monkeypatch.setenv(name[1:], "1")
        else:
            np.seterr(divide="raise")
        assert leftovers.changed(before, leftovers.state()) == [name]


def test_what_the_package_adds_to_is_as_it_was(tmp_path: Path) -> None:
    ids, before, folders = env_ids(), dict(gym.registry), list(sys.path)
    with leftovers.restored():
        register_task(replace(task(ID), id="own/Field-v0"))
        register_policy(ID, "mine", "nothing:here")
        sys.path.append(str(tmp_path))
        assert "own/Field-v0" in env_ids() and "own/Field-v0" in gym.registry
    assert env_ids() == ids and gym.registry == before and sys.path == folders
    register_policy(ID, "mine", "something:else")
