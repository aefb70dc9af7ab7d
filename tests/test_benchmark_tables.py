"""What the tables say about episodes whose result is known."""

import csv
import io
import json
from pathlib import Path

import pytest

from fieldgym.benchmark import parts, suites, tables, thinking
from fieldgym.benchmark.record import Record
from fieldgym.benchmark.suites import BOUND, Case, Condition, Suite
from fieldgym.kernels.seeds import HELD_OUT

POTS = Condition("fieldgym/Stand-v0", "pots", "analytic", "model")
ROW = Condition("fieldgym/Stand-v0", "row", "analytic", "model")
CASES = (Case(POTS, ("swift", "plain"), "plain", (0, 1, 2)), Case(ROW, ("swift", "plain"), "plain", (0, 1, 2)))


def record(policy: str, seed: int, net_rate: float, cycle_time_s: float | None, condition: Condition = POTS) -> Record:
    return {
        "env_id": condition.env_id,
        "scenario": condition.scenario,
        "backend": condition.backend,
        "perception": condition.perception,
        "policy": policy,
        "seed": seed,
        "return": 10.0,
        "rewards": {},
        "steps": 10,
        "terminated": True,
        "scorecard": {"net_rate": net_rate, "cycle_time_s": cycle_time_s},
        "last_s": 90.0,
        "wall_s": 0.5,
        "decision_s": 0.02,
        "decision_p95_ms": 3.0,
        "decision_before_last_s": 0.018,
    }


def bound(seed: int, net_rate: float, episode_return: float, curve: list[list[float]]) -> Record:
    values = {"net_rate": net_rate, "episode_return": episode_return, "curve": curve}
    return {**vars(POTS), "policy": BOUND, "seed": seed, "bound": values, "wall_s": 0.1}


@pytest.fixture
def rows() -> list[tables.Row]:
    records = [record("plain", seed, 0.80 + 0.05 * seed, 16.0 + seed) for seed in range(3)]
    records += [record("swift", seed, 0.79 + 0.05 * seed, 14.0 + seed) for seed in range(3)]
    records += [record("plain", seed, 0.7, None, ROW) for seed in range(2)]
    records += [{**record("swift", 2, 0.0, 0.0), "error": "broken"}]
    return tables.summarise(reversed(records), CASES)


def test_rows_follow_the_suite_and_hold_the_means(rows: list[tables.Row]):
    assert [(row.condition.scenario, row.policy, row.episodes) for row in rows] == [
        ("pots", "swift", 3),
        ("pots", "plain", 3),
        ("row", "plain", 2),
    ]
    assert rows[0].scores["net_rate"].value == pytest.approx(0.84)
    assert rows[0].scores["decision_ms"].value == pytest.approx(2.0)
    assert rows[2].scores["cycle_time_s"].n == 0


def test_differences_are_paired_and_only_to_the_reference(rows: list[tables.Row]):
    faster = rows[0].differences["cycle_time_s"]
    assert (faster.value, faster.n, faster.significant) == (pytest.approx(-2.0), 3, False)
    assert rows[0].differences["net_rate"].value == pytest.approx(-0.01)
    assert rows[1].differences == {}


def test_pairs_are_the_shared_seeds():
    records = [record("plain", seed, 0.5, 10.0) for seed in (0, 1)] + [
        record("swift", seed, 0.9, 9.0) for seed in (1, 2)
    ]
    swift = tables.summarise(records, CASES)[0]
    assert swift.episodes == 2
    assert swift.differences["net_rate"].n == 1


def test_an_episode_that_finished_no_target_has_no_cycle_time():
    idle = record("swift", 0, 0.0, 0.0)
    idle["scorecard"]["done"] = 0.0
    swift = tables.summarise([idle, record("swift", 1, 0.5, 12.0)], CASES)[0]
    assert (swift.scores["cycle_time_s"].value, swift.scores["cycle_time_s"].n) == (12.0, 1)
    assert swift.scores["net_rate"].value == 0.25


def test_without_the_reference_there_is_no_difference():
    assert tables.summarise([record("swift", 0, 0.9, 9.0)], CASES)[0].differences == {}


def test_cells_show_intervals_signs_and_doubt():
    records = [record("plain", seed, 0.8, 10.0 + seed % 3) for seed in range(9)]
    records += [record("swift", seed, 0.9, 10.0 + (seed + 1) % 3) for seed in range(9)]
    swift, plain = tables.summarise(records, CASES)
    cells = {column.title: column.cell(swift) for column in tables.COLUMNS}
    assert cells["net rate, %"] == ("90.00", "90.00 .. 90.00")
    assert cells["difference, points"] == ("+10.00", "10.00 .. 10.00")
    assert cells["difference, s"][0] == "+0.00"
    assert cells["difference, s"][1].endswith("n.s.")
    assert tables.COLUMNS[2].cell(plain) == ("-", "")


def test_few_pairs_are_called_few(rows: list[tables.Row]):
    assert tables.COLUMNS[3].cell(rows[0]) == ("-2.00", "-2.00 .. -2.00 few")


@pytest.mark.parametrize("width", [80, 100, 132])
def test_the_terminal_table_fits_its_width_and_names_every_policy(rows: list[tables.Row], width: int):
    from rich.console import Console

    console = Console(width=width, record=True, file=io.StringIO())
    for table in tables.terminal_tables(rows, width):
        console.print(table)
    lines = console.export_text().splitlines()
    assert max(map(len, lines)) <= width
    text = "\n".join(lines)
    for word in ("Stand-v0, pots", "Stand-v0, row", "swift", "plain", "84.00", "difference, points"):
        assert word in text
    assert ("ms a decision" in text) == (width == 132)
    # Columns are left out before a figure or a heading is broken.
    for table in tables.terminal_tables(rows, width):
        assert len(table.columns) >= 3
        for column in table.columns:
            assert all(line in text for cell in [column.header, *column.cells] for line in str(cell).split("\n"))


def test_the_order_of_the_records_does_not_move_a_figure():
    records = [record("plain", seed, 0.6 + 0.013 * (seed * 7 % 11), 10.0 + seed % 4) for seed in range(12)]
    records += [record("swift", seed, 0.6 + 0.017 * (seed * 5 % 7), 11.0) for seed in range(12)]
    bounds = [bound(seed, 0.9 + 0.001 * seed, 12.0, [[0.0, 5.0]]) for seed in range(12)]
    assert tables.summarise(records, CASES, bounds) == tables.summarise(records[::-1], CASES, bounds[::-1])


def test_gaps_are_paired_with_the_bound_of_the_same_seed_and_net_rate():
    records = [record("plain", seed, 0.5 + 0.1 * seed, 20.0) for seed in range(3)]
    curve = [[0.0, 10.0], [0.6, 14.0], [0.9, 30.0]]
    bounds = [bound(seed, 0.6 + 0.1 * seed, 11.0 + seed, curve) for seed in (0, 1, 2)]
    plain, best = tables.summarise(records, CASES, bounds)
    assert plain.gaps["net_rate"].value == pytest.approx(0.1)
    assert plain.gaps["return"].value == pytest.approx(2.0)
    assert plain.gaps["cycle_time_s"].value == pytest.approx((10.0 + 6.0 + 6.0) / 3.0)
    assert (best.policy, best.scores["net_rate"].value) == (BOUND, pytest.approx(0.7))
    assert "cycle_time_s" not in best.scores
    one = tables.summarise(records, CASES, bounds[:1])[0]
    assert one.gaps["net_rate"].n == 1


def test_every_main_score_has_its_robust_mean_and_its_difference(rows: list[tables.Row]):
    assert set(rows[0].iqm) == set(rows[0].differences) == {"net_rate", "cycle_time_s", "return"}
    assert rows[0].iqm["net_rate"].value == pytest.approx(0.84)


def test_a_learned_policy_is_compared_with_every_rule():
    records = [{**record("plain", seed, 0.5, 9.0), "return": 5.0 + seed % 3} for seed in range(8)]
    records += [{**record("swift", seed, 0.5, 9.0), "return": 6.0 - seed % 2} for seed in range(8)]
    records += [{**record("learned", seed, 0.5, 9.0), "return": 7.0 + seed % 2} for seed in range(8)]
    rows = {row.policy: row for row in tables.summarise(records, CASES)}
    assert set(rows["learned"].over_rules) == {"plain", "swift"}
    assert rows["learned"].over_rules["swift"].value == pytest.approx(2.0)
    assert rows["swift"].over_rules == {}
    told = "\n".join(tables.verdicts(rows.values()))
    assert "learned returns more than every rule, by 1.625 [1.000, 2.125] at least, over plain" in told
    worse = [{**each, "return": 5.0} if each["policy"] == "learned" and each["seed"] < 6 else each for each in records]
    told = "\n".join(tables.verdicts(tables.summarise(worse, CASES)))
    assert "has the best net rate, 50.00 %" in told and "every rule" not in told


def test_the_gap_of_the_best_policy_is_told():
    records = [record("plain", seed, 0.5, 20.0) for seed in range(3)] + [record("swift", 0, 0.7, 20.0)]
    bounds = [bound(seed, 0.8, 11.0, []) for seed in range(3)]
    told = tables.verdicts(tables.summarise(records, CASES, bounds))
    assert told == [f"{POTS}: swift has the best net rate, 70.00 %, 10.00 points below the bound; plain 50.00 %"]


def test_charged_thinking_is_marked_everywhere(tmp_path: Path):
    rows = tables.summarise([thinking.charged(record("plain", seed, 0.5, 9.0)) for seed in range(3)], CASES)
    assert rows[0].scores["cycle_time_s"].value == pytest.approx(9.0 * (1.0 + 0.018 / 90.0))
    tables.write(rows, tmp_path, "charged")
    assert "differs from run to run" in (tmp_path / "charged.md").read_text()
    assert json.loads((tmp_path / "charged.json").read_text())[0]["charged"] is True
    lines = list(csv.DictReader(io.StringIO((tmp_path / "charged.csv").read_text())))
    assert {line["charged"] for line in lines} == {"1"}
    assert "differs from run to run" in str(tables.terminal_tables(rows, 80)[0].title)


def test_files_hold_the_same_figures(tmp_path: Path, rows: list[tables.Row]):
    paths = tables.write(rows, tmp_path)
    assert [path.name for path in paths] == ["summary.csv", "summary.md", "summary.json"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in paths)
    lines = list(csv.DictReader(io.StringIO((tmp_path / "summary.csv").read_text())))
    by_score = {(line["scenario"], line["policy"], line["score"]): line for line in lines}
    assert float(by_score["pots", "swift", "net_rate"]["value"]) == pytest.approx(0.84)
    assert float(by_score["pots", "swift", "cycle_time_s_minus_reference"]["value"]) == pytest.approx(-2.0)
    loaded = json.loads((tmp_path / "summary.json").read_text())
    assert loaded[0]["scores"]["net_rate"]["value"] == pytest.approx(0.84)
    assert loaded[0]["differences"]["cycle_time_s"]["significant"] is False
    assert loaded[2]["scores"]["cycle_time_s"]["value"] is None
    markdown = (tmp_path / "summary.md").read_text()
    assert "| swift | 3 | 84.00 (" in markdown
    assert "| **plain** | 3 | 85.00 (" in markdown
    assert "| Difference to the policy in bold |" in markdown and "| Gap to the bound |" not in markdown


def test_markdown_tells_where_the_seconds_of_a_target_go():
    entry = record("swift", 0, 0.5, 12.0)
    entry["scorecard"] |= {"done": 4.0, "phase_drive_s": 6.0, "phase_shear_s": 10.0}
    lines = tables.markdown(tables.summarise([entry], CASES)).splitlines()
    assert "| seconds a finished target | drive | shear |" in lines
    assert "| swift | 1.50 | 2.50 |" in lines


def test_a_suite_can_be_narrowed():
    suite = Suite("quick", CASES)
    narrow = suite.narrowed(policies=["plain"], episodes=2)
    assert [str(episode.policy) + str(episode.seed) for episode in narrow.episodes()] == ["plain0", "plain1"] * 2
    with pytest.raises(ValueError, match="choose one of fieldgym/Stand-v0"):
        suite.narrowed(env_id="fieldgym/Other-v0")
    with pytest.raises(ValueError, match="episodes = 0"):
        suite.narrowed(episodes=0)


def test_another_backend_keeps_its_own_cases_or_moves_the_others():
    quick, full = suites.suite("quick"), suites.suite("full")
    moved = quick.narrowed(backend="analytic")
    assert {case.condition.backend for case in quick.cases} == {"pybullet"}
    assert {(case.condition.backend, case.condition.perception) for case in moved.cases} == {("analytic", "model")}
    assert len(moved.cases) == len(quick.cases)
    assert full.narrowed(backend="analytic").cases == tuple(
        case for case in full.cases if case.condition.backend == "analytic"
    )


def test_fewer_seeds_are_the_suite_s_first_ones():
    case = suites.suite("full").narrowed(episodes=3).cases[0]
    assert case.seeds == tuple(HELD_OUT.take(3))


def test_the_full_suite_pairs_both_backends_on_seeds_that_nothing_was_trained_or_chosen_on():
    from fieldgym.agents.learning.portable import shipped
    from fieldgym.envs import env_ids, task

    cases = suites.suite("full").cases
    seeds = set(HELD_OUT.take(parts.FULL_EPISODES))
    for env_id in env_ids():
        by_backend = {
            case.condition.backend: case
            for case in cases
            if case.condition.env_id == env_id
            and case.condition.perception == "model"
            and case.condition.scenario not in (*task(env_id).demands, *task(env_id).ordering)
        }
        assert {case.condition.scenario for case in by_backend.values()} == {task(env_id).headline}
        assert {case.condition.perception for case in by_backend.values()} == {"model"}
        assert set(by_backend["analytic"].seeds) == seeds and len(seeds) >= 200
        assert by_backend["pybullet"].seeds == by_backend["analytic"].seeds[: parts.FULL_PYBULLET_EPISODES]
    for env_id in env_ids():
        for scenario in task(env_id).scenarios:
            path = shipped(env_id, scenario)
            if path is not None:
                card = json.loads(path.with_suffix(".json").read_text())
                low, high = card["chosen_on_seeds"]
                assert not seeds & set(range(low, high + 1)), path


def test_the_full_suite_pairs_cameras_with_their_model():
    from fieldgym.envs.task import tasks

    cases = suites.suite("full").cases
    for spec in tasks():
        own = {
            case.condition.perception: case
            for case in cases
            if (case.condition.env_id, case.condition.backend) == (spec.id, "analytic")
            and case.condition.scenario == spec.headline
            and not case.condition.changes
        }
        (_, fields), *others = spec.sights
        several = {"perfect"} if others else set()
        assert own.keys() == {"camera", "model"} & set(spec.perceptions) | several
        if "camera" in own:
            seen, modelled = own["camera"], own["model"]
            assert seen.condition.scenario == modelled.condition.scenario == spec.headline
            assert seen.policies == (spec.reference,) and not seen.bounds
            assert seen.seeds == modelled.seeds[: len(seen.seeds)] and len(seen.seeds) == fields


def test_the_full_suite_plays_what_is_demanded_with_eyes_that_can_meet_it():
    cases = [case for case in suites.suite("full").cases if case.condition.scenario.startswith("demand")]
    assert {(case.condition.env_id, case.condition.scenario, case.condition.perception) for case in cases} == {
        ("fieldgym/LaserWeedingSpeed-v0", "demand-0.90", "perfect"),
        ("fieldgym/LaserWeedingSpeed-v0", "demand-0.60", "model"),
    }
    assert all("learned" not in case.policies and "hold-backlog-0.65" in case.policies for case in cases)


def test_the_full_suite_plays_what_has_to_be_put_in_order_with_those_who_can():
    ordered = [case for case in suites.suite("full").cases if case.condition.scenario == "bag"]
    assert [(case.condition.backend, case.condition.perception, case.bounds) for case in ordered] == [
        ("analytic", "model", parts.FULL_ORDERING_BOUNDS)
    ]
    assert {"fixed-order", "closing-first", "bag-horizon", "learned", "random"} <= set(ordered[0].policies)
    others = [case for case in suites.suite("tiers").cases if case.condition.scenario == "row"]
    assert len(others) == 1 and {"learned", "route"} <= set(others[0].policies)
    assert not {"closing-first", "bag-horizon"} & set(others[0].policies)


def test_another_scenario_is_played_by_the_policies_that_are_for_it():
    picker = suites.suite("full", ["fieldgym/SafflowerPicking-v0"])
    models = [case for case in picker.under("bag").cases if case.condition.perception == "model"]
    by_backend = {case.condition.backend: case.policies for case in models}
    ordered = [case.policies for case in picker.cases if case.condition.scenario == "bag"]
    assert by_backend == {"analytic": ordered[0], "pybullet": ("fixed-order", "bag-horizon", "learned")}
    chosen = picker.narrowed(policies=["nearest", "learned"]).under("bag")
    assert {case.policies for case in chosen.cases} == {("nearest", "learned")}


def test_a_suite_is_narrowed_to_a_perception():
    narrowed = suites.suite("full").narrowed(perception="camera")
    assert {case.condition.perception for case in narrowed.cases} == {"camera"} and narrowed.cases
    with pytest.raises(ValueError, match="no case of the suite quick has perfect perception: camera, model have"):
        suites.suite("quick").narrowed(perception="perfect")


def test_suites_cover_every_environment_with_its_reference():
    from fieldgym.agents import policy_names
    from fieldgym.bounds import bounded_ids
    from fieldgym.envs import env_ids, task

    for name in suites.SUITES:
        cases = suites.suite(name).cases
        assert {case.condition.env_id for case in cases} == set(env_ids())
        for case in cases:
            assert case.reference in case.policies
            spec = task(case.condition.env_id)
            owed = name == "full" and case.condition.scenario in spec.demands
            seen = name == "full" and case.condition.perception != "model" and not owed
            driven = name == "full" and case.condition.backend == "pybullet"
            everybody = spec.lineup(case.condition.scenario, policy_names(case.condition.env_id))
            rules = tuple(policy for policy in everybody if policy != "learned")
            best = spec.recommended(case.condition.scenario)
            few = tuple(policy for policy in everybody if policy in (case.reference, best, "learned"))
            wanted = (case.reference,) if seen else rules if owed else few if driven else everybody
            assert case.policies == wanted
            assert case.condition.scenario in spec.scenarios
            known = name != "quick" and not seen and case.condition.scenario not in spec.demands
            known = known and case.condition.env_id in bounded_ids()
            most = parts.FULL_PYBULLET_BOUNDS if driven else parts.FULL_BOUNDS if name == "full" else len(case.seeds)
            if name == "full" and case.condition.scenario in spec.ordering:
                most = parts.FULL_ORDERING_BOUNDS
            assert case.bounds == (most if known else 0)
            for first, seed in ((True, case.seeds[0]), (False, case.seeds[-1])):
                asked = [episode.policy for episode in case.episodes() if episode.seed == seed]
                beside = case.bounds if first else case.bounds == len(case.seeds)
                assert asked == [*case.policies, *([BOUND] if beside else [])]
            assert [e.seed for e in case.episodes() if e.timeline] == [case.seeds[0]] * len(case.policies)
    with pytest.raises(ValueError, match="no suite is called 'medium'"):
        suites.suite("medium")


def test_what_a_grower_reads_fits_a_hundred_characters():
    from rich.console import Console

    where = Condition("fieldgym/LaserWeedingSpeed-v0", "load-1.25", "analytic", "model")
    card = {"throughput_per_min": 50.0, "done": 70.0, "joules_per_weed": 120.0, "crop_loss_percent": 1.0}
    card |= {"duration_s": 84.0, "cycle_time_s": 1.2, "phase_move_s": 20.0, "net_rate": 0.6}
    records = [
        {**record("hold-backlog-0.65", seed, 0.6, 1.2, where), "scorecard": {**card, "ha_per_h": 0.0141 + 0.001 * seed}}
        for seed in range(6)
    ]
    rows = tables.summarise(records, [Case(where, ("hold-backlog-0.65",), "constant-1", tuple(range(6)))])
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(tables.terminal_tables(rows, 100)[1])
    text = console.export_text()
    assert all(word in text for word in ("ha/h", "kills/s", "J a kill", "kWh/ha", "crop loss, %", "0.83", "1.00"))
    assert max(map(len, text.splitlines())) <= 100
