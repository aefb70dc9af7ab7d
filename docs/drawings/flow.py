"""Draw how a decision flows through the package into ``docs/decision-flow.svg``.

Run: ``python docs/drawings/flow.py [FOLDER]``.
"""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sheet import COLOURS, DOCS, folder_given, save

ONCE, EACH, OUTSIDE = COLOURS[3], COLOURS[1], COLOURS[2]
BOXES = {
    "seed": (0.0, 4.0, "seed", "of reset", ONCE),
    "field": (2.4, 4.0, "field", "one instance, all its luck", ONCE),
    "state": (5.2, 4.0, "state", "of the rules", EACH),
    "observation": (8.0, 4.0, "observation", "reports, never the truth", EACH),
    "policy": (8.0, 2.2, "policy", "chooses", OUTSIDE),
    "action": (8.0, 0.4, "action", "which, and how", EACH),
    "plan": (5.2, 0.4, "plan", "motions and phases", EACH),
    "executor": (2.4, 0.4, "executor", "as planned, or PyBullet", EACH),
    "outcome": (2.4, 2.2, "outcome", "seconds and places", EACH),
    "scores": (5.2, 2.2, "rewards, phases, scores", "by name", EACH),
}
"""Centre, name, words below it, colour."""
WAYS = (
    ("seed", "field", "draw"),
    ("field", "state", "load"),
    ("state", "observation", "observe"),
    ("observation", "policy", ""),
    ("policy", "action", "act"),
    ("action", "plan", "plan"),
    ("plan", "executor", ""),
    ("executor", "outcome", "execute"),
    ("outcome", "scores", "apply"),
    ("scores", "state", ""),
)
"""From, to, and the function between them."""
HALF_M = (0.95, 0.42)


def draw(canvas: Figure) -> None:
    """Boxes in a ring, arrows with the functions' names."""
    axes: Axes = canvas.subplots()
    axes.set_aspect("equal")
    axes.axis("off")
    for x, y, name, words, colour in BOXES.values():
        (w, h) = HALF_M
        axes.fill([x - w, x + w, x + w, x - w], [y - h, y - h, y + h, y + h], facecolor=colour, alpha=0.16)
        axes.plot([x - w, x + w, x + w, x - w, x - w], [y - h, y - h, y + h, y + h, y - h], color=colour, lw=1.2)
        axes.text(x, y + 0.13, name, ha="center", va="center", fontsize=9.5 if len(name) < 14 else 7.5, weight="bold")
        axes.text(x, y - 0.19, words, ha="center", va="center", fontsize=7, color="0.3")
    for start, end, name in WAYS:
        (x0, y0), (x1, y1) = BOXES[start][:2], BOXES[end][:2]
        across = abs(x1 - x0) > abs(y1 - y0)
        reach = HALF_M[0] if across else HALF_M[1]
        sign = 1.0 if (x1 > x0 if across else y1 > y0) else -1.0
        tail, tip = ((x0 + sign * reach, y0), (x1 - sign * reach, y1)) if across else (
            (x0, y0 + sign * reach), (x1, y1 - sign * reach)
        )  # fmt: skip
        axes.annotate("", tip, tail, arrowprops={"arrowstyle": "-|>", "color": "0.25", "lw": 1.2})
        middle = (0.5 * (tail[0] + tip[0]), 0.5 * (tail[1] + tip[1]))
        shift = (0.0, 0.17) if across else (0.42, 0.0)
        axes.text(
            middle[0] + shift[0], middle[1] + shift[1], name, ha="center", va="center", fontsize=8, style="italic"
        )
    axes.text(0.0, 3.2, "once an episode", ha="center", fontsize=8, color=ONCE)
    axes.text(0.0, 2.2, "every decision", ha="center", fontsize=8, color=EACH)
    axes.text(0.0, 1.2, "yours", ha="center", fontsize=8, color=OUTSIDE)


def main(folder: Path = DOCS) -> None:
    """Write the drawing into a folder."""
    save(draw, folder / "decision-flow.svg", (8.6, 4.4), {"font.size": 9})


if __name__ == "__main__":
    main(folder_given(DOCS))
