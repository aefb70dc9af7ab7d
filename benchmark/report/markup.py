"""HTML and SVG out of nested calls: what goes in as text is escaped, what comes out is well-formed."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Any


class Markup(str):
    """Text that is markup already and is not escaped again."""


EMPTY = Markup("")
_VOID = {"br", "link", "meta", "circle", "line", "path", "rect", "polyline", "polygon"}


def tag(name: str, /, *children: Any, **attributes: Any) -> Markup:
    """An element.

    Args:
        name: of the element.
        *children: texts, ``Markup`` or iterables of both; None is left out.
        **attributes: underscores become hyphens, a leading one is dropped (``_class``); None and False are left out.
    """
    words = [name]
    for key, value in attributes.items():
        if value is not None and value is not False:
            text = number(value) if isinstance(value, float) else str(value)
            words.append(f'{key.removeprefix("_").replace("_", "-")}="{escape(text)}"')
    inner = join(children)
    if not inner and name in _VOID:
        return Markup(f"<{' '.join(words)}/>")
    return Markup(f"<{' '.join(words)}>{inner}</{name}>")


def join(children: Iterable[Any]) -> Markup:
    """Children one after the other, texts escaped."""
    parts: list[str] = []
    for child in children:
        if child is None:
            continue
        if isinstance(child, Markup):
            parts.append(child)
        elif isinstance(child, str):
            parts.append(escape(child, quote=False))
        elif isinstance(child, Iterable):
            parts.append(join(child))
        else:
            parts.append(escape(str(child), quote=False))
    return Markup("".join(parts))


def number(value: float, digits: int = 2) -> str:
    """A coordinate without needless zeros."""
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text in ("", "-0") else text
