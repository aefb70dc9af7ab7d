"""The page "what is assumed and what it does": a chart and three tables a task, out of its study."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from ..envs.task import task
from ..kernels.seeds import SHOWN
from .assumptions.declared import SURE, Dossier
from .rates import WORK, rates_of
from .report.sections import name_of
from .sensitivity import Effect, Study, beside
from .statistics import Difference, Estimate
from .suites import Condition
from .tables import escaped
from .tornado import ordered

_INTRODUCTION = """# What is assumed, and what it does

Every number of a task says where it comes from: *published*, *identified* or *assumed*. Here each that a source or
common sense would let be another is set to the ends of its range, one at a time, on the same {episodes} fields with
the same luck ({first} to {last}), the task's reference policy on its headline scenario, the camera's model, analytic
backend. Charts and tables show by how much the mean moves, with 95 % intervals of the paired differences; of the
chart's two bars the upper is the first value, the lower the last. What a source supports stands in scenarios and in
presets, `overrides={{"preset": "commercial"}}` or `--set preset=commercial`; the scenarios that were there keep their
figures.

Made by `{command}`. How sure a source is: {sure}.
"""


def page(parts: Sequence[tuple[Dossier, Study]], charts: str, command: str) -> str:
    """The page as Markdown.

    Args:
        parts: tasks with their studies.
        charts: folder of the charts, as the page names it.
        command: how it was made.
    """
    episodes = max(study.episodes for _, study in parts)
    sure = ", ".join(f"{letter} {words}" for letter, words in SURE.items())
    said = {"first": SHOWN.first, "last": SHOWN.first + episodes - 1, "sure": sure}
    lines = [_INTRODUCTION.format(episodes=episodes, command=command, **said)]
    for dossier, study in parts:
        lines += [*_chapter(dossier, study, charts), ""]
    return "\n".join(lines).rstrip() + "\n"


def chart_name(dossier: Dossier) -> str:
    """File name of a task's chart."""
    return f"{dossier.env_id.rpartition('/')[2].rpartition('-v')[0]}.svg"


def _chapter(dossier: Dossier, study: Study, charts: str) -> list[str]:
    spec = task(dossier.env_id)
    base, unit = study.base, rates_of(Condition(spec.id, spec.headline, "analytic", "model")).unit
    rate, cycle = _told(base["net_rate"], 100.0, 2), _told(base["cycle_time_s"], 1.0, 2)
    earned, work = _told(base["return"], 1.0, 2), _told(base[WORK], 1.0, _digits(unit))
    now = f"As it is: net rate {rate} %, cycle time {cycle} s, return {earned}, {work} {unit} an hour "
    now += f"(`{spec.reference}`, `{spec.headline}`)."
    name = name_of(dossier.env_id)
    lines = [f"## {name}", "", now, "", f"![Tornado chart of {name}]({charts}/{chart_name(dossier)})", ""]
    lines += [*_beside(dossier, study), "", *_effects(dossier, study, unit), "", *_sources(dossier), ""]
    return [*lines, *(f"- {escaped(sentence)}" for sentence in dossier.untested)]


def _beside(dossier: Dossier, study: Study) -> list[str]:
    lines = ["| beside the field | ours | practice | reading |", "|---|--:|---|---|"]
    for item in dossier.yardsticks:
        own = beside(item, study.base)
        digits = 3 if abs(own.value) < 0.1 else 2 if abs(own.value) < 10.0 else 1
        cells = (item.what, f"{_told(own, 1.0, digits)} {item.unit}", item.field, item.reading)
        lines.append(_row(cells))
    return lines


def _effects(dossier: Dossier, study: Study, unit: str) -> list[str]:
    heads = ("assumption", "now", "instead", "net rate, points", "cycle time, s", "return", f"{unit} an hour")
    lines = [_row(heads), "|---|---|---" + "|--:" * 4 + "|"]
    found = {(effect.name, effect.end): effect for effect in study.effects}
    for item in ordered(dossier, study.effects):
        for i, (name, end) in enumerate(item.ends.items()):
            cells = (item.name, item.now) if i == 0 else ("", "")
            lines.append(_row((*cells, end.text, *_moved(found[item.name, name], unit))))
    return lines


def _moved(effect: Effect, unit: str) -> Iterable[str]:
    for name, scale, digits in (("net_rate", 100.0, 2), ("cycle_time_s", 1.0, 3), ("return", 1.0, 2)):
        yield _difference(effect.differences[name], scale, digits)
    yield _difference(effect.differences[WORK], 1.0, _digits(unit))


def _sources(dossier: Dossier) -> list[str]:
    lines = ["| assumption | who says what | sure | what is done |", "|---|---|---|---|"]
    return [*lines, *(_row((item.name, item.source, item.sure, item.kept)) for item in dossier.assumptions)]


def _row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(_shown(cell) for cell in cells) + " |"


def _shown(cell: str) -> str:
    """A cell's text: what stands between backticks stays code."""
    parts = cell.split("`")
    return "`".join(part if i % 2 else _outside(part) for i, part in enumerate(parts))


def _outside(part: str) -> str:
    """Text beside code, with the spaces at its ends."""
    word = part.strip()
    return part.replace(word, escaped(word)) if word else part


def _digits(unit: str) -> int:
    return 4 if unit == "ha" else 1


def _told(item: Estimate, scale: float, digits: int) -> str:
    if not math.isfinite(item.low):
        return f"{scale * item.value:.{digits}f}"
    return f"{scale * item.value:.{digits}f} ({scale * item.low:.{digits}f} .. {scale * item.high:.{digits}f})"


def _difference(item: Difference, scale: float, digits: int) -> str:
    if not math.isfinite(item.value):
        return "-"
    value, low, high = (round(scale * part, digits) + 0.0 for part in (item.value, item.low, item.high))
    if value == low == high == 0.0:
        return "0"
    return f"{value:+.{digits}f} ({low:.{digits}f} .. {high:.{digits}f})"
