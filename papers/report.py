"""Compute the chapters, draw their figures and write the index that holds them all."""

from __future__ import annotations

import html
import json
import multiprocessing
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from ..kernels.files import replace_file, replaced
from .findings import Chapter, Figure, Finding, Verdict

CHAPTERS = ("laser", "prrs", "safflower", "transplanting")
"""Keys in the order of the index; each is a module of this package with a function ``chapter()``."""


@dataclass(frozen=True)
class FigureFile:
    """A drawn figure: paths relative to the index.

    Attributes:
        stem: see ``Figure``.
        caption: see ``Figure``.
        svg: vector drawing.
        png: the same as pixels.
        shown: the one that a page shows; a vector drawing of very many parts would make it slow.
    """

    stem: str
    caption: str
    svg: str
    png: str
    shown: str


@dataclass(frozen=True)
class ChapterResult:
    """A computed chapter without its drawing functions, so that it passes between processes."""

    key: str
    title: str
    paper: str
    findings: tuple[Finding, ...]
    figures: tuple[FigureFile, ...]
    seconds: float

    def counts(self) -> dict[Verdict, int]:
        """Findings for each verdict."""
        counter = Counter(finding.verdict for finding in self.findings)
        return {verdict: counter[verdict] for verdict in Verdict}


def load(key: str) -> Chapter:
    """Compute one chapter's findings.

    Raises:
        ValueError: unknown key.
    """
    if key not in CHAPTERS:
        raise ValueError(f"chapter {key!r} is unknown: choose from {', '.join(CHAPTERS)}")
    return import_module(f".{key}", __package__).chapter()


def compute(key: str, out: Path) -> ChapterResult:
    """Compute one chapter and draw its figures into ``out/figures``."""
    start = time.perf_counter()
    chapter = load(key)
    figures = tuple(_draw(figure, chapter.key, out) for figure in chapter.figures)
    seconds = time.perf_counter() - start
    return ChapterResult(chapter.key, chapter.title, chapter.paper, tuple(chapter.findings), figures, seconds)


def reproduce(
    keys: Sequence[str], out: Path, processes: int = 2, on_done: Callable[[ChapterResult], None] | None = None
) -> list[ChapterResult]:
    """Compute chapters side by side and write figures, ``index.md``, ``index.html`` and ``findings.json``.

    Args:
        keys: chapters, a subset of ``CHAPTERS``.
        out: directory, made if missing.
        processes: chapters computed at once.
        on_done: called in this process as each chapter is ready.

    Returns:
        The results in the order of ``keys``.
    """
    for key in keys:
        if key not in CHAPTERS:
            raise ValueError(f"chapter {key!r} is unknown: choose from {', '.join(CHAPTERS)}")
    out.mkdir(parents=True, exist_ok=True)
    done: dict[str, ChapterResult] = {}
    for result in _computed(keys, out, min(processes, len(keys))):
        done[result.key] = result
        if on_done:
            on_done(result)
    results = [done[key] for key in keys]
    replace_file(out / "findings.json", to_json(results))
    replace_file(out / "index.md", to_markdown(results))
    replace_file(out / "index.html", to_html(results))
    return results


def _computed(keys: Sequence[str], out: Path, processes: int) -> Iterator[ChapterResult]:
    """Results as they are ready."""
    if processes <= 1:
        yield from (compute(key, out) for key in keys)
        return
    # "spawn": a forked child would inherit the threads' locks of whatever the caller has already loaded.
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        for future in as_completed([pool.submit(compute, key, out) for key in keys]):
            yield future.result()


def to_json(results: Sequence[ChapterResult]) -> str:
    """All findings and figures as JSON text."""
    return json.dumps([asdict(result) for result in results], indent=2, ensure_ascii=False) + "\n"


_LARGE_SVG_BYTES = 1_500_000

COLUMNS = ("Item", "Published", "As printed", "Corrected", "Deviation", "Verdict", "Why")
"""Headings of a chapter's table."""


def row(finding: Finding) -> tuple[str, ...]:
    """Texts of one table row, one for each of ``COLUMNS``."""
    deviation = ""
    if finding.deviation is not None:
        # Rounding far below the printed digits is no deviation.
        exact = abs(finding.deviation) <= 1e-6 * (finding.tolerance or 0.0)
        deviation = "0" if exact else f"{finding.deviation:+.3g}"
    published, computed, corrected = _align(finding)
    return finding.item, published, computed, corrected, deviation, finding.verdict.value, finding.why


def to_markdown(results: Sequence[ChapterResult]) -> str:
    """The index as Markdown."""
    lines = ["# Published results, computed again", "", _INTRODUCTION, ""]
    lines += ["| Paper | " + " | ".join(verdict.value for verdict in Verdict) + " |", "|---" * (1 + len(Verdict)) + "|"]
    for result in results:
        counts = " | ".join(str(count) for count in result.counts().values())
        lines.append(f"| [{result.title}](#{_anchor(result.title)}) | {counts} |")
    for result in results:
        lines += ["", f"## {result.title}", "", result.paper, ""]
        lines += ["| " + " | ".join(COLUMNS) + " |", "|---" * len(COLUMNS) + "|"]
        lines += ["| " + " | ".join(_cell(text) for text in row(finding)) + " |" for finding in result.findings]
        for figure in result.figures:
            lines += ["", f"![{_cell(figure.caption)}]({figure.png})", "", f"*{figure.caption}*"]
    return "\n".join(lines) + "\n"


def to_html(results: Sequence[ChapterResult]) -> str:
    """The index as one readable page; figures are linked, nothing is fetched from elsewhere."""
    head = "".join(f"<th>{_badge(verdict)}</th>" for verdict in Verdict)
    summary = "".join(
        f'<tr><td><a href="#{result.key}">{html.escape(result.title)}</a></td>'
        + "".join(f'<td class="n">{count or ""}</td>' for count in result.counts().values())
        + "</tr>"
        for result in results
    )
    chapters = "".join(_chapter_html(result) for result in results)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Published results, computed again</title><style>{_STYLE}</style></head><body><main>"
        f"<h1>Published results, computed again</h1><p>{html.escape(_INTRODUCTION)}</p>"
        f'<div class="wide"><table class="summary"><thead><tr><th>Paper</th>{head}</tr></thead>'
        f"<tbody>{summary}</tbody></table></div>{chapters}</main></body></html>\n"
    )


def _chapter_html(result: ChapterResult) -> str:
    rows = ""
    for finding in result.findings:
        item, published, computed, corrected, deviation, _, why = (html.escape(text) for text in row(finding))
        kind = "n" if finding.deviation is not None else "t"
        rows += (
            f'<tr><td class="item">{item}</td><td class="{kind} claim">{published}</td>'
            f'<td class="{kind}">{computed}</td><td class="{kind}">{corrected}</td><td class="n">{deviation}</td>'
            f'<td>{_badge(finding.verdict)}</td><td class="why">{why}</td></tr>'
        )
    figures = "".join(
        f'<figure id="{result.key}-{figure.stem}"><a href="{figure.svg}"><img src="{figure.shown}" '
        f'alt="{html.escape(figure.caption, quote=True)}"></a><figcaption>{html.escape(figure.caption)}</figcaption>'
        "</figure>"
        for figure in result.figures
    )
    headings = "".join(f"<th>{heading}</th>" for heading in COLUMNS)
    return (
        f'<section id="{result.key}"><h2>{html.escape(result.title)}</h2><p class="paper">{html.escape(result.paper)}'
        f'</p><div class="wide"><table><thead><tr>{headings}</tr></thead><tbody>{rows}</tbody></table></div>'
        f'<div class="figures">{figures}</div></section>'
    )


def _draw(figure: Figure, key: str, out: Path) -> FigureFile:
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Canvas

    folder = out / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    # A fixed salt and no date: the same results give the same files.
    style: dict[Any, Any] = {"svg.hashsalt": "fieldgym", "font.size": 9}
    style |= {"axes.grid": True, "grid.alpha": 0.3, "axes.axisbelow": True}
    with rc_context(style):
        canvas = Canvas(figsize=(7.0, 4.2), layout="constrained")
        FigureCanvasAgg(canvas)
        figure.draw(canvas)
        names = {}
        for ending in ("svg", "png"):
            target = folder / f"{key}-{figure.stem}.{ending}"
            metadata = {"Date": None} if ending == "svg" else {"Software": None}
            with replaced(target) as partial:
                canvas.savefig(partial, format=ending, dpi=140, metadata=metadata)
            names[ending] = target.relative_to(out).as_posix()
    shown = names["svg"] if (out / names["svg"]).stat().st_size < _LARGE_SVG_BYTES else names["png"]
    return FigureFile(figure.stem, figure.caption, names["svg"], names["png"], shown)


def _align(finding: Finding) -> tuple[str, str, str]:
    """The three values as text, numbers with as many decimals as the tolerance can tell apart."""

    def written(value: float | str | None) -> str:
        text = value or "" if value is None or isinstance(value, str) else _decimals(value, finding.tolerance)
        return f"{text} {finding.unit}" if finding.unit and text[-1:].isdigit() else text

    return written(finding.published), written(finding.computed), written(finding.corrected)


def _decimals(value: float, tolerance: float | None) -> str:
    if not tolerance:
        return f"{value:.7g}"
    places = 0
    while places < 9 and 10.0**-places > tolerance:
        places += 1
    # A value far below the printed resolution (a wrong unit) would read 0.000: show its digits instead.
    return f"{value:.3g}" if value != 0.0 and abs(value) < 10.0**-places else f"{value:.{places}f}"


def _badge(verdict: Verdict) -> str:
    return f'<span class="badge {verdict.name.lower()}">{verdict.value}</span>'


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _anchor(title: str) -> str:
    kept = "".join(letter for letter in title.lower() if letter.isalnum() or letter in " -_")
    return kept.replace(" ", "-")


_INTRODUCTION = (
    "Each row sets a published result beside the one that this package computes. 'As printed' uses the paper's own "
    "formula, unit or reading; 'corrected' uses the form that the last column names. Every verdict follows from the "
    "numbers of its row or from the test that the last column describes; a number counts as reproduced when it agrees "
    "to half a unit of its last printed digit, unless its row says otherwise. 'Identified' results were used to find "
    "numbers that the paper does not print, so that they confirm nothing. The sources are texts taken from PDFs, which "
    "lost symbols and some formulas: rows say where a fault may be the extraction's."
)

_STYLE = """
:root{color-scheme:light dark;--ink:#1d2420;--soft:#5c6862;--line:#d9dfdb;--page:#fbfcfb;--card:#fff;--tint:#f1f5f2}
@media(prefers-color-scheme:dark){:root{--ink:#e4e9e6;--soft:#9aa7a0;--line:#37403b;--page:#161a18;--card:#1d2320;
--tint:#232a26}figure img{background:#fff}}
*{box-sizing:border-box}body{margin:0;background:var(--page);color:var(--ink);
font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
main{max-width:1400px;margin:0 auto;padding:2rem 1.5rem 4rem}h1{font-size:1.8rem;margin:0 0 .5rem}
h2{font-size:1.35rem;margin:3rem 0 .25rem;padding-top:1rem;border-top:2px solid var(--line)}p{max-width:75ch}
.paper{color:var(--soft);margin:.25rem 0 1rem}.wide{overflow-x:auto}
table{border-collapse:collapse;width:100%;background:var(--card);font-size:13.5px}
th,td{padding:.4rem .6rem;border-bottom:1px solid var(--line);text-align:left;vertical-align:top}
thead th{background:var(--tint);font-weight:600;white-space:nowrap}
tbody tr:hover{background:var(--tint)}
td.n{text-align:right;white-space:nowrap;font-variant-numeric:tabular-nums}
td.item{min-width:8rem;font-weight:500}td.t{min-width:5rem}td.claim{min-width:8rem}
td.why{min-width:14rem;width:40%;color:var(--soft)}
table.summary{width:auto}a{color:inherit}
.badge{display:inline-block;padding:.05rem .5rem;border-radius:1rem;font-size:12px;font-weight:600;
line-height:1.3}td .badge{max-width:8.5rem}
.reproduced{background:#d5efdc;color:#14532d}.reproduced_with_correction{background:#dbe8fb;color:#1e3a70}
.refuted{background:#fadbd8;color:#7f1d1d}.identified{background:#f6ecc9;color:#5c4a0f}.not_determinable{background:#e6e3ef;color:#43366b}
.figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(520px,100%),1fr));gap:1.25rem;margin-top:1.5rem}
figure{margin:0;background:var(--card);border:1px solid var(--line);border-radius:6px;padding:.75rem}
figure img{width:100%;height:auto;display:block}figcaption{margin-top:.5rem;font-size:13px;color:var(--soft)}
"""
