"""Write the generated files under ``assets/`` from the parameters in the code, or check that they are current."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from fieldgym.kernels.files import replace_file
from fieldgym.simulation.hoe_model import HoeParameters
from fieldgym.simulation.picker_model import PICKER_ASSET, PickerParameters, picker_robot
from fieldgym.simulation.sorter_model import SorterParameters
from fieldgym.simulation.transplanter_model import PHYSICS_ASSET, TransplanterParameters, transplanter_robot
from fieldgym.simulation.weeder_model import WEEDER_ASSET, WeederParameters, weeder_robot

ASSETS = Path(__file__).resolve().parent.parent / "assets"


def generated_assets() -> dict[str, str]:
    """Text of every generated file, by its path below ``assets/``."""
    prrs = HoeParameters().assets() | SorterParameters().assets()
    trees = {
        PICKER_ASSET: picker_robot(PickerParameters()),
        PHYSICS_ASSET: transplanter_robot(TransplanterParameters()),
        WEEDER_ASSET: weeder_robot(WeederParameters()),
    }
    return dict(sorted((prrs | {name: robot.to_xml() for name, robot in trees.items()}).items()))


def stale_assets(folder: Path = ASSETS) -> dict[str, str]:
    """Text by name of the generated files that are missing from ``folder`` or differ from what the code would write."""

    def current(path: Path, text: str) -> bool:
        return path.is_file() and path.read_text(encoding="utf-8") == text

    return {name: text for name, text in generated_assets().items() if not current(folder / name, text)}


def write_assets(folder: Path = ASSETS) -> list[str]:
    """Write the files that are stale; returns their names."""
    stale = stale_assets(folder)
    for name, text in stale.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        replace_file(folder / name, text)
    return list(stale)


def main(
    check: Annotated[bool, typer.Option("--check", help="Write nothing; fail when a file is not current.")] = False,
) -> None:
    """Write the generated files under ``assets/`` from the parameters in the code, or check that they are current."""
    if not check:
        for name in write_assets():
            print(f"wrote assets/{name}")
    elif stale := stale_assets():
        for name in stale:
            print(f"assets/{name} is stale: run python scripts/generate_assets.py", file=sys.stderr)
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
