"""Follow every link within a built site, ``python -m fieldsite.links docs/_build/html``; others are counted."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

_LINKS = {"href", "src", "poster", "data"}
_WITHOUT = "genindex", "search", "py-modindex"
"""Pages that Sphinx makes of its own."""


class Page(NamedTuple):
    """What a page has.

    Attributes:
        anchors: names that links may lead to.
        links: targets as they stand there.
    """

    anchors: frozenset[str]
    links: tuple[str, ...]


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id" or (tag == "a" and name == "name"):
                self.anchors.add(value or "")
            elif name in _LINKS and value:
                self.links.append(value)


def read(path: Path) -> Page:
    """A page's anchors and links."""
    reader = _Reader()
    reader.feed(path.read_text("utf-8"))
    return Page(frozenset(reader.anchors), tuple(dict.fromkeys(reader.links)))


def broken(site: Path) -> tuple[list[str], int, int]:
    """What is wrong, in words, and how many links lead to places within the site and to elsewhere."""
    pages = {path: read(path) for path in sorted(site.rglob("*.html")) if not _own(path.relative_to(site))}
    wrong, within, elsewhere = [], 0, 0
    for path, page in pages.items():
        for link in page.links:
            target = urlsplit(link)
            if target.scheme or target.netloc:
                elsewhere += target.scheme in ("http", "https")
                continue
            within += 1
            wrong += [f"{path.relative_to(site)}: {link}: {why}" for why in _followed(site, pages, path, link)]
    return wrong, within, elsewhere


def _followed(site: Path, pages: dict[Path, Page], path: Path, link: str) -> Iterator[str]:
    target = urlsplit(link)
    name, anchor = unquote(target.path), unquote(target.fragment)
    to = (path.parent / name).resolve() if name else path
    to = to / "index.html" if to.is_dir() else to
    if not to.exists():
        yield "no such file"
    elif not to.is_relative_to(site):
        yield "leads out of the site"
    elif anchor and to in pages and anchor not in pages[to].anchors:
        yield "no such place on that page"


def _own(path: Path) -> bool:
    return path.stem in _WITHOUT or path.parts[0] in ("_static", "_modules", "replays")


def main(folder: str) -> int:
    """Tell what is broken; 1 if anything is."""
    site = Path(folder).resolve()
    if not (site / "index.html").exists():
        print(f"{folder}: there is no site, make docs builds it", file=sys.stderr)
        return 1
    wrong, within, elsewhere = broken(site)
    for line in wrong:
        print(line)
    print(f"{within} links within the site, {len(wrong)} broken; {elsewhere} lead elsewhere: make linkcheck-elsewhere")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
