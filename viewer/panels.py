"""What a page says beside its scene, as HTML: score, rewards, phases, decisions. Pure functions of what was noted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import cv2
import numpy as np
from numpy.typing import NDArray

from ..envs.belief import Belief
from .marks import BELIEVED, CHOSEN, PICKED, TRUE
from .reel import Look
from .seat import Entry

INK, DIM, LINE = "#1c2530", "#66717d", "#e3e7eb"
PHASE_COLOURS = ("#4c78a8", "#f2a541", "#54a24b", "#b279a2", "#e45756", "#72b7b2", "#9d755d", "#bab0ac")
SHOWN_SCORES = ("net_rate", "cycle_time_s", "throughput_per_min", "duration_s", "done", "missed", "damaged", "illegal")
_WORDS = {
    "net_rate": "net rate",
    "cycle_time_s": "cycle time",
    "throughput_per_min": "a minute",
    "duration_s": "time",
}
_STRIP_ENTRIES = 12


def boxed(inner: str) -> str:
    """What is said, in the page's letters."""
    return f'<div style="padding:2px 12px 6px;font:13px/1.45 system-ui,sans-serif;color:{INK}">{inner}</div>'


def head(task: str, scenario: str, seed: str, state: str) -> str:
    """What is played, and how it stands."""
    return boxed(
        f'<div style="font-weight:600;font-size:15px">{escape(task)}</div>'
        f'<div style="color:{DIM}">{escape(scenario)}, {escape(seed)}</div>'
        f'<div style="margin-top:2px">{escape(state)}</div>'
    )


def figure(name: str, value: float | None) -> str:
    """A number of the scorecard as it is read."""
    if value is None or value != value or abs(value) == float("inf"):
        return "-"
    if name == "net_rate" or name.endswith("_percent"):
        return f"{100.0 * value:.1f} %" if name == "net_rate" else f"{value:.1f} %"
    if name == "throughput_per_min":
        return f"{value:.1f}"
    if name.endswith("_s"):
        return f"{value:.2f} s" if value < 100.0 else f"{value:.0f} s"
    return f"{value:.0f}" if value == round(value) else f"{value:.3g}"


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table, its first column to the left; texts may hold HTML."""
    cell = f"padding:2px 0 2px 10px;text-align:right;border-bottom:1px solid {LINE}"
    left = f"padding:2px 0;text-align:left;border-bottom:1px solid {LINE}"
    out = ['<table style="border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums">']
    if any(columns):
        out.append("<tr>")
        for k, column in enumerate(columns):
            out.append(f'<th style="{cell if k else left};color:{DIM};font-weight:500">{column}</th>')
        out.append("</tr>")
    for row in rows:
        out.append("<tr>" + "".join(f'<td style="{cell if k else left}">{text}</td>' for k, text in enumerate(row)))
        out.append("</tr>")
    return "".join([*out, "</table>"])


def scores(names: Sequence[str], scorecards: Sequence[Mapping[str, float]], bound: Mapping[str, float] | None) -> str:
    """Scorecards side by side, and beside them what no policy can beat."""
    columns = ["", *(escape(name) for name in names), *(["bound"] if bound is not None else [])]
    rows = []
    for name in SHOWN_SCORES:
        if name not in scorecards[0]:
            continue
        row = [_WORDS.get(name, name), *(figure(name, card.get(name)) for card in scorecards)]
        rows.append([*row, figure(name, bound.get(name))] if bound is not None else row)
    return boxed(table(columns, rows))


def rewards(names: Sequence[str], logs: Sequence[Sequence[Entry]]) -> str:
    """What the terms of the reward have come to."""
    terms = list(logs[0][0].rewards) if logs and logs[0] else []
    sums = [[sum(entry.rewards[term] for entry in log) for log in logs] for term in terms]
    rows = [[escape(term), *(f"{value:+.3f}" for value in values)] for term, values in zip(terms, sums, strict=True)]
    total = [sum(entry.reward for entry in log) for log in logs]
    rows.append(["<b>return</b>", *(f"<b>{value:+.3f}</b>" for value in total)])
    return boxed(table(["reward", *(escape(name) for name in names)], rows))


def strip(log: Sequence[Entry]) -> str:
    """The phases of the last decisions, each a bar on one scale of seconds."""
    last = list(log)[-_STRIP_ENTRIES:]
    if not last:
        return boxed(f'<span style="color:{DIM}">no decision yet</span>')
    phases = list(last[0].phases_s)
    colours = {phase: PHASE_COLOURS[k % len(PHASE_COLOURS)] for k, phase in enumerate(phases)}
    longest = max(sum(entry.phases_s.values()) for entry in last) or 1.0
    used = [phase for phase in phases if any(entry.phases_s[phase] for entry in last)]
    key = " ".join(
        f'<span style="white-space:nowrap"><span style="display:inline-block;width:9px;height:9px;'
        f'background:{colours[phase]};margin-right:3px"></span>{escape(phase)}</span>'
        for phase in used
    )
    bars = []
    for entry in last:
        parts = "".join(
            f'<span style="display:inline-block;height:9px;width:{88.0 * seconds / longest:.2f}%;'
            f'background:{colours[phase]}" title="{escape(phase)} {seconds:.2f} s"></span>'
            for phase, seconds in entry.phases_s.items()
            if seconds > 0.0
        )
        total = sum(entry.phases_s.values())
        bars.append(
            f'<div style="display:flex;align-items:center;height:13px;line-height:0">{parts}'
            f'<span style="font-size:10px;line-height:13px;color:{DIM};padding-left:4px">{total:.2f}</span></div>'
        )
    return boxed(f'<div style="font-size:11px;color:{DIM};margin-bottom:3px">{key} (s)</div>{"".join(bars)}')


def decisions(log: Sequence[Entry], count: int = 12) -> str:
    """The last decisions, the newest first."""
    if not log:
        return boxed(f'<span style="color:{DIM}">no decision yet</span>')
    rows = []
    for entry in list(log)[: -count - 1 : -1]:
        hand = "✋ " if entry.by_hand else ""
        text = f'<span style="color:{DIM}">{entry.began_s:.1f} s</span> {hand}{escape(entry.text)}'
        rows.append([text, f"{entry.reward:+.2f}"])
    return boxed(table(["", ""], rows))


def course(logs: Sequence[Sequence[Entry]], end_s: float, points: int = 120) -> tuple[list[float], list[list[float]]]:
    """Net rates over time: the times, and a row a log."""
    from bisect import bisect_right

    times = [end_s * k / (points - 1) for k in range(points)]
    rows = []
    for log in logs:
        ends = [entry.ended_s for entry in log]
        values = [0.0, *(entry.scorecard["net_rate"] for entry in log)]
        rows.append([values[bisect_right(ends, time)] for time in times])
    return times, rows


def features(rows: Sequence[tuple[str, str, str]]) -> str:
    """What policies are shown of a candidate."""
    return boxed(
        table(
            ["feature", "value"],
            [
                [f'{escape(name)} <span style="color:{DIM};font-size:11px">{escape(doc)}</span>', escape(value)]
                for name, value, doc in rows
            ],
        )
    )


def opinions(rows: Sequence[tuple[str, str, str]]) -> str:
    """What each policy would do, and how sure it is."""
    return boxed(
        table(["policy", "would do"], [[escape(n), f"{escape(what)} {escape(sure)}"] for n, what, sure in rows])
    )


def key() -> str:
    """What the marks in the scene mean."""
    words = (
        (BELIEVED, "believed"),
        (CHOSEN, "the policy's choice"),
        (PICKED, "yours"),
        *zip(TRUE.values(), ("true", "done", "lost"), strict=True),
    )
    return boxed(
        " ".join(
            '<span style="white-space:nowrap"><span style="display:inline-block;width:9px;height:9px;'
            f'border-radius:5px;border:1px solid #999;background:rgb{colour};margin-right:3px"></span>{word}</span>'
            for colour, word in words
        )
    )


def replay(
    title: str,
    names: Sequence[str],
    scorecards: Sequence[Mapping[str, float]],
    logs: Sequence[Sequence[Entry]],
    bound: Mapping[str, float] | None,
) -> str:
    """What stands beside a replay: what was played, the last scorecards, and every decision."""
    out = [title, scores(names, scorecards, bound), rewards(names, logs)]
    for name, log in zip(names, logs, strict=True):
        out.append(
            f'<details style="padding:0 12px 6px;font:13px system-ui,sans-serif"><summary>{escape(name)}: {len(log)} '
            f"decisions</summary>{decisions(log[::-1], len(log))}</details>"
        )
    return (
        '<details open id="fieldgym" style="position:fixed;top:12px;left:12px;z-index:9;width:min(320px,84vw);'
        "max-height:70vh;overflow:auto;background:rgba(255,255,255,.94);border-radius:4px;padding:4px 0;"
        'box-shadow:0 1px 8px rgba(0,0,0,.2)"><summary style="padding:2px 12px;font:12px system-ui,sans-serif;'
        f'color:{DIM}">score and decisions</summary>{"".join(out)}</details>'
        '<script>if(innerWidth<700)document.getElementById("fieldgym").open=false</script>'
    )


def seen(look: Look, belief: Belief | None) -> NDArray[np.uint8]:
    """A camera's picture with circles where candidates are believed to be."""
    picture = look.frame.rgb.copy()
    if belief is None:
        return picture
    intrinsics, world_from_camera = look.frame.camera
    places = belief.slot_m[np.isfinite(belief.slot_m).all(axis=1)]
    rays = (places - world_from_camera[:3, 3]) @ world_from_camera[:3, :3]
    for x, y, z in rays.tolist():
        if z > 0.05:
            u, v = intrinsics[0, 0] * x / z + intrinsics[0, 2], intrinsics[1, 1] * y / z + intrinsics[1, 2]
            radius = max(4.0, intrinsics[0, 0] * belief.size_m / z)
            if abs(u) < 1e4 and abs(v) < 1e4:
                cv2.circle(picture, (round(u), round(v)), round(radius), BELIEVED, 2, cv2.LINE_AA)
    return picture
