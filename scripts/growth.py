"""How cost grows: measure every curve and write its chart and the page ``docs/scaling.md``.

    python scripts/growth.py [--only SECTION] [--fresh] [--out docs]

Curves that were measured already lie in ``scaling/figures.json`` of that folder and are kept, so that a run goes on
where another one ended; ``--fresh`` measures them anew.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from fieldgym.scripts.growth_measures import Growth, growths

BUSY = 1.5
"""Load average from which on a page says that its figures are not a quiet machine's."""
BY_HAND = "\n## What is missed, and where the time goes\n"
"""Heading of what people wrote behind the curves; it is kept."""
_INTRODUCTION = """# How cost grows

What one more of something costs, measured by `python scripts/growth.py` (it goes on where it was stopped; `--fresh`
measures anew, `--only` one section) on {machine}.
Milliseconds are CPU time of the one thread that works, the best of several repetitions; seconds of workers are by the
wall's clock. Each exponent p is the slope of a straight line through the logarithms of the upper half of a curve's
points: cost ~ size^p. What starts flat has a fixed cost that small sizes do not outgrow.
"""


def exponent(points: list[list[float]]) -> float | None:
    """Slope of the upper half of a curve in logarithms, from three points on; None for fewer points than two."""
    if len(points) < 2:
        return None
    upper = np.log(np.array(points)[-max(3, (len(points) + 1) // 2) :])
    return float(np.polyfit(upper[:, 0], upper[:, 1], 1)[0])


def machine_name() -> str:
    """Processor, cores and Python."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text("utf-8").splitlines()
        models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
        name = models[0] if models else name
    return f"{name}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"


def chart(growth: Growth, curves: dict[str, list[list[float]]], path: Path) -> None:
    """Draw curves over logarithmic axes, with their exponents in the legend."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    matplotlib.rcParams["svg.hashsalt"] = "fieldgym"
    figure, axes = plt.subplots(figsize=(5.6, 3.6))
    for name, points in curves.items():
        if points:
            slope = exponent(points)
            label = name if slope is None else f"{name}: p = {slope:.2f}"
            axes.loglog(*np.array(points).T, "o-", label=label)
    axes.set(xlabel=growth.size, ylabel=growth.cost, title=growth.title)
    axes.grid(True, which="both", alpha=0.3)
    axes.legend()
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def page(figures: dict[str, Any], sections: dict[str, Growth]) -> str:
    """The page's text: a chart and a table a section."""
    parts = [_INTRODUCTION.format(machine=figures["machine"])]
    for name, growth in sections.items():
        curves = figures["sections"].get(name)
        if curves is None:
            continue
        parts.append(f"\n## {growth.title}\n\n![{growth.cost} over {growth.size}](scaling/{name}.svg)\n")
        if figures["load"].get(name, 0.0) > BUSY:
            parts.append(f"\nMeasured while the machine was busy (load average {figures['load'][name]}).\n")
        parts.append(f"\n| {growth.size} | {growth.cost} | p |\n|---|---|---|\n")
        for curve, points in curves.items():
            if not points:
                parts.append(f"| {curve}: not measured, it is not installed | | |\n")
                continue
            sizes = ", ".join(f"{size:,.4g}" if size < 1e4 else f"{size:,.0f}" for size, _ in points)
            costs = ", ".join(f"{cost:.3g}" for _, cost in points)
            parts.append(f"| {curve}: {sizes} | {costs} | {exponent(points) or float('nan'):.2f} |\n")
    return "".join(parts)


def by_hand(text: str) -> str:
    """What of the page's text was not measured here: the section on what is missed, to its end."""
    _, found, rest = text.partition(BY_HAND)
    return found + rest


def main() -> None:
    """Measure what is missing, write charts and page after every section."""
    sections = growths()
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--only", choices=sections, metavar="SECTION", help=f"one of {', '.join(sections)}")
    parser.add_argument("--fresh", action="store_true", help="measure again what was measured already")
    parser.add_argument("--out", type=Path, default=Path("docs"), help="folder of the page")
    options = parser.parse_args()
    folder = options.out / "scaling"
    folder.mkdir(parents=True, exist_ok=True)
    kept, console = folder / "figures.json", Console(highlight=False)
    figures: dict[str, Any] = {"machine": machine_name(), "sections": {}, "load": {}}
    if kept.exists():
        earlier = json.loads(kept.read_text(encoding="utf-8"))
        if earlier["machine"] == figures["machine"]:
            figures = earlier
    for name, growth in sections.items():
        if options.only not in (None, name) or (name in figures["sections"] and not options.fresh):
            continue
        # Before, for the workers of a section are a load themselves.
        figures["load"][name] = round(os.getloadavg()[0], 1)
        measured: dict[str, list[list[float]]] = {}
        for curve, points in growth.curves.items():
            measured[curve] = []
            with console.status(f"{name}: {curve}") as status:
                for size, cost in points():
                    measured[curve].append([float(size), float(f"{cost:.4g}")])
                    status.update(f"{name}: {curve}, {size:,.0f} measured")
        figures["sections"][name] = measured
        kept.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
        chart(growth, measured, folder / f"{name}.svg")
        slopes = {curve: exponent(points) for curve, points in measured.items()}
        console.print(f"{name}: " + ", ".join(f"{k} p = {p:.2f}" for k, p in slopes.items() if p is not None))
    text = options.out / "scaling.md"
    written = by_hand(text.read_text(encoding="utf-8")) if text.exists() else ""
    text.write_text(page(figures, sections) + written, encoding="utf-8")


if __name__ == "__main__":
    main()
