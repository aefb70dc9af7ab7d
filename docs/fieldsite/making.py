"""Write what the site is made of beside the pages that people write."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from fieldgym.envs.task import TaskSpec, tasks
from fieldgym.kernels.files import replace_file

from . import environments, history, leaderboard, pictures, speed

DOCS = Path(__file__).resolve().parents[1]
ROOT = DOCS.parent
ROOT_PAGES = {"CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md", "SECURITY.md": "security.md"}
"""Pages that stand at the root, and what the site calls them."""
_FROM = ("agents", "assets", "envs", "kernels", "mechanisms", "motion", "papers", "perception", "rendering", "viewer")
"""Rooms that decide how pictures, replays and the reproduction come out."""


def everything(docs: Path = DOCS, tell: Callable[[str], None] = print) -> None:
    """Write all of it below ``docs``; pictures, replays and the reproduction only where the code has changed.

    REPLAYS=no in the environment leaves replays out, which take minutes; pages do not link to them then.

    Args:
        docs: folder of the pages.
        tell: is told what takes a moment.
    """
    state = digest()
    # Sphinx copies it as it is, and warns where it is missing.
    (docs / "made" / "extra").mkdir(parents=True, exist_ok=True)
    own = [spec for spec in tasks() if spec.id.startswith("fieldgym/")]
    for spec in own:
        name = environments.slug(spec)
        if pictures.moving(docs / "media", name) is None:
            fresh(docs / "made" / f"{name}.jpg", state, tell, lambda to, spec=spec: pictures.still(spec, to))
        if os.environ.get("REPLAYS") != "no" and find_spec("viser") is not None:
            to = docs / "made" / "extra" / "replays" / f"{name}.html"
            fresh(to, state, tell, lambda to, spec=spec: pictures.replay(spec, to))
    fresh(docs / "reproduction" / "index.md", state, tell, _reproduce)
    pages(docs, own)


def pages(docs: Path, own: list[TaskSpec]) -> None:
    """Write the pages that need no drawing."""
    found = leaderboard.read(DOCS / "leaderboard.md")
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    shown = {}
    for spec in own:
        name = environments.slug(spec)
        picture = pictures.moving(docs / "media", name) or docs / "made" / f"{name}.jpg"
        shown[spec.id] = os.path.relpath(picture, docs)
        replay = f"../replays/{name}.html" if (docs / "made" / "extra" / "replays" / f"{name}.html").exists() else ""
        board = _board(found, spec)
        text = environments.page(spec, f"../{shown[spec.id]}", board, history.of(spec, changelog), replay)
        written(docs / "environments" / f"{name}.md", text)
    links = {spec.id: f"[{environments.title(spec)}](environments/{environments.slug(spec)}.md)" for spec in own}
    glance = leaderboard.glance(found, links)
    written(docs / "made" / "glance.md", f"{glance}\n{found.stamp}; `make leaderboard` renews it.\n\n{found.caution}\n")
    written(docs / "made" / "cards.md", _cards(own, shown))
    for name, page in ROOT_PAGES.items():
        written(docs / page, from_root((ROOT / name).read_text("utf-8")))
    written(docs / "made" / "speed.md", speed.text(DOCS / "speed.json"))


def _board(found: leaderboard.Leaderboard, spec: TaskSpec) -> str:
    board = found.boards.get(spec.id)
    if board is None:
        return "Not yet on the [leaderboard](../leaderboard.md)."
    return f"""{board.condition[0].upper()}{board.condition[1:]}; means with 95 % bootstrap intervals, the paper's own
order in bold. {found.stamp}; the whole table is on the [leaderboard](../leaderboard.md).

{leaderboard.slice_of(board)}
{found.caution}"""


def from_root(text: str) -> str:
    """A page of the root with links that lead from within ``docs``."""

    def led(found: re.Match[str]) -> str:
        target = {**ROOT_PAGES, "README.md": "index.md"}.get(found[1], found[1].removeprefix("docs/"))
        return f"]({target})"

    return re.sub(r"\]\(([\w./-]+)\)", led, text)


def _cards(own: list[TaskSpec], shown: dict[str, str]) -> str:
    text = ["::::{container} cards"]
    for spec in own:
        name, target = environments.title(spec), f"environments/{environments.slug(spec)}.md"
        text += [
            ":::{container} card",
            f"[![{name}]({shown[spec.id]})]({target})\n",
            f"**[{name}]({target})**: {spec.decision}\n",
            ":::",
        ]
    return "\n".join([*text, "::::", ""])


def _reproduce(index: Path) -> None:
    from fieldgym.papers import report

    report.reproduce(report.CHAPTERS, index.parent, processes=1)


def digest() -> str:
    """Digest of the modules and assets that pictures and figures are computed from."""
    total = hashlib.sha256()
    files = [path for room in _FROM for path in (ROOT / room).rglob("*") if path.is_file() and path.suffix != ".pyc"]
    for path in sorted(files):
        total.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return total.hexdigest()


def fresh(target: Path, state: str, tell: Callable[[str], None], make: Callable[[Path], None]) -> None:
    """Make a file, unless it was made from the same state of the code."""
    mark = DOCS / "made" / "digests" / target.name
    if target.exists() and mark.exists() and mark.read_text("utf-8") == state:
        return
    tell(f"making {target.relative_to(target.parents[1])}")
    make(target)
    mark.parent.mkdir(parents=True, exist_ok=True)
    replace_file(mark, state)


def written(target: Path, text: str) -> None:
    """Write a page, unless it stands there already: Sphinx reads again what is newer than its own notes."""
    if target.exists() and target.read_text("utf-8") == text:
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    replace_file(target, text)
