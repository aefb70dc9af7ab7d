"""``scripts/torture.py`` finds what it looks for; and what it has found, kind by kind."""

import io
import json
import os
import re
import subprocess
import sys
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from made_up import record, small_suite, write

import fieldgym  # noqa: F401
from fieldgym.benchmark import store
from fieldgym.envs.safflower.env import SafflowerPickingEnv
from fieldgym.kernels import files
from fieldgym.scripts.torture_parts import Limits, Tally, check_observation, generator, not_one_line, watched
from fieldgym.scripts.torture_values import Hostile, Loud

ROOT = Path(__file__).parents[1]
PICKER, TRAYS = "fieldgym/SafflowerPicking-v0", "fieldgym/TrayTransplanting-v0"
SCRIPT = [sys.executable, str(ROOT / "scripts" / "torture.py")]


# The script itself


@pytest.mark.slow
@pytest.mark.long
def test_the_script_tries_what_is_quick_and_finds_nothing():
    """Runs that are killed have tests of their own, ``test_benchmark_resume``."""
    quick = [f"--only={section}" for section in ("actions", "configs", "files", "resets")]
    done = subprocess.run([*SCRIPT, *quick, "--share", "0.002"], capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-2000:]
    assert done.stdout.rstrip().endswith("0 faults")
    for figure in ("actions", "configs", "files", "resets analytic", "end MB"):
        assert re.search(rf"\b{figure}\b", done.stdout), figure


def _odd(rng: np.random.Generator, number: int, tally: Tally) -> None:
    """Cases that are faults of every sort, for the one that watches."""
    tally.counts["cases"] += 1
    if number == 1:
        time.sleep(600.0)
    if number == 2:
        os._exit(9)
    if number == 3:
        raise RuntimeError("no\nline")
    if number == 4:
        tally.refused(ValueError("two\nlines"), (ValueError,), "an error")
    if number == 5:
        kept = [np.ones(2**22) for _ in range(20)]
        time.sleep(600.0)
        del kept


def test_whatever_a_case_does_it_is_told_and_the_next_one_goes_on():
    def told(*numbers: int, **limits: float) -> list[str]:
        return [" ".join(tally.faults) for tally in watched(_odd, "odd", 0, iter(numbers), Limits(**limits))]

    assert told(1, clock_s=1.0) == ["case 1: took more than 1 s"]
    found = told(0, 2, 3, 4, 5, 6, megabytes=400.0)
    assert found[0] == found[5] == "" and "exit code 9" in found[1] and "RuntimeError" in found[2]
    assert "case 4: an error: more than one line, ValueError: 'two\\nlines'" in found[3]
    assert found[4] == "case 5: took more than 400 MB"


def test_a_case_has_the_same_chance_whatever_ran_before_it():
    one, other = generator(3, "odd", 7), generator(3, "odd", 8)
    assert one.random() == generator(3, "odd", 7).random() != other.random()
    assert generator(3, "odd", 7).random() not in (generator(4, "odd", 7).random(), generator(3, "odds", 7).random())


def test_observations_beyond_their_space_are_seen():
    env: Any = gym.make(PICKER, backend="analytic").unwrapped
    observation, _ = env.reset(seed=1)

    def faults(**changed: np.ndarray) -> int:
        tally = Tally()
        check_observation(env.observation_space, {**observation, **changed}, tally, "it")
        return len(tally.faults)

    machine = observation["machine"]
    assert faults() == 0
    odd = (machine + np.float32(np.nan), machine + np.float32(11.0), machine[:-1], machine.astype(float))
    assert [faults(machine=values) for values in odd] == [1] * 4
    assert faults(more=machine) == 2


# What it found: values of callers


def one_line(error: BaseException) -> str:
    assert not not_one_line(str(error)), repr(str(error))
    return str(error)


MANY_LINES = [np.zeros((3, 3)), Loud(), [Loud()], Hostile(), "two\nlines", -(10**9000), "a" * 10**5]


@pytest.mark.parametrize("value", MANY_LINES, ids=lambda value: type(value).__name__)
def test_a_value_of_many_lines_is_named_in_one(value: Any):
    env: Any = gym.make(PICKER, backend="analytic").unwrapped
    env.reset(seed=1)
    asked = [
        lambda: env.step(value),
        lambda: env.reset(seed=value),
        lambda: env.reset(options=value),
        lambda: env.reset(options={"field": value}),
        *(
            lambda name=name: gym.make(PICKER, disable_env_checker=True, **{name: value})
            for name in ("scenario", "backend", "engine", "perception", "observation", "pixel_rows", "depth", "camera")
        ),
        *(
            lambda name=name: gym.make(PICKER, disable_env_checker=True, **{name: value})
            for name in ("width", "slots", "config", "overrides")
        ),
        *(
            lambda name=name: gym.make_vec(PICKER, 2, "vector_entry_point", **{name: value})
            for name in ("threads", "autoreset_mode", "backend", "perception")
        ),
        lambda: gym.make(PICKER, overrides={"preset": value}),
        lambda: gym.make(TRAYS, source_tray=value),
        lambda: SafflowerPickingEnv(render_mode=value),  # Gymnasium looks at it first, and not so well
    ]
    for number, ask in enumerate(asked):
        with pytest.raises((ValueError, gym.error.Error)) as error:
            ask()
        assert one_line(error.value), number


@pytest.mark.parametrize("value", [5, ["process.power_w"], "row", np.zeros(3)])
def test_overrides_are_a_mapping(value: Any):
    with pytest.raises(ValueError, match=r"^overrides = .*: give numbers by their dotted names$"):
        gym.make(PICKER, overrides=value)


@pytest.mark.parametrize("value", [3, [3], [[]], {"a": 1}, {1}, [None]])
def test_a_preset_is_a_name(value: Any):
    with pytest.raises(ValueError, match=r"^preset = .* is unknown: choose one of "):
        gym.make(PICKER, overrides={"preset": value})


# What it found: files


def test_a_scenario_that_builds_on_itself_is_refused(tmp_path: Path):
    pytest.importorskip("yaml")
    one, other = tmp_path / "one.yaml", tmp_path / "other.yaml"
    one.write_text(f"base: {other}\n", "utf-8")
    other.write_text(f"base: {one}\n", "utf-8")
    with pytest.raises(ValueError, match=r"one\.yaml:1: base: .*more than 16 files that build on each other") as error:
        gym.make(PICKER, scenario=one)
    one_line(error.value)
    other.write_text("base: row\n", "utf-8")
    assert gym.make(PICKER, backend="analytic", scenario=one).unwrapped.core.config.scenario  # type: ignore[attr-defined]


@pytest.mark.parametrize("base", ["nothing", "3", "[]", "{a: 1}", "null"])
def test_what_a_scenario_cannot_build_on_is_named_with_its_line(tmp_path: Path, base: str):
    pytest.importorskip("yaml")
    file = tmp_path / "s.yaml"
    file.write_text(f"# mine\nbase: {base}\n", "utf-8")
    with pytest.raises(ValueError, match=rf"^{re.escape(str(file))}:2: base: scenario = .* is unknown") as error:
        gym.make(PICKER, scenario=file)
    one_line(error.value)


def test_a_number_in_a_scenario_s_file_is_refused_with_its_line(tmp_path: Path):
    pytest.importorskip("yaml")
    file = tmp_path / "s.yaml"
    file.write_text("base: row\ntime_limit_s: -1\n", "utf-8")
    with pytest.raises(ValueError, match=rf"^{re.escape(str(file))}:2: time_limit_s = -1: give a number in"):
        gym.make(PICKER, scenario=file)


@pytest.fixture
def within() -> Iterator[None]:
    """Ten seconds for what would wait for ever."""
    import signal

    def stop(number: int, frame: Any) -> None:
        raise AssertionError("it waits for ever")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(10)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.usefixtures("within")
@pytest.mark.parametrize("kind", ["pipe", "zeros", "terabyte"])
def test_pipes_devices_and_huge_files_are_not_read_whoever_reads(tmp_path: Path, kind: str):
    from fieldgym.agents.sources import policy_source
    from fieldgym.kernels.config_files import load_yaml

    def made(name: str) -> Path:
        path = tmp_path / name
        if kind == "pipe":
            os.mkfifo(path)
        elif kind == "zeros":
            path.symlink_to("/dev/zero")
        else:
            path.touch()
            os.truncate(path, 2**40)
        return path

    with pytest.raises(ValueError, match="cannot be read: it "):
        load_yaml(made("s.yaml"))
    (tmp_path / "p.json").write_text("{}", "utf-8")
    for name in ("p.npz", "m.zip"):
        with pytest.raises(ValueError, match=r"cannot read .* \(it ") as error:
            policy_source(PICKER, str(made(name)), trust=True)
        one_line(error.value)
    with pytest.raises(ValueError, match=r"cannot read .* \(it "):
        policy_source(PICKER, f"{made('mine.py')}:Mine")


@pytest.mark.usefixtures("within")
@pytest.mark.parametrize("name", [store.EPISODES, store.BOUNDS])
@pytest.mark.parametrize("kind", ["a pipe", "a device"])
def test_results_are_not_written_into_pipes_and_devices(tmp_path: Path, name: str, kind: str):
    if kind == "a pipe":
        os.mkfifo(tmp_path / name)
    else:
        (tmp_path / name).symlink_to("/dev/null")
    for resume in (False, True):
        with pytest.raises(store.ResultsError, match=rf"cannot write results to .* \(it is {kind}, no file\)"):
            store.Results(tmp_path, store.manifest(small_suite()), resume)


def test_archives_that_unpack_to_more_than_is_read_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("stable_baselines3")
    from fieldgym.agents.learning import checkpoint, saved_model
    from fieldgym.agents.learning.runs import CheckpointError
    from fieldgym.agents.policies.weights import PolicyFileError

    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("data", bytes(5_000_000))
    for name in ("m.zip", "state.pt"):
        (tmp_path / name).write_bytes(made.getvalue())
    monkeypatch.setattr(saved_model, "MOST_BYTES", 10**6)
    monkeypatch.setattr(checkpoint, "MOST_BYTES", 10**6)
    env = gym.make(PICKER, backend="analytic")
    with pytest.raises(PolicyFileError, match="it unpacks to 5000000 bytes, at most 1000000 are read"):
        saved_model.load_model(tmp_path / "m.zip", env)
    with pytest.raises(CheckpointError, match="it unpacks to 5000000 bytes, at most 1000000 are read"):
        checkpoint.read(tmp_path / "state.pt")


@pytest.mark.parametrize(
    "line", ["[]", "3", '{"trial": "a", "net_rate": 3}', '{"trial": []}', "\\xff", "[" * 10**5, '{"trial": "x"}']
)
def test_kept_trials_that_are_none_are_played_again(tmp_path: Path, line: str):
    from fieldgym.benchmark.sensitivity import _Shelf

    file = tmp_path / "kept.jsonl"
    file.write_bytes(line.encode("latin-1").replace(b"\\xff", b"\xff") + b"\n")
    shelf = _Shelf(file)
    assert all(shelf.get(mark, ("net_rate",), 2) is None for mark in ("a", "x", "[]"))
    shelf.put("b", {"net_rate": [0.5, float("nan")]})
    kept = _Shelf(file).get("b", ("net_rate",), 2)
    assert kept is not None and kept["net_rate"][0] == 0.5 and np.isnan(kept["net_rate"][1])
    assert _Shelf(file).get("b", ("net_rate",), 3) is None


def test_a_folder_of_any_name_is_told_in_one_line(tmp_path: Path):
    folder = write(tmp_path / "two\nlines\x1b", [record("fixed-order", 1), {**record("fixed-order", 2), "seed": "x"}])
    words = [sys.executable, "-m", "fieldgym.scripts.cli", "report", str(folder), "--out", str(folder / "p.html")]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0
    assert all(line.startswith("fieldgym: ") and line.isprintable() for line in done.stderr.splitlines())
    assert "line 2 is left out" in done.stderr
    words[4] = str(folder / "none\n")
    done = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and done.stderr[:-1].isprintable()


def test_what_a_killed_writer_left_is_removed_by_the_next_one(tmp_path: Path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    others = (f".f.{os.getppid()}.part.json", ".g.1.part.json", ".f.x.part.json", f".f.g.{dead.pid}.part.json")
    for name in (f".f.{dead.pid}.part.json", *others):
        (tmp_path / name).touch()
    files.replace_file(tmp_path / "f.json", "new")
    assert {path.name for path in tmp_path.iterdir()} == {"f.json", *others}


def test_a_file_is_opened_once_it_is_known_to_be_one(tmp_path: Path):
    (tmp_path / "f").write_bytes(b"abc")
    with files.opened(tmp_path / "f", 3) as stream:
        assert stream.read() == b"abc"
    with pytest.raises(OSError, match="it has 3 bytes, at most 2 are read"), files.opened(tmp_path / "f", 2):
        pass
    assert files.unpacked_bytes(io.BytesIO(json.dumps({}).encode())) == 0
    files.appendable(tmp_path / "none")
    files.appendable(tmp_path / "f")
