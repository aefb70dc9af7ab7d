"""Replays beside a report: the episode of the Gantt chart, a page a policy, linked from the report."""

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fieldgym.benchmark.report import page, reader
from fieldgym.scripts import cli, replays
from fieldgym.viewer import panels

HOE = "fieldgym/HoeWeeding-v0"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two policies on two seeds."""
    out = tmp_path_factory.mktemp("results")
    words = ["benchmark", "--env", "HoeWeeding", "--policies", "fifo,edf", "--episodes", "2", "--backend", "analytic"]
    words += ["--set", "scenario.strip_m=1.5", "--jobs", "1", "--out", str(out)]
    done = CliRunner().invoke(cli.app, words)
    assert done.exit_code == 0, done.output
    return next(out.rglob("episodes.jsonl")).parent


def test_what_is_replayed_is_the_gantt_chart_s_episode(results: Path):
    tier = reader.load(results).chapters[0].headline
    plays = replays.plays(tier)
    assert list(plays) == list(tier.timelines) == ["fifo", "edf"]
    for policy, play in plays.items():
        assert (play.env_id, play.policy, play.seed) == (HOE, policy, tier.timelines[policy].field)
        assert play.settings["backend"] == "analytic" and play.settings["overrides"]["scenario.strip_m"] == 1.5


def test_links_stand_beside_the_chart_and_nowhere_without_replays(results: Path):
    study = reader.load(results)
    assert "Watch it" not in page.render(study, "x")
    html = page.render(study, "x", {HOE: {"fifo": "report-replays/HoeWeeding-v0-fifo.html"}})
    assert html.index("second by second") < html.index("Watch it") < html.index("Decision by decision")
    assert re.findall(r'<a href="(report-replays/[^"]+)">fifo</a>', html) == ["report-replays/HoeWeeding-v0-fifo.html"]


@pytest.mark.slow
def test_the_command_writes_a_page_a_policy(results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("viser", reason="the view extra is not installed")
    monkeypatch.setattr(replays, "SECONDS", 1000.0)
    done = CliRunner().invoke(cli.app, ["report", str(results), "--out", str(tmp_path / "page.html"), "--replays"])
    assert done.exit_code == 0, done.output
    html = (tmp_path / "page.html").read_text("utf-8")
    links = re.findall(r'href="(page-replays/[^"]+)"', html)
    assert links == [f"page-replays/HoeWeeding-v0-{policy}.html" for policy in ("fifo", "edf")]
    tier = reader.load(results).chapters[0].headline
    records = map(json.loads, (results / "episodes.jsonl").read_text("utf-8").splitlines())
    cards = {(record["policy"], record["seed"]): record["scorecard"] for record in records}
    for link, (policy, timeline) in zip(links, tier.timelines.items(), strict=True):
        text = (tmp_path / link).read_text("utf-8")
        assert f"{policy}: {len(timeline.seconds)} decisions" in text
        # The whole episode was played: it ends where the benchmark's did.
        card = cards[policy, timeline.field]
        for name in ("net_rate", "cycle_time_s", "duration_s"):
            assert f">{panels.figure(name, card[name])}</td>" in text, name
