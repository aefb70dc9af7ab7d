"""What the change log says of an environment."""

from __future__ import annotations

import re

from fieldgym.envs.task import TaskSpec

_WORDS = {
    "SafflowerPicking": ("picker", "safflower", "picking"),
    "TrayTransplanting": ("transplant", "tray", "seedling"),
    "LaserWeeding": ("laser", "weeder", "weeding"),
    "LaserWeedingSpeed": ("laser", "weeder", "weeding"),
    "HoeWeeding": ("hoe", "weeding"),
    "ProduceSorting": ("sorter", "sorting"),
}
"""What the change log calls each environment, beside its id."""


def of(spec: TaskSpec, changelog: str) -> str:
    """The entries that name an environment, by release, as Markdown; links lose their targets.

    Args:
        spec: of the environment.
        changelog: the text of ``CHANGELOG.md``.
    """
    name = spec.name.rpartition("-v")[0]
    words = (name, *_WORDS.get(name, ()))
    text = [
        f"`{spec.id}` is the version that stands: a change of an environment's behaviour gets a new number, which "
        "its results carry. What the [release notes](../changelog.md) say of it:\n"
    ]
    for release in re.split(r"^## ", changelog, flags=re.M)[1:]:
        entries = [" ".join(entry.split()) for entry in re.findall(r"^- (.+(?:\n  .+)*)", release, re.M)]
        kept = [entry for entry in entries if any(re.search(rf"\b{word}", entry, re.I) for word in words)]
        if kept:
            text += [f"### {release.splitlines()[0]}\n", *(f"- {_unlinked(entry)}" for entry in kept), ""]
    return "\n".join(text)


def _unlinked(entry: str) -> str:
    return re.sub(r"\[([^\]]+)\]\([^)]+\)", r"\1", entry)
