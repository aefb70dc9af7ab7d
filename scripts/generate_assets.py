"""Write the generated files under ``assets/`` from the parameters in the code, or check that they are current."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from fieldgym.kernels.files import replace_file
from fieldgym.simulation.hoe_model import HoeParameters
from fieldgym.simulation.picker_model import picker_assets
from fieldgym.simulation.sorter_model import SorterParameters
from fieldgym.simulation.transplanter_model import transplanter_assets
from fieldgym.simulation.weeder_model import weeder_assets

ASSETS = Path(__file__).resolve().parent.parent / "assets"


def generated_assets() -> dict[str, str]:
    """Text of every generated file, by its path below ``assets/``."""
    prrs = HoeParameters().assets() | SorterParameters().assets()
    return dict(sorted((picker_assets() | prrs | transplanter_assets() | weeder_assets()).items()))


def stale_assets(folder: Path = ASSETS) -> list[str]:
    """Names of the generated files that are missing from ``folder`` or differ from what the code would write."""
    stale = []
    for name, text in generated_assets().items():
        path = folder / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            stale.append(name)
    return stale


def write_assets(folder: Path = ASSETS) -> list[str]:
    """Write the files that are stale; returns their names."""
    stale = stale_assets(folder)
    for name in stale:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, generated_assets()[name])
    return stale


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; fail when a file is not current")
    if parser.parse_args(arguments).check:
        stale = stale_assets()
        for name in stale:
            print(f"assets/{name} is stale: run python scripts/generate_assets.py", file=sys.stderr)
        return 1 if stale else 0
    for name in write_assets():
        print(f"wrote assets/{name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
