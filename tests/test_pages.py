"""Every code block of every page runs, in a folder of its own; ``pages.NOT_RUN`` lists what does not, and why."""

import importlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pages
import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
MADE = {"_build", "made", "reproduction", "environments"}
AT_ROOT = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md")
PAGES = [ROOT / name for name in AT_ROOT] + sorted(
    path
    for path in DOCS.rglob("*.md")
    if not MADE & set(path.relative_to(DOCS).parts) and f"{path.stem.upper()}.md" not in AT_ROOT
)
LONG = tuple(
    f"docs/{name}.md" for name in ("benchmark", "commands", "learning", "pixels", "videos", "view", "your-machine")
)
"""Their commands, each of them played in other tests, take minutes."""
WITH_CODE = [page for page in PAGES if pages.blocks_of(page.read_text("utf-8"))]


def played(page: Path, folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, str(ROOT / "tests" / "pages.py"), str(page)],
        cwd=folder,
        env={**os.environ, "MINARI_DATASETS_PATH": str(folder / "minari"), "COLUMNS": "160", "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    return done.stdout


def _by_name(page: Path) -> Any:
    name = page.relative_to(ROOT).as_posix()
    return pytest.param(page, marks=[pytest.mark.long] * (name in LONG), id=name)


@pytest.mark.slow
@pytest.mark.parametrize("page", [_by_name(page) for page in WITH_CODE])
def test_the_code_of_a_page_runs(page: Path, tmp_path: Path) -> None:
    said = played(page, tmp_path)
    blocks = pages.blocks_of(page.read_text("utf-8"))
    told = said.count("runs: ") + said.count("left out: ")
    silent = sum(block.language in pages.SHOWN or bool(block.name) for block in blocks)
    skipped = sum(all(pages.left_out(command) for command in block.commands) for block in blocks if not block.name)
    assert told >= len(blocks) - silent - skipped


@pytest.mark.slow
@pytest.mark.parametrize("spec", [spec for spec in __import__("fieldgym").tasks() if spec.id.startswith("fieldgym/")],
                         ids=lambda spec: spec.name)  # fmt: skip
def test_the_code_of_an_environment_s_page_runs(spec: Any, tmp_path: Path) -> None:
    sys.path.insert(0, str(DOCS))
    try:
        environments: Any = importlib.import_module("fieldsite.environments")
    finally:
        sys.path.remove(str(DOCS))
    page = tmp_path / "page.md"
    page.write_text(environments.page(spec, "none.jpg", "", "", ""), "utf-8")
    assert played(page, tmp_path).count("runs: ") == 3


@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_block_is_code_that_runs_or_says_what_it_is(page: Path) -> None:
    """A block without a language is commands; every command runs, or its reason not to stands in the list."""
    for block in pages.blocks_of(page.read_text("utf-8")):
        if block.language in pages.SHOWN or block.name or block.language == "python":
            continue
        assert block.language in ("", "bash"), f"line {block.line}: {block.language}"
        for command in block.commands:
            assert command.startswith("fieldgym ") or pages.left_out(command), f"line {block.line}: {command}"


def test_what_is_not_run_is_on_a_page() -> None:
    """The list holds nothing that no page has any more."""
    commands = [
        command
        for page in WITH_CODE
        for block in pages.blocks_of(page.read_text("utf-8"))
        for command in block.commands
    ]
    for start in pages.NOT_RUN:
        assert any(command.startswith(start) for command in commands), start


def test_shortening_needs_what_it_shortens() -> None:
    block = pages.Block("python", "model.learn(1_000_000)\n", "1_000_000 -> 64", 1)
    assert block.shortened(block.body) == "model.learn(64)\n"
    with pytest.raises(ValueError, match="line 1: the block has no '2_000'"):
        pages.Block("python", "model.learn(1_000_000)\n", "2_000 -> 64", 1).shortened("")


def test_a_page_that_fails_fails(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```\nfieldgym list --nonsense\n```\n", "utf-8")
    with pytest.raises(AssertionError, match="nonsense"):
        played(page, tmp_path)
