"""The examples, run as a stranger would: installed beside the package, from an empty folder, by the command."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
STRAWBERRY = "farm/StrawberryPicking-v0"


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """What pip leaves of ``examples/strawberry`` and of a package whose entry point is broken."""
    site = tmp_path_factory.mktemp("site")
    shutil.copy(EXAMPLES / "strawberry" / "strawberry.py", site)
    for name, group, target in (
        ("strawberry", "fieldgym.tasks", "strawberry:SPEC"),
        ("broken", "fieldgym.policies", "nothing_here:register"),
    ):
        folder = site / f"{name}-0.1.0.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.1.0\n")
        (folder / "entry_points.txt").write_text(f"[{group}]\n{name} = {target}\n")
    return site


@pytest.fixture
def command(installed, tmp_path):
    """Runs ``fieldgym`` in an empty folder; gives what it printed and said."""
    before = os.environ.get("PYTHONPATH")
    path = os.pathsep.join(filter(None, (str(installed), before)))

    def call(*words: str) -> tuple[str, str]:
        done = subprocess.run(
            [sys.executable, "-m", "fieldgym.scripts.cli", *words],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": path, "COLUMNS": "160"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout, done.stderr

    return call


def test_an_installed_task_is_listed_and_a_broken_plug_in_named_in_one_line(command):
    out, err = command("list")
    assert STRAWBERRY in out and "fieldgym/HoeWeeding-v0" in out
    (line,) = err.splitlines()
    assert "'broken'" in line and "nothing_here" in line


def test_the_strawberry_task_runs_and_is_benchmarked(command, tmp_path):
    shutil.copy(EXAMPLES / "strawberry" / "wall.csv", tmp_path)
    out, _ = command("run", STRAWBERRY)
    assert "net_rate" in out and "leave" not in out.splitlines()[3]
    out, _ = command("benchmark", "--env", STRAWBERRY, "--policies", "nearest,random", "--episodes", "4", "--jobs", "1")
    assert "nearest" in out and "random" in out
    out, _ = command("field", "check", "wall.csv", "--env", STRAWBERRY)
    assert "5" in out


@pytest.mark.slow
def test_the_strawberry_task_is_learned(command, tmp_path):
    pytest.importorskip("sb3_contrib")
    (tmp_path / "small.yaml").write_text(
        "defaults: {num_envs: 8, n_steps: 16, batch_size: 64, evaluation_episodes: 4}\n"
    )
    out, _ = command("train", STRAWBERRY, "--steps", "128", "--config", "small.yaml", "--out", "run")
    assert "chosen on, after 128 decisions" in out and (tmp_path / "run" / "best.npz").exists()
    out, _ = command("evaluate", STRAWBERRY, "--policy", "run/best.npz", "--episodes", "3")
    assert "nearest" in out


def test_a_policy_of_one_s_own_is_benchmarked_beside_the_package_s(command, tmp_path):
    shutil.copy(EXAMPLES / "my_policy.py", tmp_path)
    shutil.copy(EXAMPLES / "my_field.csv", tmp_path)
    mine = "my_policy.py:LowDoseFirst"
    words = ("--policies", f"fifo,{mine}", "--episodes", "3", "--backend", "analytic", "--jobs", "1")
    out, _ = command("benchmark", "--env", "LaserWeeding", *words)
    assert mine in out and "fifo" in out
    (tmp_path / "fields").mkdir()
    (tmp_path / "my_field.csv").rename(tmp_path / "fields" / "my_field.csv")
    out, _ = command("evaluate", "LaserWeeding", "--policy", mine, "--backend", "analytic", "--fields", "fields")
    assert mine in out


def test_the_example_is_short():
    assert len((EXAMPLES / "strawberry" / "strawberry.py").read_text().splitlines()) < 150
