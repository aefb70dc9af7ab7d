"""The ``fieldgym`` command as a person meets it: what it prints, and one line for every mistake."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner
from waiting import until

import fieldgym
from fieldgym.agents import policy_names
from fieldgym.benchmark.record import untimed
from fieldgym.envs import task
from fieldgym.scripts import cli, run
from fieldgym.scripts.common import CommandError, chosen, environment_id

pytestmark = pytest.mark.portable

ENV = "fieldgym/SafflowerPicking-v0"
ROOT = Path(__file__).resolve().parents[1]


def fieldgym_command(*words: str, **options) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "fieldgym", *words], capture_output=True, text=True, check=False, **options
    )


def told(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *words: str) -> str:
    """The one line that a mistake gets, in this process: starting Python for each would take seconds."""
    monkeypatch.setattr(sys, "argv", ["fieldgym", *words])
    with pytest.raises(SystemExit) as left:
        cli.main()
    out, err = capsys.readouterr()
    assert left.value.code == 2
    assert out == ""
    assert err.startswith("fieldgym: ")
    assert err.count("\n") == 1
    return err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["run", "SafflowerPiking"], f"did you mean {ENV!r}? choose one of {ENV!r}"),
        (
            ["run", ENV, "--policy", "neares"],
            "did you mean 'nearest'? choose one of 'random', 'fixed-order', 'nearest',",
        ),
        (["run", ENV, "--scenario", "pods"], "did you mean 'pots'?"),
        (["run", ENV, "--backend", "bullet"], "did you mean 'pybullet'? choose one of 'pybullet', 'analytic'"),
        (
            ["run", ENV, "--perception", "eyes"],
            "no perception is called 'eyes': choose one of 'perfect', 'model', 'camera'",
        ),
        (["run", ENV, "--episodes", "0"], "--episodes 0: give at least 1"),
        *(
            (["run", ENV, "--speed", speed], f"--speed {float(speed)}: give a positive factor")
            for speed in ("inf", "nan", "0", "-1", "1e9")
        ),
        (["run", ENV, "--seed", "-1"], "--seed -1: give 0 or more"),
        (["run", ENV, "--video", "film.gif"], "name a file that ends in .mp4"),
        (["run", ENV, "--video", "film.mp4", "--speed", "0"], "--speed 0.0: give a positive factor"),
        (["run"], "Missing argument 'ID'. See: fieldgym run --help"),
        (["rum"], "No such command 'rum'. Did you mean 'run'?"),
        (["benchmark", "--siute", "full"], "No such option: --siute"),
        (["benchmark", "--suite", "fast"], "no suite is called 'fast'"),
        (["benchmark", "--env", "Safflower"], "no environment is called 'Safflower'"),
        (["benchmark", "--policies", "nearest,furthest"], "policy 'furthest' is unknown for fieldgym/"),
        (["benchmark", "--policies", ","], "--policies names none"),
        (["benchmark", "--episodes", "-3"], "--episodes -3: give at least 1"),
        (["benchmark", "--episodes", "many"], "Invalid value for '--episodes'"),
        (["benchmark", "--jobs", "0"], "--jobs 0: give at least 1"),
        (["benchmark", "--backend", "analytical"], "did you mean 'analytic'?"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_mistake_gets_one_line_that_says_what_to_do(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, words: list[str], message: str
):
    assert message in told(capsys, monkeypatch, *words)


def test_an_output_folder_that_cannot_be_written_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "file").write_text("")
    out = tmp_path / "file" / "results"
    line = told(capsys, monkeypatch, "benchmark", "--backend", "analytic", "--episodes", "1", "--out", str(out))
    assert line.startswith(f"fieldgym: cannot write results to {out}")
    assert line.endswith("choose another folder with --out\n")


def test_video_without_imageio_names_the_extra(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert 'pip install "fieldgym[bench]"' in told(capsys, monkeypatch, "run", ENV, "--video", "film.mp4")


def test_an_environment_may_be_named_shortly():
    for name in (ENV, "SafflowerPicking-v0", "SafflowerPicking", "safflowerpicking"):
        assert environment_id(name) == ENV


def test_choices_are_listed():
    with pytest.raises(CommandError, match="no colour is called 'x': choose one of 'red', 'blue'"):
        chosen("x", ("red", "blue"), "colour")


def test_help_shows_every_command_with_examples():
    result = CliRunner().invoke(cli.app, ["--help"])
    assert result.exit_code == 0
    for word in ("list", "run", "benchmark", "reproduce"):
        assert word in result.output
    for command in ("run", "benchmark"):
        assert f"fieldgym {command}" in CliRunner().invoke(cli.app, [command, "--help"]).output


def test_version_is_the_package_s():
    result = CliRunner().invoke(cli.app, ["--version"])
    assert result.output == f"fieldgym {fieldgym.__version__}\n"


def test_list_tells_everything_about_each_environment():
    entries = json.loads(CliRunner().invoke(cli.app, ["list", "--json"]).output)
    assert [entry["id"] for entry in entries] == list(fieldgym.env_ids())
    assert "fixed-order" in entries[0]["policies"]
    text = CliRunner().invoke(cli.app, ["list"]).output
    for entry in entries:
        assert entry["id"] in text
        assert entry["headline_scenario"] in text


def test_run_prints_a_line_a_decision_and_the_scorecard():
    words = ["run", "SafflowerPicking", "--backend", "analytic", "--episodes", "2", "--seed", "5"]
    output = CliRunner().invoke(cli.app, words).output
    assert "seed 5" in output
    assert "seed 6" in output
    assert output.count(" pick ") > 20
    assert "net_rate" in output
    quiet = CliRunner().invoke(cli.app, [*words, "--quiet"]).output
    assert " pick " not in quiet
    assert quiet.split("scorecard")[1] == output.split("scorecard")[1]


def test_run_summarises_many_episodes():
    output = CliRunner().invoke(cli.app, ["run", ENV, "--backend", "analytic", "--episodes", "6", "-q"]).output
    assert output.split("scorecard")[1].split()[:4] == ["mean", "SD", "least", "most"]


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["analytic", "pybullet"])
def test_video_shows_the_episode(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, backend: str):
    import imageio.v2

    make = run._make
    monkeypatch.setattr(run, "_make", lambda env_id, options: make(env_id, {**options, "max_episode_steps": 3}))
    path = tmp_path / "films" / "picking.mp4"
    words = ["run", ENV, "--backend", backend, "--perception", "perfect", "--quiet", "--video", str(path)]
    result = CliRunner().invoke(cli.app, [*words, "--speed", "100"])
    assert result.exit_code == 0, result.output
    assert [file.name for file in path.parent.iterdir()] == ["picking.mp4"]
    frames = [frame.astype(float) for frame in imageio.v2.mimread(path)]
    assert len(frames) > 5
    assert frames[0].std() > 10.0
    assert max(abs(frame - frames[0]).mean() for frame in frames) > 0.5


@pytest.mark.slow
@pytest.mark.long
def test_benchmark_is_the_same_on_one_process_and_on_two(tmp_path: Path):
    def records(jobs: int) -> list[dict]:
        words = [
            "benchmark",
            "--env",
            ENV,
            "--backend",
            "analytic",
            "--episodes",
            "2",
            "--out",
            str(tmp_path / str(jobs)),
        ]
        result = fieldgym_command(*words, "--jobs", str(jobs))
        assert result.returncode == 0, result.stderr
        assert "grams-per-second" in result.stdout
        lines = (tmp_path / str(jobs) / "quick" / "episodes.jsonl").read_text().splitlines()
        return sorted((untimed(json.loads(line)) for line in lines), key=lambda each: (each["policy"], each["seed"]))

    alone = records(1)
    picker = task("fieldgym/SafflowerPicking-v0")
    assert len(alone) == 2 * len(picker.lineup(picker.headline, policy_names(picker.id)))
    assert alone == records(2)


@pytest.mark.slow
def test_ctrl_c_tells_how_to_go_on_and_that_command_completes_the_table(tmp_path: Path):
    words = ["benchmark", "--env", ENV, "--backend", "analytic", "--episodes", "100", "--out", str(tmp_path)]
    process = subprocess.Popen(
        [sys.executable, "-m", "fieldgym.scripts.cli", *words, "--policies", "fixed-order,nearest"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    path = tmp_path / "quick" / "episodes.jsonl"
    until(lambda: path.exists() and path.read_bytes().count(b"\n") >= 5)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 130
    kept = path.read_text().count("\n")
    start, command = errors.strip().split(" Go on with: ")
    assert start == f"fieldgym: stopped: {kept} of 200 episodes are kept in {tmp_path / 'quick'}."
    done = fieldgym_command(*command.split()[1:])
    assert done.returncode == 0, done.stderr
    assert f"{kept} of them finished earlier" in done.stdout
    assert path.read_text().count("\n") == 200
