"""The reproduction: verdicts follow from numbers, the report is complete, the five-bars' chapters are sound."""

import json
import math
from dataclasses import replace
from importlib.util import find_spec

import pytest
from typer.testing import CliRunner

from fieldgym.papers import Chapter, Figure, Verdict, identified, lost, number, report, statement, undeterminable
from fieldgym.scripts import reproduce


def test_a_number_is_reproduced_within_its_tolerance_only():
    assert number("a", 1.00, 1.004, 0.005, "m").verdict is Verdict.REPRODUCED
    assert number("a", 1.00, 0.9951, 0.005, "m").verdict is Verdict.REPRODUCED
    assert number("a", 1.00, 1.006, 0.005, "m").verdict is Verdict.REFUTED
    assert number("a", 1.00, 1.006, 0.005, "m").deviation == pytest.approx(0.006)


def test_a_correction_counts_only_where_it_helps():
    corrected = number("a", 1.00, 57.3, 0.005, "m", corrected=1.001, why="radians")
    assert corrected.verdict is Verdict.REPRODUCED_WITH_CORRECTION
    assert corrected.deviation == pytest.approx(0.001)
    assert number("a", 1.00, 57.3, 0.005, "m", corrected=1.1).verdict is Verdict.REFUTED
    needless = number("a", 1.00, 1.0, 0.005, "m", corrected=57.3)
    assert needless.verdict is Verdict.REPRODUCED and needless.deviation == 0.0


@pytest.mark.parametrize("bad", [{"computed": math.nan}, {"corrected": math.inf}, {"tolerance": -1.0}])
def test_numbers_that_are_none_are_refused(bad):
    with pytest.raises(ValueError, match="finite"):
        number(**{"item": "a", "published": 1.0, "computed": 1.0, "tolerance": 0.1, "unit": "m", **bad})


def test_statements_take_their_verdict_from_the_test():
    assert statement("a", "claim", True, "why").verdict is Verdict.REPRODUCED
    assert statement("a", "claim", False, "why").verdict is Verdict.REFUTED
    assert statement("a", "claim", False, "why", corrected=True).verdict is Verdict.REPRODUCED_WITH_CORRECTION
    assert statement("a", "claim", False, "why", corrected=False).verdict is Verdict.REFUTED
    assert statement("a", "claim", True, "why", corrected=True).verdict is Verdict.REPRODUCED


def test_what_is_determined_cannot_be_called_undeterminable():
    found = undeterminable("a", "not printed", "why", alternatives=[1.0, 2.0], tolerance=0.5, unit="m")
    assert found.verdict is Verdict.NOT_DETERMINABLE and found.computed == "1 to 2"
    with pytest.raises(ValueError, match=r"agree within 0\.5"):
        undeterminable("a", 1.0, "why", alternatives=[1.0, 1.4], tolerance=0.5)


def test_what_was_fitted_or_lost_is_never_called_reproduced():
    fitted = identified("a", 16.0, "16.0 s", "why", unit="s")
    assert fitted.verdict is Verdict.IDENTIFIED and fitted.deviation is None and fitted.tolerance is None
    assert lost("a", "a formula", "why").verdict is Verdict.NOT_DETERMINABLE


def small_chapter() -> Chapter:
    def draw(canvas):
        canvas.subplots().plot([0.0, 1.0], [0.0, 2.0])

    findings = [
        number(
            "Table 1 | first", 0.1750, 0.003054, 5e-5, "mm", corrected=0.17500000001, why="radians <b>not</b> degrees"
        ),
        statement("Section 2", "no holes", False, "two holes"),
        undeterminable("Fig. 3", "not printed", "flat", alternatives=[330.0, 370.0], tolerance=5.0, unit="mm"),
        identified("Abstract", 16.0, "16.01 s", "fitted", unit="s"),
    ]
    return Chapter("safflower", "Small chapter", "Nobody: Nothing.", findings, [Figure("line", "A line & more.", draw)])


def test_the_report_writes_everything_and_the_same_again(tmp_path, monkeypatch):
    monkeypatch.setattr(report, "load", lambda key: replace(small_chapter(), key=key))
    done = []
    for out in (tmp_path / "one", tmp_path / "two"):
        report.reproduce(["safflower", "laser"], out, processes=1, on_done=lambda result: done.append(result.key))
    assert done == ["safflower", "laser"] * 2
    names = sorted(path.relative_to(tmp_path / "one").as_posix() for path in (tmp_path / "one").rglob("*.*"))
    assert names == [
        *(
            "figures/laser-line.png",
            "figures/laser-line.svg",
            "figures/safflower-line.png",
            "figures/safflower-line.svg",
        ),
        *("findings.json", "index.html", "index.md"),
    ]
    for name in names:
        first, second = ((tmp_path / folder / name).read_bytes() for folder in ("one", "two"))
        if name != "findings.json":  # which holds the seconds that it took
            assert first == second, name


def test_the_pages_show_every_finding_and_figure(tmp_path, monkeypatch):
    monkeypatch.setattr(report, "load", lambda key: small_chapter())
    report.reproduce(["safflower"], tmp_path, processes=1)
    page, text = (tmp_path / "index.html").read_text(), (tmp_path / "index.md").read_text()
    for words in ("0.17500 mm", "0.00305 mm", "330 to 370 mm", "not printed", "reproduced with correction", "no holes"):
        assert words in page and words in text, words
    assert "radians &lt;b&gt;not&lt;/b&gt; degrees" in page and "A line &amp; more." in page
    assert page.count("<figure") == 1 and 'src="figures/safflower-line.svg"' in page
    assert "Table 1 \\| first" in text and "![A line & more.](figures/safflower-line.png)" in text
    widths = {
        line.replace("\\|", "").count("|")
        for line in text.splitlines()
        if line.startswith("| ") and "Small" not in line
    }
    assert widths == {len(report.COLUMNS) + 1, len(Verdict) + 2}


def test_the_command_prints_tables_or_json_and_leaves_with_zero(tmp_path, monkeypatch):
    import typer

    monkeypatch.setattr(report, "load", lambda key: small_chapter())
    app = typer.Typer()
    app.command()(reproduce.main)
    table = CliRunner().invoke(app, ["safflower", "--out", str(tmp_path)])
    assert table.exit_code == 0 and "Small chapter" in table.output and "index.html" in table.output.replace("\n", "")
    printed = CliRunner().invoke(app, ["safflower", "--out", str(tmp_path), "--json"])
    assert printed.exit_code == 0
    chapters = json.loads(printed.stdout)
    assert [finding["verdict"] for finding in chapters[0]["findings"]] == [
        *("reproduced with correction", "refuted", "not determinable", "identified")
    ]


def test_every_chapter_has_a_module_and_unknown_ones_are_named(tmp_path):
    for key in report.CHAPTERS:
        assert find_spec(f"fieldgym.papers.{key}") is not None
    with pytest.raises(ValueError, match="'weeds' is unknown: choose from laser, prrs, safflower, transplanting"):
        report.reproduce(["weeds"], tmp_path)
