"""What runs on GitHub names Pythons, files and extras that there are, and the security page says what the code does."""

import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
PROJECT = (ROOT / "pyproject.toml").read_text("utf-8")
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def jobs_of(path: Path) -> dict[str, Any]:
    return yaml.safe_load(path.read_text("utf-8"))["jobs"]


def runs_of(path: Path) -> list[str]:
    return [step["run"] for job in jobs_of(path).values() for step in job["steps"] if "run" in step]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_is_whole(path: Path) -> None:
    text = yaml.safe_load(path.read_text("utf-8"))
    # YAML takes the word "on" for true.
    assert text.keys() >= {"name", True, "permissions", "jobs"}
    assert text["permissions"] == {"contents": "read"}
    for name, job in jobs_of(path).items():
        assert job.keys() >= {"runs-on", "steps", "timeout-minutes"}, name
        assert job["steps"][0]["uses"].startswith("actions/checkout@v"), name
        for step in job["steps"]:
            assert len(step.keys() & {"uses", "run"}) == 1, (name, step)


def test_every_python_of_the_package_is_tested_on_linux_and_macos() -> None:
    matrix = jobs_of(ROOT / ".github" / "workflows" / "ci.yml")["tests"]["strategy"]["matrix"]
    assert matrix["python"] == re.findall(r'"Programming Language :: Python :: (3\.\d+)"', PROJECT)
    assert {name.split("-")[0] for name in matrix["os"]} == {"ubuntu", "macos"}
    make = (ROOT / "Makefile").read_text("utf-8")
    tried = re.search(r"for version in ([\d. ]+);", make)
    assert tried is not None and sorted(tried[1].split(), key=lambda v: int(v[2:])) == matrix["python"]


def test_make_finds_one_python_of_each_version_and_the_preferred_one_first(tmp_path: Path) -> None:
    """Beside those of the machine, pyenv's: a folder that looks like it, with stand-ins that tell a version."""
    for version in ("3.10.1", "3.12.2", "3.13.0", "3.14.0", "2.7.18"):
        python = tmp_path / "versions" / version / "bin" / "python"
        python.parent.mkdir(parents=True)
        minor = ".".join(version.split(".")[:2])
        python.write_text(f'#!/bin/sh\ncase "$2" in *\'!= "{minor}"\'*) exit 0 ;; *) exit 1 ;; esac\n')
        python.chmod(0o755)
    command = ["make", "--silent", "--no-print-directory", "pythons", f"PYENV_ROOT={tmp_path}"]
    path = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}
    found = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT, env=path).stdout.split()
    ours = [Path(name).parts[-3] for name in found if name.startswith(str(tmp_path))]
    # The system's own come before pyenv's of the same version; it has one or two of these at most.
    assert ours and ours == [name for name in ("3.10.1", "3.12.2", "3.13.0") if name in ours]
    assert len(set(found)) == len(found) >= 3


def test_ci_tries_every_python_that_there_is() -> None:
    run, portable = ((ROOT / ".ci" / name).read_text("utf-8") for name in ("run", "portable"))
    assert "make --silent --no-print-directory pythons | tail -n +2" in run and ".ci/portable $python" in run
    assert "digests.py" in run and "digests.py" in portable and "make test-portable" in portable
    assert all(f"make {target}" in run for target in ("setup lint", "test", "test-slow"))
    # What CI leaves out is run elsewhere.
    make = (ROOT / "Makefile").read_text("utf-8")
    assert '-m "slow and not long"' in make and "-m long" in make
    assert any(command.startswith("make test-long") for command in runs_of(ROOT / ".github" / "workflows" / "long.yml"))
    assert all((ROOT / ".ci" / name).stat().st_mode & 0o111 for name in ("run", "portable"))


def test_tests_run_side_by_side_in_an_order_of_chance_wherever_they_run() -> None:
    assert '"pytest-random-order' in PROJECT and '"pytest-xdist' in PROJECT
    make = (ROOT / "Makefile").read_text("utf-8")
    (command,) = re.findall(r"^PYTEST = (.*)$", make, re.M)
    assert " -n $(JOBS) " in command and " --random-order-seed=$(ORDER) " in command
    for target in ("test", "test-portable", "test-slow", "test-long"):
        assert re.search(rf"^{target}: .*\n\t\$\(PYTEST\) ", make, re.M), target
    tested = [run for path in WORKFLOWS for run in runs_of(path) if "-m pytest" in run and "test_" not in run]
    assert tested and all(" -n auto --random-order-seed=" in run for run in tested)


def test_what_is_run_is_there() -> None:
    extras = set(re.findall(r"^(\w+) = \[", PROJECT.split("[project.optional-dependencies]")[1].split("\n[")[0], re.M))
    commands = "\n".join(run for path in WORKFLOWS for run in runs_of(path))
    asked = re.findall(r'"\.\[(\w+)\]"', commands)
    assert {"test", "all", "dev"} == set(asked) <= extras
    files = re.findall(r"tests/\w+\.py|constraints\.txt", commands)
    assert files and all((ROOT / file).exists() for file in files)
    assert "twine check --strict" in commands


def test_nothing_that_is_loaded_runs_code_but_where_the_security_page_says_so() -> None:
    """Loaders that run what they read stand where SECURITY.md names them, and nowhere else."""
    running = (
        r"\bpickle\.loads?\(|allow_pickle=True|weights_only=False|\byaml\.(?:unsafe_|full_)?load\(|\bmarshal\.|\bexec\("
    )
    found = {
        path.relative_to(ROOT).as_posix()
        for path in ROOT.rglob("*.py")
        if path.relative_to(ROOT).parts[0] not in ("tests", "docs", "build", ".venv")
        and re.search(running, path.read_text("utf-8"))
    }
    # A policy's own file, and the kept machine code.
    assert found == {"agents/foreign.py", "kernels/keeping.py"}
    page = (ROOT / "SECURITY.md").read_text("utf-8")
    assert all(word in page for word in ("FILE.py:NAME", "NUMBA_CACHE_DIR", "--trust", "entry points"))
