"""Generated assets are current, and found wherever the package is installed."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import typer

from fieldgym.scripts import generate_assets
from fieldgym.simulation.assets import asset_path
from fieldgym.simulation.picker_model import PICKER_ASSET

ROOT = Path(__file__).resolve().parents[1]


def test_generated_assets_are_current() -> None:
    assert generate_assets.stale_assets() == {}, "run python scripts/generate_assets.py"


def test_missing_and_altered_files_are_stale_and_mended(tmp_path: Path) -> None:
    names = sorted(generate_assets.generated_assets())
    assert list(generate_assets.stale_assets(tmp_path)) == names
    assert generate_assets.write_assets(tmp_path) == names
    assert generate_assets.stale_assets(tmp_path) == {}
    (tmp_path / PICKER_ASSET).write_text("<robot/>")
    assert list(generate_assets.stale_assets(tmp_path)) == [PICKER_ASSET]
    assert generate_assets.write_assets(tmp_path) == [PICKER_ASSET]
    assert not list(tmp_path.rglob("*.new"))


def test_check_fails_on_a_stale_file(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    generate_assets.main(check=True)
    monkeypatch.setattr(generate_assets, "stale_assets", lambda: {"urdf/old.urdf": ""})
    with pytest.raises(typer.Exit) as ended:
        generate_assets.main(check=True)
    assert ended.value.exit_code == 1
    assert "assets/urdf/old.urdf is stale" in capsys.readouterr().err


def test_an_asset_is_a_real_file() -> None:
    with asset_path(PICKER_ASSET) as path:
        assert path.read_text(encoding="utf-8").startswith("<?xml")


def test_a_missing_asset_is_named() -> None:
    with pytest.raises(FileNotFoundError, match=r"urdf/nothing\.urdf"), asset_path("urdf/nothing.urdf"):
        pass


def test_assets_are_found_in_an_archive(tmp_path: Path) -> None:
    archive = tmp_path / "package.zip"
    with zipfile.ZipFile(archive, "w") as target:
        target.writestr("fieldgym/__init__.py", "")
        for room in ("simulation", "mechanisms", "motion", "assets"):
            for file in (ROOT / room).rglob("*"):
                if file.is_file() and "__pycache__" not in file.parts:
                    target.write(file, f"fieldgym/{file.relative_to(ROOT).as_posix()}")
    code = "from fieldgym.simulation.picker import PickerMachine; print(PickerMachine().tool_world())"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(archive)},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("[")
