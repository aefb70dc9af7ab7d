"""One colour and one marker a policy, everywhere on the page; one colour a kind of phase.

The colours lie in ``page.css`` as variables, each for a light and for a dark page. They were chosen so that any two
differ by at least 0.1 in OKLab for normal sight, protanopia, deuteranopia and tritanopia; markers and labels say the
same again.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

HUES = ("blue", "green", "sky", "purple", "wine", "olive")
"""Variables ``--c-<name>`` that policies without a role of their own take turns in."""

SHAPES = ("right", "square", "diamond", "up", "down", "cross")
ROLES = {"random": "grey", "learned": "orange", "bound": "bound"}

_PHASES = {
    "carrier": ("drive", "index"),
    "travel": ("travel", "approach", "move"),
    "carry": ("carry",),
    "down": ("descend", "lower", "plunge"),
    "up": ("lift", "raise"),
    "settle": ("settle",),
    "sense": ("recognise", "correct", "look"),
    "work": ("shear", "burn", "grip", "handle", "stir", "cut"),
    "after": ("suck", "release"),
    "wait": ("wait",),
    "pause": ("pause",),
}
_OF_PHASE = {phase: kind for kind, phases in _PHASES.items() for phase in phases}


@dataclass(frozen=True)
class Style:
    """How a policy looks: a colour variable without its ``--c-``, and the shape of its marker."""

    colour: str
    shape: str

    @property
    def css(self) -> str:
        """The colour as CSS."""
        return f"var(--c-{self.colour})"


def policy_styles(groups: Iterable[Sequence[str]], references: Iterable[str]) -> dict[str, Style]:
    """A style for every policy; no two that meet in a group share one, as long as there are enough.

    Args:
        groups: policies that appear together, a sequence an environment.
        references: the papers' own orders; each is drawn in ink.
    """
    groups, inked = [list(group) for group in groups], set(references)
    meets: dict[str, set[str]] = {}
    for group in groups:
        for name in group:
            meets.setdefault(name, set()).update(group)
    count = {name: sum(name in group for group in groups) for name in meets}
    place = {name: i for i, name in enumerate(meets)}
    styles: dict[str, Style] = {}
    for name in sorted(meets, key=lambda item: (-count[item], place[item])):
        if name in ROLES or name in inked:
            styles[name] = Style(ROLES.get(name, "ink"), "star" if name == "learned" else "circle")
            continue
        taken = {styles[other] for other in meets[name] if other in styles}
        choices = [Style(hue, SHAPES[(i + turn) % len(SHAPES)]) for turn in range(6) for i, hue in enumerate(HUES)]
        hues = {style.colour for style in taken}
        free = [style for style in choices if style.colour not in hues] or [s for s in choices if s not in taken]
        styles[name] = (free or choices)[0]
    return {name: styles[name] for name in meets}


def phase_kinds(phases: Sequence[str]) -> Mapping[str, str]:
    """Kind of each phase, for ``var(--p-<kind>)``: blue moves, orange works, violet sees, grey waits.

    A phase that is new here takes a kind that is free.
    """
    free = [kind for kind in _PHASES if kind not in {_OF_PHASE.get(name) for name in phases}]
    return {name: _OF_PHASE.get(name) or (free.pop(0) if free else "settle") for name in phases}
