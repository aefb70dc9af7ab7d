"""What the README and the Makefile promise."""

import importlib
import re
import subprocess
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from fieldgym.envs import env_ids, task
from fieldgym.scripts import cli, moving_pictures

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text("utf-8")
USING, COMMANDS, LEADERBOARD = (
    (ROOT / "docs" / f"{name}.md").read_text("utf-8") for name in ("using", "commands", "leaderboard")
)
MEDIA = ROOT / "docs" / "media"


@pytest.fixture
def front_page(monkeypatch: pytest.MonkeyPatch) -> Any:
    """What writes the README's table."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    return importlib.import_module("fieldsite.front_page")


@pytest.mark.parametrize("page", [README, USING], ids=["README", "using"])
def test_the_examples_run(capsys: pytest.CaptureFixture[str], page: str):
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(blocks) == 2
    known: dict[str, Any] = {}
    exec("\n".join(blocks), known)
    net_rate, cycle_time_s = map(float, capsys.readouterr().out.split())
    assert 0.0 <= net_rate <= 1.0
    assert cycle_time_s > 0.0
    if page is README:
        mask = np.array([[0, 0, 1, 1], [1, 0, 0, 1]], np.int8)
        assert known["First"](None, 0).act({"action_mask": mask}).tolist() == [2, 0]


def test_it_is_short_and_shows_what_this_is():
    assert len(README.splitlines()) < 150
    pictures = [ROOT / name for name in re.findall(r"!\[[^]]+\]\(([^)]+)\)", README)]
    assert [path.name for path in pictures] == ["machines.webp", "view.jpg", "report.jpg"]
    assert all(path.exists() for path in pictures)


def test_every_environment_has_a_moving_picture_and_all_of_them_are_small():
    shown = {path.stem for path in MEDIA.glob("*.webp")}
    assert shown == {"machines", *(moving_pictures.slug(task(env_id).name) for env_id in env_ids())}
    assert set(moving_pictures.TAKES) == {task(env_id).name for env_id in env_ids()}
    assert sum(path.stat().st_size for path in MEDIA.iterdir()) < 3e6
    for path in MEDIA.glob("*.webp"):
        assert path.read_bytes()[:4] == b"RIFF" and b"ANIM" in path.read_bytes()[:64], path


def test_a_moving_picture_moves():
    frames = moving_pictures.shot("HoeWeeding-v0", moving_pictures.TAKES["HoeWeeding-v0"]._replace(after=2), 3)
    assert [frame.shape for frame in frames] == [(240, 320, 3)] * 3
    assert all((a != b).any() for a, b in pairwise(frames))
    assert moving_pictures.beside([frames] * 4)[0].shape == (480, 640, 3)


def test_the_leaderboard_at_a_glance_is_the_leaderboard_s(front_page: Any):
    """``PYTHONPATH=docs python -m fieldsite.front_page`` renews it."""
    headlines = LEADERBOARD.partition("\n## Where the order matters")[0]
    first = [line.split("|") for line in headlines.splitlines() if line.startswith("| 1 |")]
    shown = [line.split("|") for line in README.splitlines() if line.startswith("| `fieldgym/")]
    assert [cells[1].strip(" `") for cells in shown] == list(env_ids())
    for cells, top in zip(shown, first, strict=True):
        assert cells[3].strip() == top[2].strip(" *") and cells[4].strip() == top[3].split("<br>")[0].strip()
        section = LEADERBOARD[LEADERBOARD.index(f"{cells[1].strip()}, ") :]
        policy, rate = cells[5].strip().split(", ")
        assert f"| **{policy}** | {rate}<br>" in section
        assert f"|  | bound | {cells[6].strip()}<br>" in section
    for name in front_page.PAGES:
        page = (ROOT / name).read_text("utf-8")
        assert front_page.renewed(name, page) == page


def test_every_command_exists_with_its_options():
    lines = re.findall(r"^fieldgym ([^#\n]+)", COMMANDS, re.MULTILINE)
    assert {line.split()[0] for line in lines} == {command.name for command in cli.app.registered_commands}
    for line in [*lines, *re.findall(r"^(?:.venv/bin/)?fieldgym ([^#\n]+)", README, re.MULTILINE)]:
        command, *words = line.split()
        path = [command, words.pop(0)] if command == "field" else [command]
        known = CliRunner(env={"COLUMNS": "200"}).invoke(cli.app, [*path, "--help"]).output
        for option in (word for word in words if word.startswith("--")):
            assert option in known, line


def test_the_table_has_every_environment_with_its_scenarios():
    for env_id in env_ids():
        row = next(line for line in USING.splitlines() if line.startswith(f"| `{env_id}`"))
        assert all(f"`{scenario}`" in row for scenario in task(env_id).scenarios)


@pytest.mark.parametrize("name", ["README.md", "README.zh.md", "docs/using.md", "docs/commands.md", "docs/measured.md"])
def test_linked_files_exist(name: str):
    page = ROOT / name
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", page.read_text("utf-8")):
        assert (page.parent / target).exists(), target


def test_make_without_a_fitting_python_says_what_to_install(tmp_path: Path):
    done = subprocess.run(
        ["make", "setup", f"VENV={tmp_path / 'venv'}", "PYTHON=/bin/false"],
        capture_output=True, text=True, check=False, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode != 0
    assert "fieldgym needs Python 3.10 or later" in done.stderr
    assert "make PYTHON=/path/to/python3.11" in done.stderr
    assert not (tmp_path / "venv").exists()
