"""The wheel holds every module and asset of the tree, and nothing else."""

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import fieldgym

pytestmark = pytest.mark.portable

ROOT = Path(__file__).resolve().parents[1]
NOT_PACKAGED = {"tests", "docs", "build", "dist", "results", "examples"}
"""Top-level folders whose Python files belong to the repository and not to the package."""


def tracked(path: Path) -> bool:
    """Whether a file below the root is source: not hidden, not a cache, not a build's output."""
    parts = path.relative_to(ROOT).parts
    return not any(part.startswith(".") or part == "__pycache__" or part.endswith(".egg-info") for part in parts)


def source_files() -> set[str]:
    """What has to be in the wheel, as paths below ``fieldgym/``."""
    files = {"py.typed"} | {path.name for path in ROOT.glob("*.py")}
    for room in ROOT.iterdir():
        if room.is_dir() and tracked(room) and room.name not in NOT_PACKAGED:
            kept = {".py", ".yaml", ".css", ".js"}
            files |= {
                path.relative_to(ROOT).as_posix()
                for path in room.rglob("*")
                if path.is_file() and tracked(path) and (room.name == "assets" or path.suffix in kept)
            }
    return files


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """The wheel of a copy of the tree: setuptools leaves its build folders beside the source."""
    folder = tmp_path_factory.mktemp("wheel")
    copy = folder / "source"
    ignored = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "results", "build", "dist")
    shutil.copytree(ROOT, copy, ignore=ignored)
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(copy)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return zipfile.ZipFile(next(folder.glob("*.whl")))


def test_wheel_holds_the_tree(wheel: zipfile.ZipFile) -> None:
    packaged = {name.removeprefix("fieldgym/") for name in wheel.namelist() if name.startswith("fieldgym/")}
    assert packaged == source_files(), "add the package or its files to pyproject.toml"


def test_every_folder_of_modules_is_a_listed_package() -> None:
    folders = {Path(file).parent for file in source_files() if file.endswith(".py")}
    without_init = {str(folder) for folder in folders if not (ROOT / folder / "__init__.py").exists()}
    assert not without_init
    listed = set(re.findall(r'^    "(fieldgym[.\w]*)",$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE))
    assert listed == {".".join(("fieldgym", *folder.parts)) for folder in folders}


def test_wheel_names_licence_and_command(wheel: zipfile.ZipFile) -> None:
    information = {name.split("/", 1)[1]: name for name in wheel.namelist() if ".dist-info/" in name}
    assert "licenses/LICENSE" in information
    assert b"fieldgym = fieldgym.scripts.cli:main" in wheel.read(information["entry_points.txt"])
    metadata = wheel.read(information["METADATA"]).decode()
    core = [line for line in metadata.splitlines() if line.startswith("Requires-Dist:") and "extra ==" not in line]
    assert not [line for line in core if "torch" in line or "matplotlib" in line]


def test_the_version_is_the_same_everywhere() -> None:
    version = re.search(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    assert version is not None
    assert fieldgym.__version__ == version[1]
    assert f"\nversion: {version[1]}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"\n## {version[1]}" in (ROOT / "CHANGELOG.md").read_text()


def test_constraints_pin_every_dependency() -> None:
    pinned = {
        re.split(r"[=;]", line)[0].strip()
        for line in (ROOT / "constraints.txt").read_text().splitlines()
        if line and not line.startswith("#")
    }
    lists = re.findall(r"^(?:dependencies|\w+) = \[(.*?)\]$", (ROOT / "pyproject.toml").read_text(), re.M | re.S)
    wanted = {
        name
        for text in lists
        for name in re.findall(r'"([a-z][a-z0-9-]*)(?:\[\w+\])?[><=]', text)
        if name not in {"setuptools"}
    }
    assert {"numpy", "pybullet", "torch", "pytest"} <= wanted
    assert wanted <= pinned
