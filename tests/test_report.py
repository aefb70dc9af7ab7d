"""The benchmark's page and leaderboard: whole, self-contained, and with the figures of the tables."""

import importlib
import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from html import escape
from pathlib import Path

import numpy as np
import pytest
from element_tree import Tree
from typer.testing import CliRunner

from fieldgym.benchmark import ranking
from fieldgym.benchmark.record import Record
from fieldgym.benchmark.report import episodes, grids, leaderboard, overall, page, reader, sections
from fieldgym.benchmark.report.timeline import TimelineRecorder
from fieldgym.benchmark.store import BOUNDS, EPISODES, MANIFEST, ResultsError
from fieldgym.benchmark.suites import BOUND, Condition
from fieldgym.benchmark.tables import MARKDOWN
from fieldgym.scripts import cli

POTS = Condition("fieldgym/SafflowerPicking-v0", "pots", "analytic", "model")
PHYSICS = Condition("fieldgym/SafflowerPicking-v0", "pots", "pybullet", "model")
SEEN = Condition("fieldgym/SafflowerPicking-v0", "pots", "analytic", "camera")
ROW = Condition("fieldgym/SafflowerPicking-v0", "row", "analytic", "model")
BELT = Condition("fieldgym/ProduceSorting-v0", "load-1.25", "analytic", "model")
POLICIES = {
    POTS: ("random", "fixed-order", "nearest", "learned"),
    PHYSICS: ("random", "fixed-order", "nearest", "learned"),
    SEEN: ("fixed-order",),
    ROW: ("fixed-order", "<b>&new"),
    BELT: ("fifo", "nearest", "receding-horizon"),
}
SEEDS = range(8)
PHYSICS_SEEDS = range(6)
PHASES = ("travel", "shear", "suck")


def timeline(rng: np.random.Generator, decisions: int = 6) -> dict:
    recorder = TimelineRecorder()
    elapsed = 1.0
    for i in range(decisions):
        spent = rng.uniform(0.5, 2.0, len(PHASES))
        elapsed += spent.sum()
        card = {"net_rate": (i + 1) / (decisions + 1), "done": i + 1, "damaged": i // 4, "duration_s": elapsed}
        recorder.add({"phases_s": dict(zip(PHASES, spent, strict=True)), "scorecard": card})
    words = [f"head {i}" for i in range(decisions)]
    return {"curve": recorder.curve(), "timeline": {"began_s": 1.0, "words": words, **recorder.timeline()}}


def record(condition: Condition, policy: str, seed: int) -> Record:
    """An episode with figures that its names decide."""
    rng = np.random.default_rng([seed, *map(len, (policy, *list(vars(condition).values())[1:4]))])
    told = timeline(rng)
    card = {
        "net_rate": 0.5 + 0.05 * len(policy) / 8 + rng.uniform(0.0, 0.2),
        "cycle_time_s": 10.0 + rng.uniform(0.0, 3.0),
        "throughput_per_min": 5.0 + rng.uniform(),
        "duration_s": 1.0 + float(np.sum(told["timeline"]["seconds"])),
        "done": 6.0,
        "damaged": float(seed % 2),
        **({"stop": 14.0} if condition.scenario == "pots" else {}),
        **{f"phase_{name}_s": float(rng.uniform(5.0, 9.0)) for name in PHASES},
    }
    if seed > 0:
        del told["timeline"]
    return {
        **{name: value for name, value in vars(condition).items() if value},
        "policy": policy,
        "seed": seed,
        "return": 3.0 + len(policy) + rng.uniform(),
        "rewards": {},
        "steps": 6,
        "terminated": True,
        "scorecard": card,
        "last_s": 20.0,
        "wall_s": 0.1,
        "decision_s": 0.012,
        "decision_p95_ms": 4.0,
        "decision_before_last_s": 0.01,
        **told,
    }


def bound(condition: Condition, seed: int) -> Record:
    values = {
        "net_rate": 0.9 + 0.01 * (seed % 3),
        "episode_return": 30.0,
        "method": "a relaxation",
        "proven": seed % 2 == 0,
        "gap": None,
        "curve": [[0.0, 6.0], [0.5, 7.5], [0.85, 9.0]],
    }
    told = {name: value for name, value in vars(condition).items() if value}
    return {**told, "policy": BOUND, "seed": seed, "bound": values, "wall_s": 0.2}


def write(folder: Path, records: list[Record], bounds: list[Record] = []) -> Path:  # noqa: B006
    folder.mkdir()
    (folder / EPISODES).write_text("".join(json.dumps(item) + "\n" for item in records))
    if bounds:
        (folder / BOUNDS).write_text("".join(json.dumps(item) + "\n" for item in bounds))
    manifest = {
        "suite": "full",
        "fieldgym": "9.8.7",
        "source": "0123abcd",
        "packages": {"numpy": "1.2.3", "absent": None},
        "machine": "Toy, 2 cores",
        "started": "2026-01-02T03:04:05+0000",
    }
    (folder / MANIFEST).write_text(json.dumps(manifest))
    return folder


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    records = [
        record(where, name, seed)
        for where, names in POLICIES.items()
        for seed in (PHYSICS_SEEDS if where in (PHYSICS, SEEN) else SEEDS)
        for name in names
    ]
    bounds = [bound(POTS, seed) for seed in SEEDS]
    return write(tmp_path_factory.mktemp("report") / "full", records, bounds)


@pytest.fixture(scope="module")
def study(results: Path) -> reader.Study:
    return reader.load(results)


@pytest.fixture(scope="module")
def html(study: reader.Study) -> str:
    return page.render(study, "fieldgym report x")


@pytest.fixture(scope="module")
def tree(html: str) -> Tree:
    found = Tree()
    found.feed(html)
    found.close()
    return found


def test_page_is_well_formed(tree: Tree, html: str):
    assert html.startswith("<!DOCTYPE html>")
    assert tree.open == []
    assert len(tree.ids) == len(set(tree.ids))
    drawings = re.findall(r"<svg.*?</svg>", html, flags=re.DOTALL)
    assert len(drawings) > 40
    for drawing in drawings:
        ElementTree.fromstring(drawing)
        assert "nan" not in drawing and "inf" not in drawing.replace("info", "")


def test_page_asks_the_network_for_nothing(tree: Tree, html: str):
    assert not re.search(r"https?:|//[a-z]+\.|@import|url\((?!#)|fetch\(|XMLHttpRequest", html)
    for name, attributes in tree.elements:
        assert name not in ("link", "img", "iframe", "object", "embed", "use")
        assert "src" not in attributes
        assert str(attributes.get("href", "#")).startswith("#")
    links = {str(attributes["href"])[1:] for name, attributes in tree.elements if name == "a"}
    assert links and links <= set(tree.ids)


def test_every_policy_has_a_chip_a_line_and_marks(study: reader.Study, tree: Tree):
    for item in study.chapters:
        section = sections.anchor(item.task.id)
        lines = [policy for where, policy, _ in tree.rows if where == section]
        assert set(item.headline.policies) <= set(lines)
    chips = [str(found["data-policy"]) for name, found in tree.elements if name == "button"]
    assert chips == [policy for item in study.chapters for policy in item.headline.policies]
    marks = {str(found["data-policy"]) for name, found in tree.elements if name == "g" and "data-policy" in found}
    assert set(chips) <= marks


def test_names_are_escaped(html: str):
    assert "<b>&new" not in html
    assert "&lt;b&gt;&amp;new" in html


def test_figures_are_those_of_the_tables(study: reader.Study, tree: Tree):
    for item in study.chapters:
        section = sections.anchor(item.task.id)
        for row in item.headline.all_rows:
            shown = next(values for where, policy, values in tree.rows if (where, policy) == (section, row.policy))
            columns = [column for _, columns in grids.TABLE for column in columns]
            there = [column for column in columns if any(column.cell(r)[0] != "-" for r in item.headline.all_rows)]
            wanted = [column.cell(row)[0].replace("-", "\u2212") for column in there]
            assert [value.replace("\u2013", "\u2212") for value in shown] == wanted


def test_intervals_and_doubt_stand_beside_the_figures(study: reader.Study, html: str):
    marked = 0
    for item in study.chapters:
        for row in item.headline.all_rows:
            for _, columns in [*grids.TABLE, *((title, cells) for title, cells in MARKDOWN if title != "Mean")]:
                for column in columns:
                    _, interval = column.cell(row)
                    span = re.sub(" (n.s.|few|Holm)$", "", interval)
                    assert span.replace(" .. ", " to ").replace("-", "\u2212") in html
                    if interval.endswith(" n.s."):
                        marked += 1
                        assert str(grids.cell(column, row)).startswith('<td class="doubtful"><em>n.s. </em>')
    assert marked > 0


def test_gaps_and_bound_are_told_where_there_are_bounds(study: reader.Study, html: str):
    pots, belt = (item.headline for item in study.chapters)
    assert pots.bound is not None and belt.bound is None
    assert pots.bound_words is not None and pots.bound_words.methods == ("a relaxation",)
    assert pots.bound_words.proven == 0.5
    assert "a relaxation" in html and "No bound is known for this tier" in html


def test_headline_is_the_headline_scenario_with_most_seeds(study: reader.Study):
    pots = study.chapters[0]
    assert pots.headline.condition == POTS
    assert [tier.condition for tier in pots.others] == [SEEN, PHYSICS, ROW]


def test_headline_is_the_simulated_one_when_seeds_are_as_many(tmp_path: Path):
    records = [record(where, "fixed-order", seed) for where in (POTS, PHYSICS) for seed in range(2)]
    assert reader.load(write(tmp_path / "tie", records)).chapters[0].headline.condition == PHYSICS


@pytest.mark.parametrize(("name", "first", "second"), [("driven", POTS, PHYSICS), ("seen", POTS, SEEN)])
def test_conditions_are_compared_by_paired_differences(study: reader.Study, name: str, first, second):
    pots, belt = study.chapters
    assert getattr(belt, name) is None
    compared = getattr(pots, name)
    assert (compared.first, compared.second, compared.pairs) == (first, second, len(PHYSICS_SEEDS))
    assert tuple(move.policy for move in compared.moves) == POLICIES[second]
    for move in compared.moves:
        pairs = [[record(where, move.policy, seed) for seed in PHYSICS_SEEDS] for where in (first, second)]
        rates = np.array([[each["scorecard"]["net_rate"] for each in side] for side in pairs])
        assert move.differences["net_rate"].value == pytest.approx(np.mean(rates[1] - rates[0]))
        assert move.means["net_rate"] == pytest.approx(tuple(rates.mean(axis=1)))


def test_page_and_leaderboard_show_cameras_beside_their_model(study: reader.Study, html: str):
    assert "From the analytic backend to PyBullet" in html
    assert html.count("Through the cameras") == 2  # a table of all tasks, and the one task's figure
    lines = leaderboard.render(study, "x").splitlines()
    start = lines.index("## Through the cameras")
    [line] = [line for line in lines[start:] if line.startswith("| Safflower picking")]
    seen = study.chapters[0].seen
    assert seen is not None
    [move] = seen.moves
    item, (_, mean) = move.differences["net_rate"], move.means["net_rate"]
    ends = f"{100.0 * item.low:.2f} .. {100.0 * item.high:.2f}"
    assert f"| fixed-order | 6 | {100.0 * mean:.2f} | {100.0 * item.value:+.2f}<br>{ends}" in line


def test_all_tasks_are_told_together(study: reader.Study, html: str):
    pots, belt = (item.headline for item in study.chapters)
    played = {"paper's order": "fixed-order", "best rule": "fixed-order", "learned": "learned"}
    assert overall.roles(pots) == played
    assert overall.roles(belt) == {"paper's order": "fifo", "best rule": "nearest", "best planner": "receding-horizon"}
    assert pots.most == {seed: 0.9 + 0.01 * (seed % 3) for seed in SEEDS} and not belt.most
    assert html.count("Performance profile over all tasks</b>") == html.count("Probability of improvement</b>") == 1
    rows = pots.row("learned"), belt.row("receding-horizon")
    wins = [row.wins["reference"].value for row in rows if row is not None]
    table = html.split("Probability of improvement</b>")[1].split("</table>")[0]
    shares = re.findall(r"<td><span>([\d.]+)</span><small>", table)
    assert f"{100.0 * wins[0]:.1f}" in shares and f"{100.0 * wins[1]:.1f}" in shares
    for item in study.chapters:
        for line in ranking.told(item.headline.rows):
            assert f"<li>{escape(line, quote=False)}</li>" in html


def test_stamp_says_where_it_comes_from(study: reader.Study, html: str):
    for text in (
        "9.8.7",
        "0123abcd",
        "0 to 7",
        "Toy, 2 cores",
        "2026-01-02 03:04:05",
        "numpy 1.2.3",
        "fieldgym report x",
    ):
        assert text in html
    assert "absent" not in html


def test_page_is_the_same_on_every_run(results: Path, html: str):
    code = (
        "import sys; from pathlib import Path; from fieldgym.benchmark.report import page, reader; "
        "sys.stdout.write(page.render(reader.load(Path(sys.argv[1])), 'fieldgym report x'))"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "7", "PYTHONUTF8": "1"}
    again = subprocess.run(
        [sys.executable, "-c", code, str(results)], capture_output=True, encoding="utf-8", env=environment, check=True
    )
    assert again.stdout == html


def test_what_was_not_recorded_is_left_out(tmp_path: Path):
    bare = []
    for seed in range(2):
        for policy in ("fixed-order", "nearest"):
            item = record(POTS, policy, seed)
            for name in ("curve", "timeline", "decision_p95_ms", "last_s", "decision_before_last_s"):
                item.pop(name, None)
            bare.append(item)
    study = reader.load(write(tmp_path / "old", bare))
    (tmp_path / "old" / MANIFEST).unlink()
    html = page.render(reader.load(tmp_path / "old"), "x")
    assert study.chapters[0].headline.curves == {} and study.chapters[0].headline.timelines == {}
    assert "One episode, second by second" not in html and "Net rate over the episode" not in html
    assert "Net rate against cycle time" in html
    Tree().feed(html)


@pytest.mark.parametrize("value", [None, 3, {}, {"phases": ["a"], "seconds": [[1.0, 2.0, 3.0]], "done": [1]}])
def test_a_timeline_of_another_make_is_no_timeline(value: object):
    assert episodes.parse_timeline("x", 0, value) is None


def test_unfinished_results_say_so(tmp_path: Path):
    records = [record(POTS, policy, seed) for seed in range(4) for policy in ("fixed-order", "nearest")][:-1]
    html = page.render(reader.load(write(tmp_path / "part", records)), "x")
    assert "3 to 4 paired episodes a policy, seeds 0 to 3" in html


def test_a_policy_that_finishes_nothing_is_shown_without_a_cycle(tmp_path: Path):
    records = [record(POTS, policy, seed) for policy in ("fixed-order", "nearest") for seed in range(3)]
    for item in records:
        if item["policy"] == "nearest":
            item["scorecard"].update(net_rate=0.0, cycle_time_s=0.0, done=0.0)
    html = page.render(reader.load(write(tmp_path / "idle", records)), "x")
    Tree().feed(html)
    assert "nan" not in re.sub(r"<(script|style).*?</\1>", "", html, flags=re.DOTALL)


def test_leaderboard_ranks_by_return_and_has_the_tables_figures(study: reader.Study):
    text = leaderboard.render(study, "fieldgym report x --out y")
    for item in study.chapters:
        part = text.split(f"## {sections.name_of(item.task.id)}\n")[1].split("\n## ")[0]
        part, _, field = part.partition("In the field:")
        unit = {"SafflowerPicking-v0": "m of row", "ProduceSorting-v0": "items"}[item.task.name]
        assert f"| {unit}/h |" in field
        lines = [line.split(" | ") for line in part.splitlines() if re.match(r"\| \d", line)]
        names = [line[1].strip("*") for line in lines]
        order = sorted(item.headline.rows, key=lambda row: -row.scores["return"].value)
        assert names == [row.policy for row in order]
        for line, row in zip(lines, order, strict=True):
            assert line[2].split("<br>")[0] == leaderboard.COLUMNS[0].cell(row)[0]
    assert "`fieldgym report x --out y`" in text and "Toy, 2 cores" in text
    tables = re.findall(r"(?:^\|.*\n)+", text, flags=re.MULTILINE)
    assert len(tables) == 2 * len(study.chapters) + 1  # scores and rates, and the cameras
    assert all(len({line.count("|") for line in table.splitlines()}) == 1 for table in tables)


def test_the_site_reads_the_scores_and_not_the_rates(
    study: reader.Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.syspath_prepend(str(Path(leaderboard.__file__).parents[2] / "docs"))
    page = tmp_path / "leaderboard.md"
    page.write_text(leaderboard.render(study, "x"))
    found = importlib.import_module("fieldsite.leaderboard").read(page)
    assert [len(board.rows) for board in found.boards.values()] == [
        len(item.headline.all_rows) for item in study.chapters
    ]


def test_command_writes_both_files(results: Path, tmp_path: Path):
    out, board = tmp_path / "deep" / "report.html", tmp_path / "docs" / "leaderboard.md"
    words = ["report", str(results), "--out", str(out), "--leaderboard", str(board)]
    done = CliRunner().invoke(cli.app, words)
    assert done.exit_code == 0, done.output
    assert out.read_text().startswith("<!DOCTYPE html>") and board.read_text().startswith("# Leaderboard")
    assert str(out) in done.output and not list(tmp_path.rglob("*.tmp"))


def test_command_says_what_is_wrong_in_a_line(tmp_path: Path):
    with pytest.raises(ResultsError, match="no results in"):
        reader.load(tmp_path)
    (tmp_path / EPISODES).write_text("")
    with pytest.raises(ResultsError, match="holds no finished episode"):
        reader.load(tmp_path)
    failed = CliRunner().invoke(cli.app, ["report", str(tmp_path / "nowhere")])
    assert "no results in" in str(failed.exception) and "\n" not in str(failed.exception)


def test_every_registered_policy_has_a_colour_of_its_own_among_those_that_it_is_compared_with(study: reader.Study):
    from fieldgym.agents import policy_names
    from fieldgym.envs import env_ids, task

    styles = page.styles_of(study)
    for env_id in (name for name in env_ids() if name.startswith("fieldgym/")):
        for scenario in (task(env_id).headline, *task(env_id).ordering):
            colours = [styles[name].colour for name in task(env_id).lineup(scenario, policy_names(env_id))]
            assert len(set(colours)) == len(colours), (env_id, scenario)
