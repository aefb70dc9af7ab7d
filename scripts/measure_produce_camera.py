"""Measure the sorter's camera on rendered belts and fit the statistical camera to it.

    python scripts/measure_produce_camera.py [--frames 240] [--out assets/perception/sorting.json]

In every scenario in turn it renders images of streams that no benchmark uses, one each step of the belt as the machine
takes them, adds the sensor's noise and finds the produce; see ``fieldgym.envs.sorting.calibration``.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from fieldgym.envs.sorting.calibration import measure
from fieldgym.envs.sorting.config import GRADES
from fieldgym.kernels.files import replace_file


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=240)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent.parent / "assets/perception/sorting.json")
    options = parser.parse_args()
    if options.frames < 1:
        parser.error("--frames must be at least 1")
    result = measure(options.frames)
    text = json.dumps(result, indent=2) + "\n"
    replace_file(options.out, text)
    print(text, end="")
    print(f"grades: {', '.join(GRADES)}; wrote {options.out}")


if __name__ == "__main__":
    main()
