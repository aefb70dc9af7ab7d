"""What the report draws: colours, curves, columns, ticks and labels, each from numbers alone."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldgym.benchmark.report import episodes, gantt, page, svg
from fieldgym.benchmark.report.markup import Markup, tag
from fieldgym.benchmark.report.styles import phase_kinds, policy_styles
from fieldgym.benchmark.report.timeline import CURVE_POINTS, TimelineRecorder


def test_policies_that_meet_look_different():
    groups = [["random", "first", *"abcdefgh"], ["random", "first", "c", "x", "learned"]]
    styles = policy_styles(groups, ["first"])
    for group in groups:
        looks = [(styles[name].colour, styles[name].shape) for name in group]
        assert len(set(looks)) == len(looks)
    assert styles["first"].colour == "ink" and styles["learned"].colour == "orange"


def test_every_task_phase_has_a_kind_and_every_kind_a_colour():
    css = (Path(page.__file__).parent / "page.css").read_text()
    for phases in (("travel", "carry", "handle", "index", "wait"), ("new", "newer", "wait")):
        kinds = phase_kinds(phases)
        assert len(set(kinds.values())) == len(phases)
        assert all(css.count(f"--p-{kind}:") == 2 and f"--t-{kind}:" in css for kind in kinds.values())


def test_curve_holds_the_rate_after_each_decision():
    recorder = TimelineRecorder()
    for end, rate in ((10.0, 0.25), (20.0, 0.5), (40.0, 1.0)):
        card = {"net_rate": rate, "done": 1, "damaged": 0, "duration_s": end}
        recorder.add({"phases_s": {"work": 10.0}, "scorecard": card})
    curve = recorder.curve()
    assert len(curve) == CURVE_POINTS
    assert [curve[i] for i in (0, 7, 8, 15, 16, 31, 32)] == [0.0, 0.0, 0.25, 0.25, 0.5, 0.5, 1.0]
    assert TimelineRecorder().curve() == []


def test_mean_curve_keeps_the_last_value_of_a_shorter_episode():
    short = {"scorecard": {"duration_s": 10.0}, "curve": [0.0, 0.5]}
    long = {"scorecard": {"duration_s": 20.0}, "curve": [0.0, 1.0]}
    found = episodes.mean_curve([short, long])
    assert found is not None
    assert found.rate[-1] == pytest.approx(0.75)
    assert np.interp(10.0, found.time_s, found.rate) == pytest.approx(0.5, abs=0.01)
    assert found.end_s == 15.0 and found.episodes == 2


@settings(deadline=None)
@given(
    milliseconds=st.lists(st.lists(st.integers(0, 9000), min_size=2, max_size=2), min_size=1, max_size=12),
    width_s=st.floats(0.1, 7.0),
    began_s=st.floats(0.0, 3.0),
)
def test_columns_hold_every_second_once(milliseconds: list[list[int]], width_s: float, began_s: float):
    seconds = [[0.001 * number for number in row] for row in milliseconds]
    value = {"phases": ["a", "b"], "seconds": seconds, "began_s": began_s}
    found = episodes.parse_timeline("x", 0, value)
    if found is None:
        assert not any(map(any, milliseconds))
        return
    shares = gantt.binned(found, width_s)
    assert shares.sum(axis=0) * width_s == pytest.approx(found.seconds.sum(axis=0), abs=1e-6)
    assert shares.min() >= -1e-9 and shares.sum(axis=1).max() <= 1.0 + 1e-9


@settings(deadline=None)
@given(low=st.floats(-1e3, 1e3), span=st.floats(1e-3, 1e4), count=st.integers(3, 10), tight=st.booleans())
def test_ticks_are_round_and_inside(low: float, span: float, count: int, tight: bool):
    x = svg.axis(low, low + span, 0.0, 100.0, count, tight)
    assert len(x.ticks) <= 2 * count + 3
    assert all(x.low - 1e-6 * span <= tick <= x.high + 1e-6 * span for tick in x.ticks)
    assert x(x.low) == pytest.approx(0.0) and x(x.high) == pytest.approx(100.0)
    assert len({x.label(tick) for tick in x.ticks}) == len(x.ticks)


def test_labels_keep_off_each_other():
    anchors = [(100.0 + 3.0 * i, 100.0, f"policy-{i}") for i in range(5)]
    taken = [svg.Box(x - 8, y - 8, 16, 16) for x, y, _ in anchors]
    placed = svg.place_labels(anchors, taken, svg.Box(0, 0, 400, 300))
    boxes = [svg.Box(x, y - 11.0, svg.text_width(text), 14.0) for x, y, text, _ in placed]
    overlaps = [a.overlap(b) for i, a in enumerate(boxes) for b in boxes[i + 1 :]]
    assert sum(overlaps) < 30.0


def test_markup_escapes_texts_and_attributes():
    assert tag("b", "<&>", title='"x" & y') == '<b title="&quot;x&quot; &amp; y">&lt;&amp;&gt;</b>'
    assert tag("p", Markup("<i/>"), None, ["a", 1]) == "<p><i/>a1</p>"
    assert tag("rect", x=1.50, y=-0.001, _class=None) == '<rect x="1.5" y="0"/>'
