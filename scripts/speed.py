"""How fast the package is, in one run, each figure beside its target, and where the time of steps goes.

    python scripts/speed.py [--quick] [--only SECTION] [--json FILE] [--peers] [--peers-python PYTHON]

Every figure is the best of several repetitions in CPU time of the one thread that does the work (another process on the
core costs repetitions, not figures), and what is compared is measured side by side in the same run. What threads bring
is by the wall's clock and needs idle cores: the first line of its section says whether they are. So is the live page's
rate, whose browser shares them.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from rich.console import Console

import fieldgym
from fieldgym.kernels.files import replace_file
from fieldgym.scripts.growth import machine_name
from fieldgym.scripts.speed_decisions import decisions
from fieldgym.scripts.speed_first_use import first_use
from fieldgym.scripts.speed_kinematics import kinematics
from fieldgym.scripts.speed_lines import Line, as_table
from fieldgym.scripts.speed_parts import profile, resets
from fieldgym.scripts.speed_peers import peers
from fieldgym.scripts.speed_pictures import looks, pictures, sights
from fieldgym.scripts.speed_threads import threads
from fieldgym.scripts.speed_viewer import training, viewer


def tracking(_: bool) -> Iterator[Line]:
    """Tracking and closure on the fastest motion that picking commands."""
    from fieldgym.simulation.picker import measure_tracking

    report = measure_tracking()
    yield Line("picker's fastest gate, tracking", 1e3 * report.arm_error_m, "mm", 0.3, True)
    yield Line("picker's fastest gate, closure", 1e3 * report.closure_error_m, "mm", 0.3, True)


SECTIONS: dict[str, Callable[[bool], Iterator[Line]]] = {
    "first-use": first_use,
    "kinematics": kinematics,
    "decisions": decisions,
    "resets": resets,
    "threads": threads,
    "profile": profile,
    "pictures": pictures,
    "sights": sights,
    "looks": looks,
    "tracking": tracking,
    "viewer": viewer,
    "training": training,
}


def as_json(found: dict[str, list[dict[str, object]]]) -> str:
    """Sections of figures, with what they were measured on."""
    words = ["python", "scripts/speed.py", *sys.argv[1:]]
    said = {"version": fieldgym.__version__, "date": time.strftime("%Y-%m-%d"), "machine": machine_name()}
    return json.dumps(said | {"command": shlex.join(words), "sections": found}, indent=1) + "\n"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="fewer repetitions, nothing compiled anew")
    parser.add_argument("--only", choices=SECTIONS, metavar="SECTION", help=f"one of {', '.join(SECTIONS)}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures there, for docs/speed.md")
    parser.add_argument("--peers", action="store_true", help="other packages' environments instead")
    parser.add_argument("--peers-python", type=Path, metavar="PYTHON", help="interpreter that has them")
    options = parser.parse_args()
    console = Console(width=100, highlight=False)
    chosen = {options.only: SECTIONS[options.only]} if options.only else SECTIONS
    if options.peers:
        chosen = {"peers": lambda quick: peers(quick, options.peers_python)}
    found = {}
    for name, measure in chosen.items():
        lines: list[Line] = []
        with console.status(f"measuring: {name}") as status:
            for line in measure(options.quick):
                lines.append(line)
                status.update(f"measuring: {name}, after {line.what}")
        console.print(as_table(f"fieldgym {fieldgym.__version__}: {name}", lines))
        found[name] = [line._asdict() for line in lines]
        if options.json is not None:
            replace_file(options.json, as_json(found))


if __name__ == "__main__":
    main()
