"""What the README and the Makefile promise."""

import re
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fieldgym.envs import env_ids, task
from fieldgym.scripts import cli

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text()


def test_the_examples_run(capsys: pytest.CaptureFixture[str]):
    blocks = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len(blocks) >= 2
    exec("\n".join(blocks), {})
    net_rate, cycle_time_s = map(float, capsys.readouterr().out.split())
    assert 0.0 <= net_rate <= 1.0
    assert cycle_time_s > 0.0


def test_every_command_exists_with_its_options():
    lines = re.findall(r"^fieldgym ([^#\n]+)", README, re.MULTILINE)
    assert {line.split()[0] for line in lines} == {command.name for command in cli.app.registered_commands}
    for line in lines:
        command, *words = line.split()
        known = CliRunner(env={"COLUMNS": "200"}).invoke(cli.app, [command, "--help"]).output
        for option in (word for word in words if word.startswith("--")):
            assert option in known, line


def test_the_table_has_every_environment_with_its_scenarios():
    for env_id in env_ids():
        row = next(line for line in README.splitlines() if line.startswith(f"| `{env_id}`"))
        assert all(f"`{scenario}`" in row for scenario in task(env_id).scenarios)


def test_linked_files_exist():
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", README):
        assert (ROOT / target).exists(), target


def test_make_without_a_fitting_python_says_what_to_install(tmp_path: Path):
    done = subprocess.run(
        ["make", "setup", f"VENV={tmp_path / 'venv'}", "PYTHON=/bin/false"],
        capture_output=True, text=True, check=False, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode != 0
    assert "fieldgym needs Python 3.10 or later" in done.stderr
    assert "make PYTHON=/path/to/python3.11" in done.stderr
    assert not (tmp_path / "venv").exists()
