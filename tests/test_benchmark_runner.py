"""Running, interrupting and resuming, with stand-ins for the episodes: what a benchmark must never do is lose one."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from waiting import until

from fieldgym.benchmark import runner, store
from fieldgym.benchmark.record import Record, failed, identity, key
from fieldgym.benchmark.suites import BOUND, Case, Condition, Episode, Suite

CONDITION = Condition("fieldgym/Stand-v0", "pots", "analytic", "model")


def small_suite(seeds: int = 4, policies: tuple[str, ...] = ("first", "second"), bounded: bool = False) -> Suite:
    return Suite("quick", (Case(CONDITION, policies, policies[0], tuple(range(seeds)), seeds if bounded else 0),))


def result_of(episode: Episode) -> Record:
    if episode.policy == BOUND:
        bound = {"net_rate": 0.5 + 0.01 * episode.seed, "episode_return": 1.0, "curve": []}
        return {**identity(episode), "bound": bound, "wall_s": 0.1}
    scorecard = {"net_rate": 0.5 + 0.01 * episode.seed, "cycle_time_s": None}
    return {
        **identity(episode),
        "return": 1.0,
        "rewards": {},
        "steps": 3,
        "terminated": True,
        "scorecard": scorecard,
        "wall_s": 0.1,
        "decision_s": 0.01,
    }


class Counting:
    """Runs episodes in this process and remembers which."""

    def __init__(self, stop_before: int | None = None, failing: tuple[str, int] | None = None):
        self.ran: list[tuple[str, int]] = []
        self.stop_before, self.failing = stop_before, failing

    def __call__(self, episode: Episode, cancelled=None) -> Record:
        if len(self.ran) == self.stop_before:
            raise KeyboardInterrupt
        name = (episode.policy, episode.seed)
        self.ran.append(name)
        return failed(episode, "ValueError: bad luck") if name == self.failing else result_of(episode)


def test_every_policy_meets_every_seed_and_each_result_is_on_the_disk_when_it_is_told(tmp_path: Path):
    on_disk = []

    def look(record: Record) -> None:
        assert store.read(tmp_path / store.EPISODES)[-1] == record
        on_disk.append(record)

    count = Counting()
    report = runner.run_suite(small_suite(), tmp_path, run=count, on_record=look)
    assert count.ran == [(policy, seed) for seed in range(4) for policy in ("first", "second")]
    assert report.records == on_disk == store.read(tmp_path / store.EPISODES)
    manifest = json.loads((tmp_path / store.MANIFEST).read_text())
    assert manifest["suite"] == "quick"
    assert manifest["packages"]["numpy"]


def test_ctrl_c_keeps_what_is_finished_and_resume_runs_only_the_rest(tmp_path: Path):
    with pytest.raises(runner.InterruptedRunError, match="3 of 8 episodes are kept"):
        runner.run_suite(small_suite(), tmp_path, run=Counting(stop_before=3))
    count = Counting()
    report = runner.run_suite(small_suite(), tmp_path, resume=True, run=count)
    assert len(count.ran) == 5
    assert report.skipped == 3
    assert len({key(record) for record in report.records}) == len(report.records) == 8


def test_bounds_are_kept_beside_the_episodes_and_computed_once(tmp_path: Path):
    suite = small_suite(3, bounded=True)
    with pytest.raises(runner.InterruptedRunError, match="5 of 9 episodes are kept"):
        runner.run_suite(suite, tmp_path, run=Counting(stop_before=5))
    assert len(store.read(tmp_path / store.BOUNDS)) == 1
    count = Counting()
    report = runner.run_suite(suite, tmp_path, resume=True, run=count)
    assert count.ran == [(BOUND, 1), ("first", 2), ("second", 2), (BOUND, 2)]
    assert [record["seed"] for record in report.bounds] == [0, 1, 2]
    assert BOUND not in {record["policy"] for record in report.records}
    assert store.read(tmp_path / store.BOUNDS) == report.bounds
    assert [record["bound"]["net_rate"] for record in store.load(tmp_path)] == [0.5, 0.5, 0.51, 0.51, 0.52, 0.52]
    runner.run_suite(suite, tmp_path, run=Counting())
    assert len(store.read(tmp_path / "bounds.previous.jsonl")) == 3


def test_a_bound_that_fails_is_told_and_tried_again(tmp_path: Path):
    suite = small_suite(2, bounded=True)
    report = runner.run_suite(suite, tmp_path, run=Counting(failing=(BOUND, 1)))
    assert [(record["policy"], record["seed"]) for record in report.failures] == [(BOUND, 1)]
    assert len(report.bounds) == 1 and report.violations == []
    again = Counting()
    assert len(runner.run_suite(suite, tmp_path, resume=True, run=again).bounds) == 2
    assert again.ran == [(BOUND, 1)]


def test_results_that_beat_their_bound_are_in_the_report(tmp_path: Path):
    def cheat(episode: Episode, cancelled=None) -> Record:
        record = result_of(episode)
        return {**record, "return": 1.1} if (episode.policy, episode.seed) == ("second", 1) else record

    report = runner.run_suite(small_suite(2, bounded=True), tmp_path, run=cheat)
    assert len(report.violations) == 1
    assert "second, seed 1: return 1.1 beats its bound 1" in report.violations[0]


def test_an_engine_must_be_known(tmp_path: Path):
    with pytest.raises(ValueError, match="engine = 'dask': choose one of local, ray"):
        runner.run_suite(small_suite(), tmp_path, engine="dask")


def test_a_torn_last_line_runs_again(tmp_path: Path):
    runner.run_suite(small_suite(), tmp_path, run=Counting())
    path = tmp_path / store.EPISODES
    whole = path.read_bytes()
    path.write_bytes(whole[:-20])
    count = Counting()
    with pytest.warns(UserWarning, match=r"episodes.jsonl, line 8 is left out: it is torn$"):
        runner.run_suite(small_suite(), tmp_path, resume=True, run=count)
    assert not (tmp_path / "episodes.damaged.jsonl").exists()
    assert count.ran == [("second", 3)]
    assert sorted(path.read_bytes().splitlines()) == sorted(whole.splitlines())


def test_a_damaged_line_is_named_kept_aside_and_runs_again(tmp_path: Path):
    runner.run_suite(small_suite(), tmp_path, run=Counting())
    path = tmp_path / store.EPISODES
    lines = path.read_text("utf-8").splitlines()
    whole, lines[2] = lines[2], lines[2][:30]
    path.write_text(damaged := "\n".join(lines) + "\n", "utf-8")
    count = Counting()
    with pytest.warns(UserWarning, match=r"episodes.jsonl, line 3 is left out: it is no JSON$"):
        runner.run_suite(small_suite(), tmp_path, resume=True, run=count)
    assert count.ran == [("first", 1)]
    assert whole in path.read_text("utf-8").splitlines()
    assert (tmp_path / "episodes.damaged.jsonl").read_text("utf-8") == damaged


def test_a_failing_episode_is_reported_and_loses_no_other(tmp_path: Path):
    report = runner.run_suite(small_suite(), tmp_path, run=Counting(failing=("second", 1)))
    assert [(record["policy"], record["seed"], record["error"]) for record in report.failures] == [
        ("second", 1, "ValueError: bad luck")
    ]
    assert len(report.records) == 7
    again = Counting()
    report = runner.run_suite(small_suite(), tmp_path, resume=True, run=again)
    assert again.ran == [("second", 1)]
    assert len(report.records) == 8
    assert not report.failures


@pytest.mark.parametrize(
    ("entry", "value", "told"),
    [
        ("fieldgym", "0.0.1", "fieldgym 0.0.1"),
        ("suite", "full", "suite full"),
        ("source", "0123", "state of the source 0123"),
        ("packages", {"numpy": "1.0"}, "numpy 1.0"),
    ],
)
def test_results_of_another_state_are_not_continued(tmp_path: Path, entry: str, value: object, told: str):
    runner.run_suite(small_suite(), tmp_path, run=Counting())
    path = tmp_path / store.MANIFEST
    path.write_text(json.dumps({**json.loads(path.read_text()), entry: value}))
    before = (tmp_path / store.EPISODES).read_bytes()
    with pytest.raises(store.ResultsError, match=told):
        runner.run_suite(small_suite(), tmp_path, resume=True, run=Counting())
    assert (tmp_path / store.EPISODES).read_bytes() == before


def test_a_missing_manifest_is_told(tmp_path: Path):
    runner.run_suite(small_suite(), tmp_path, run=Counting())
    (tmp_path / store.MANIFEST).unlink()
    with pytest.raises(store.ResultsError, match=r"manifest\.json is missing"):
        runner.run_suite(small_suite(), tmp_path, resume=True, run=Counting())


def test_starting_over_keeps_the_previous_results_aside(tmp_path: Path):
    runner.run_suite(small_suite(2), tmp_path, run=Counting())
    (tmp_path / "summary.md").write_text("old")
    runner.run_suite(small_suite(1), tmp_path, run=Counting())
    assert len(store.read(tmp_path / store.EPISODES)) == 2
    assert len(store.read(tmp_path / "episodes.previous.jsonl")) == 4
    assert not (tmp_path / "summary.md").exists()


def test_a_folder_that_cannot_be_made_is_told_in_one_line(tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(
        store.ResultsError, match=r"cannot write results to .*: choose another folder with --out"
    ) as told:
        runner.run_suite(small_suite(), tmp_path / "file" / "results", run=Counting())
    assert "\n" not in str(told.value)


def test_jobs_must_be_positive(tmp_path: Path):
    with pytest.raises(ValueError, match="jobs = 0"):
        runner.run_suite(small_suite(), tmp_path, jobs=0)


AT_ONCE = 2
"""Episodes of as many seeds end at once; the others go on until the folder holds a file ``go-on``."""
SCRIPT = """
import os, sys
from pathlib import Path
sys.path.insert(0, {tests!r})
from test_benchmark_runner import AT_ONCE, result_of, small_suite
from waiting import until
from fieldgym.benchmark import runner

folder, jobs, policies = Path(sys.argv[1]), int(sys.argv[2]), tuple(sys.argv[3].split(","))

def run(episode, cancelled):
    (folder / f"worker-{{os.getpid()}}").touch()
    if episode.policy == "crash" and episode.seed == 1:
        os._exit(9)
    if episode.seed >= AT_ONCE:
        until(lambda: cancelled() or (folder / "go-on").exists())
    if cancelled():
        raise runner_cancelled()
    with open(folder / "ran", "a") as log:
        log.write(f"{{episode.policy}} {{episode.seed}}\\n")
    return result_of(episode)

def runner_cancelled():
    from fieldgym.benchmark.episode import EpisodeCancelledError
    return EpisodeCancelledError()

if __name__ == "__main__":
    try:
        suite = small_suite(6, policies, bounded="--bounds" in sys.argv)
        report = runner.run_suite(suite, folder, jobs, "--resume" in sys.argv, run=run)
    except runner.InterruptedRunError as error:
        print(error)
        sys.exit(130)
    finished = len(report.records) + len(report.bounds)
    print(finished, "finished", [(r["policy"], r["seed"], r["error"]) for r in report.failures])
"""


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "run_episodes.py"
    path.write_text(SCRIPT.format(tests=str(Path(__file__).parent)))
    return path


def start(script: Path, folder: Path, jobs: int, policies: str, *words: str) -> "subprocess.Popen[str]":
    folder.mkdir(exist_ok=True)
    return subprocess.Popen(
        [sys.executable, str(script), str(folder), str(jobs), policies, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def wait_for_lines(path: Path, lines: int, process: "subprocess.Popen[str]") -> None:
    def grown() -> bool:
        assert process.poll() is None, process.communicate()
        return path.exists() and path.read_bytes().count(b"\n") >= lines

    until(grown, f"{path} did not grow")


def alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("jobs", [1, 2])
def test_ctrl_c_in_the_terminal_ends_quietly_and_resume_completes(tmp_path: Path, script: Path, jobs: int):
    """The terminal sends Ctrl-C to the workers as well: they must not print tracebacks or lose what is written."""
    folder = tmp_path / "results"
    process = start(script, folder, jobs, "first,second")
    wait_for_lines(folder / store.EPISODES, 2 * AT_ONCE, process)
    os.killpg(process.pid, signal.SIGINT)
    output, errors = process.communicate(timeout=30)
    kept = len(store.read(folder / store.EPISODES))
    assert process.returncode == 130
    assert output == f"stopped: {kept} of 12 episodes are kept\n"
    assert errors == ""
    assert kept == 2 * AT_ONCE
    finished_before = {key(record) for record in store.read(folder / store.EPISODES)}
    (folder / "ran").unlink()
    (folder / "go-on").touch()

    output, errors = start(script, folder, jobs, "first,second", "--resume").communicate(timeout=60)
    assert output == "12 finished []\n", errors
    ran = (folder / "ran").read_text().splitlines()
    assert len(ran) == len(set(ran)) == 12 - kept
    assert not {f"{key[4]} {key[5]}" for key in finished_before} & set(ran)


@pytest.mark.slow
def test_a_killed_benchmark_leaves_no_worker_and_can_be_resumed(tmp_path: Path, script: Path):
    folder = tmp_path / "results"
    process = start(script, folder, 2, "first,second", "--bounds")
    wait_for_lines(folder / store.EPISODES, 2 * AT_ONCE, process)
    wait_for_lines(folder / store.BOUNDS, AT_ONCE, process)
    until(lambda: len(list(folder.glob("worker-*"))) == 2)
    workers = [int(path.name.removeprefix("worker-")) for path in folder.glob("worker-*")]
    process.kill()
    process.communicate()
    for name in (store.EPISODES, store.BOUNDS):
        with open(folder / name, "a") as file:
            file.write('{"env_id": "fieldgym/Sta')
    until(lambda: not any(map(alive, workers)), "a worker lives on")
    done_before = {key(record) for name in (store.EPISODES, store.BOUNDS) for record in told_whole(folder / name)}
    (folder / "ran").unlink()
    (folder / "go-on").touch()
    output, errors = start(script, folder, 2, "first,second", "--bounds", "--resume").communicate(timeout=60)
    assert output == "18 finished []\n", errors
    ran = (folder / "ran").read_text().splitlines()
    assert len(ran) == len(set(ran)) == 18 - len(done_before)


def told_whole(path: Path) -> "list[Record]":
    return [json.loads(line) for line in path.read_bytes().split(b"\n")[:-1]]


@pytest.mark.slow
def test_a_worker_that_dies_costs_only_its_own_episode(tmp_path: Path, script: Path):
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "go-on").touch()
    output, errors = start(script, tmp_path / "results", 2, "first,crash").communicate(timeout=120)
    assert output.startswith("11 finished [('crash', 1, 'the worker process died"), errors
