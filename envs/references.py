"""Code by name, loaded when it is used: nobody waits for PyBullet, OpenCV or PyTorch who does not need them."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any


def resolved(reference: Any) -> Any:
    """The object that ``"package.module:name"`` stands for; what is no text stands for itself."""
    if not isinstance(reference, str):
        return reference
    module, _, name = reference.partition(":")
    found: Any = import_module(module)
    for part in name.split("."):
        found = getattr(found, part)
    return found


def later(reference: str) -> Callable[..., Any]:
    """The function or class that a reference stands for, loaded at its first call."""
    return lambda *parts: resolved(reference)(*parts)
