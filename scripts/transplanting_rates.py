"""State stroke, lift, gripping time and rate of the transplanter together, for every way of moving.

    python scripts/transplanting_rates.py [--rate 100]

The paper's 100 transplants a minute name neither a stroke nor a gripping time. The table gives the rate out and back
over the full 600 mm and over 320 mm (the distance of the trays' middles), and the longest stroke at which the rate is
reached, all under 4.5 m/s and 60 m/s2.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

from rich.console import Console
from rich.table import Column, Table

from fieldgym.envs.transplanting.config import MOTIONS, MachineConfig, ProcessConfig

WIDEST_M = 0.900
_SHORTEST_M = 0.010


def longest_stroke_m(machine: MachineConfig, rate_per_min: float, handle_s: float) -> float | None:
    """Longest traverse at which ``rate_per_min`` is reached out and back, None when even 10 mm are too far.

    Args:
        machine: its motion, lift and limits count.
        rate_per_min: transplants a minute.
        handle_s: gripping and releasing, a cycle.
    """
    low, high = _SHORTEST_M, WIDEST_M
    if machine.round_trips_per_min(low, handle_s) < rate_per_min:
        # A gate with rounded corners can be faster over a longer stroke: try before giving up.
        strokes = [low + (high - low) * step / 30 for step in range(31)]
        reached = [s for s in strokes if machine.round_trips_per_min(s, handle_s) >= rate_per_min]
        if not reached:
            return None
        low = max(reached)
    if machine.round_trips_per_min(high, handle_s) >= rate_per_min:
        return high
    while high - low > 1e-5:
        middle = 0.5 * (low + high)
        if machine.round_trips_per_min(middle, handle_s) >= rate_per_min:
            low = middle
        else:
            high = middle
    return low


def main() -> None:
    """Compute and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--rate", type=float, default=100.0, help="transplants a minute (default 100, published)")
    options = parser.parse_args()
    process = ProcessConfig()
    table = Table(
        Column("motion", no_wrap=True),
        *("lift mm", "straight mm", "grip s", "600 mm /min", "320 mm /min", f"stroke for {options.rate:g}/min"),
    )
    for motion in MOTIONS:
        for lift_m, straight_m in ((0.150, 0.0), (0.150, 0.050), (0.050, 0.0)):
            if straight_m > 0.0 and motion.startswith("stop"):
                continue
            machine = replace(MachineConfig(), motion=motion, lift_m=lift_m, straight_m=straight_m)
            for handle_s in (0.0, process.grip_s + process.release_s):
                stroke_m = longest_stroke_m(machine, options.rate, handle_s)
                far = stroke_m is not None and stroke_m >= WIDEST_M
                words = "not reached" if stroke_m is None else f"{'over ' * far}{1e3 * stroke_m:.0f} mm"
                rates = (f"{machine.round_trips_per_min(across, handle_s):.1f}" for across in (0.600, 0.320))
                lengths = (f"{1e3 * length_m:.0f}" for length_m in (lift_m, straight_m))
                table.add_row(motion, *lengths, f"{handle_s:g}", *rates, words)
    Console().print(table)


if __name__ == "__main__":
    main()
