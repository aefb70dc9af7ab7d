"""The site: pages of environments say what the code has, links lead somewhere, the index has every page."""

import importlib
import re
import sys
from pathlib import Path
from typing import Any

import pytest

import fieldgym
from fieldgym.envs.task import tasks
from fieldgym.kernels.config_tables import rows

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
OWN = [spec for spec in tasks() if spec.id.startswith("fieldgym/")]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the pages that are written from the code."""
    sys.path.insert(0, str(DOCS))
    try:
        making: Any = importlib.import_module("fieldsite.making")
    finally:
        sys.path.remove(str(DOCS))
    folder = tmp_path_factory.mktemp("site")
    making.pages(folder, OWN)
    return folder


def tables_of(text: str) -> dict[str, list[list[str]]]:
    """Rows of the tables below each heading, as cells."""
    found: dict[str, list[list[str]]] = {}
    heading = ""
    for line in text.splitlines():
        if line.startswith("#"):
            heading = line.lstrip("# ").strip("`")
        elif line.startswith("| "):
            cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
            found.setdefault(heading, []).append(cells)
    return found


def page_of(site: Path, spec) -> str:
    words = re.findall(r"[A-Z][a-z]+", spec.name.split("-")[0])
    return (site / "environments" / ("-".join(words).lower() + ".md")).read_text("utf-8")


@pytest.mark.parametrize("spec", OWN, ids=lambda spec: spec.name)
def test_a_page_names_everything_that_its_environment_has(site: Path, spec) -> None:
    text = page_of(site, spec)
    tables = tables_of(text)
    assembly = spec.assembly
    core = assembly.core(assembly.configured(), assembly.perfect(assembly.config()), 1)

    def column(heading: str, place: int) -> tuple[str, ...]:
        return tuple(row[place].strip("`") for row in tables[heading][1:])

    assert column("machine", 1) == core.machine_features
    assert column("candidates", 1) == core.candidate_features
    assert column("Reward", 0) == core.reward_names
    assert column("Scorecard", 0) == core.score_names
    # Every one of them is explained, and a feature has its scale and its range.
    for heading, meaning in (("machine", 2), ("candidates", 2), ("Reward", 1), ("Scorecard", 1)):
        assert all(len(row[meaning]) > 2 for row in tables[heading]), heading
    for heading in ("machine", "candidates"):
        for row in tables[heading][1:]:
            low, high = map(float, row[5].split(" .. "))
            assert float(row[4]) > 0.0 and low < high
    last = int(column("Actions", 1)[-1].split()[-1])
    assert last == core.action_space.n - 1
    for scenario in assembly.scenarios:
        assert f"`{scenario}`" in column("End of an episode", 0) or scenario in column("End of an episode", 0)
    shown = {name for heading in ("Published", "Identified", "Assumed", "Derived", "Without a source")
             for name in (column(heading, 0) if heading in tables else ())}  # fmt: skip
    numbers = {line.name for line in rows(assembly.configured()) if not line.name.startswith(("scenario.", "weights."))}
    assert shown == numbers
    for name in spec.policies:
        assert f"`{name}`" in text
    weights = [line.default for line in rows(core.config) if line.name.startswith("weights.")]
    assert [float(row[3]) for row in tables["Reward"][1:]] == pytest.approx(weights)


def test_a_feature_is_shown_as_its_page_says(site: Path) -> None:
    """The scale of the table is the one that the rules divide by: a weed's place comes back in metres."""
    import gymnasium as gym

    env: Any = gym.make("fieldgym/LaserWeeding-v0", backend="analytic").unwrapped
    observation, _ = env.reset(seed=3)
    core = env.core
    spec = fieldgym.task("fieldgym/LaserWeeding-v0")
    scale = {row[1].strip("`"): float(row[4]) for row in tables_of(page_of(site, spec))["candidates"][1:]}
    table = observation["candidates"].reshape(-1, len(core.candidate_features))
    across = table[0, core.candidate_features.index("across")] * scale["across"]
    track = core.state.slot_track[0, 0]
    assert across == pytest.approx(core.state.track_report[0, track, 1], abs=1e-6)


def test_the_leaderboard_at_a_glance_has_its_top_lines(site: Path) -> None:
    glance = (site / "made" / "glance.md").read_text("utf-8")
    board = (DOCS / "leaderboard.md").read_text("utf-8")
    headlines = board.partition("\n## Where the order matters")[0]
    first = [line for line in headlines.splitlines() if line.startswith("| 1 |")]
    lines = [line for line in glance.splitlines() if line.startswith("| [")]
    assert len(lines) == len(first) == len(OWN)
    for line, top in zip(lines, first, strict=True):
        _, _, policy, net_rate = (cell.strip() for cell in top.split("|")[:4])
        assert f"| {policy.strip('*')} | {net_rate.split('<br>')[0]} |" in line
    assert re.search(r"source hash(?:es)? `[0-9a-f]{16}`", glance)
    # What the leaderboard warns of is said wherever its figures stand.
    for caution in re.findall(r"^(\*\*[^\n]+)$", board.partition("\n## ")[0], re.M):
        assert caution in glance and all(caution in page_of(site, spec) for spec in OWN)


def markdown_pages() -> list[Path]:
    """Pages that people write."""
    made = {"_build", "made", "environments", "reproduction"}
    pages = [path for path in DOCS.rglob("*.md") if not made & set(path.relative_to(DOCS).parts)]
    return sorted([*pages, *ROOT.glob("*.md")])


@pytest.mark.parametrize("page", markdown_pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_to_files_and_headings(page: Path, site: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.S)
    made = {"environments/", "reproduction/", "made/", "contributing.md", "changelog.md", "security.md"}
    for target in re.findall(r"\]\((?!https?:|mailto:)([^)\s]+)\)", text):
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        written = path.relative_to(DOCS).as_posix() if path.is_relative_to(DOCS) else ""
        if any(written.startswith(start) for start in made):
            assert written.startswith(("reproduction/", "made/")) or (site / written).exists(), target
            continue
        assert path.exists(), target
        if anchor and path.suffix == ".md":
            headings = re.findall(r"^#+ (.+)$", path.read_text("utf-8"), re.M)
            assert anchor in {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}, (
                target
            )


_PRINTS = re.compile(r"`(python (-m |scripts/)|fieldgym [a-z]|make [a-z])|`tests/test_\w+\.py`")


def measured(cell: str) -> bool:
    """Whether it is a decimal figure, or some, without words."""
    return re.search(r"\d\.\d", cell) is not None and not re.search(r"[a-z]", re.sub(r"<br>|n\.s\.", "", cell), re.I)


@pytest.mark.parametrize("page", markdown_pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_table_of_measured_figures_names_what_prints_it(page: Path) -> None:
    """In its section, where the page begins, or where it says at its end where it comes from."""
    text = page.read_text("utf-8")
    of_all = text.partition("\n## ")[0] + text.partition("\n## Where it comes from\n")[2]
    for section in re.split(r"^(?=##+ )", text, flags=re.M):
        for table in re.findall(r"(?:^\|.*\n)+", section, re.M):
            rows = [re.split(r"(?<!\\)\|", line)[2:-1] for line in table.splitlines()[2:]]
            cells = [cell.strip() for row in rows for cell in row if cell.strip()]
            figures = sum(measured(cell) for cell in cells)
            if figures > 1 and figures >= 0.3 * len(cells):
                assert _PRINTS.search(section) or _PRINTS.search(of_all), f"{section.splitlines()[0]}: {table[:200]}"


def test_every_page_is_in_the_index() -> None:
    index = (DOCS / "index.md").read_text("utf-8") + (DOCS / "api" / "index.md").read_text("utf-8")
    listed = set(re.findall(r"^([\w/-]+)$", index, re.M))
    pages = {
        path.relative_to(DOCS).with_suffix("").as_posix() for path in markdown_pages() if path.is_relative_to(DOCS)
    }
    pages |= {path.relative_to(DOCS).with_suffix("").as_posix() for path in (DOCS / "notebooks").glob("*.ipynb")}
    names = {page.removeprefix("api/") if page != "api/index" else page for page in pages}
    assert names - listed == {"index"}


def test_a_link_that_leads_nowhere_within_the_site_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))
    links: Any = importlib.import_module("fieldsite.links")
    (tmp_path / "a b").mkdir()
    (tmp_path / "a b" / "x.html").write_text('<h2 id="two">2</h2><img src="../p.png"><a href="../index.html">up</a>')
    index = tmp_path / "index.html"
    index.write_text('<a href="a%20b/x.html#two">2</a><a href="https://example.org/#no">out</a><a href="#top">t</a>')
    wrong, within, elsewhere = links.broken(tmp_path)
    assert wrong == ["a b/x.html: ../p.png: no such file", "index.html: #top: no such place on that page"]
    assert (within, elsewhere) == (4, 1)
    index.write_text('<a href="a%20b/x.html#three">3</a><a href="../out.html">out</a><p id="top"></p>')
    (tmp_path / "p.png").touch()
    (tmp_path.parent / "out.html").touch()
    assert links.broken(tmp_path)[0] == [
        "index.html: a%20b/x.html#three: no such place on that page",
        "index.html: ../out.html: leads out of the site",
    ]
