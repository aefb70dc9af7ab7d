"""The README's table: each environment's first line of the leaderboard. ``make leaderboard`` renews it."""

from __future__ import annotations

from pathlib import Path

from fieldgym.kernels.files import replace_file

from .leaderboard import Board, read
from .markdown import table

ROOT = Path(__file__).resolve().parents[2]
LEADERBOARD = ROOT / "docs" / "leaderboard.md"
PAGES = "README.md", "README.zh.md"
BEGIN, END = "<!-- leaderboard: make leaderboard writes these lines -->\n", "<!-- end of the leaderboard -->"
_HEADINGS = {
    "README.md": ("environment", "scenario", "best policy", "net rate, %", "the paper's own order", "bound, %"),
    "README.zh.md": ("环境", "场景", "最佳策略", "净作业率, %", "论文自身的顺序", "上界, %"),
}


def lines(name: str, leaderboard: Path = LEADERBOARD) -> str:
    """The table of a page by its name."""
    rows = [_row(board) for board in read(leaderboard).boards.values()]
    return table(_HEADINGS[name], rows, right=(3, 5))


def renewed(name: str, text: str, leaderboard: Path = LEADERBOARD) -> str:
    """A page's text with the leaderboard's present lines."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + lines(name, leaderboard).rstrip("\n") + "\n" + END + rest.split(END)[1]


def _row(board: Board) -> tuple[str, ...]:
    policies = [row[board.heading.index("policy")] for row in board.rows]
    rates = [board.column("net rate, %", row) for row in range(len(board.rows))]
    paper = next(row for row, policy in enumerate(policies) if policy.startswith("**"))
    reference = f"{policies[paper].strip('*')}, {rates[paper]}"
    bound = rates[policies.index("bound")] if "bound" in policies else "-"
    scenario = board.condition.split(" ")[0]
    return f"`{board.env_id}`", f"`{scenario}`", policies[0].strip("*"), rates[0], reference, bound


if __name__ == "__main__":
    for page in (ROOT / name for name in PAGES):
        replace_file(page, renewed(page.name, page.read_text("utf-8")))
