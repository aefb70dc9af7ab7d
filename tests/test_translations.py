"""What stands in two languages says the same: headings, code and commands, links and pictures."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = {"README.md": "README.zh.md", "docs/index.md": "docs/index-zh.md"}
"""What is translated, and where."""


def both(name: str) -> tuple[str, str]:
    """English and Chinese; the table of contents stands in the English index alone."""
    english, chinese = ((ROOT / path).read_text("utf-8") for path in (name, PAGES[name]))
    return re.sub(r"\n```{toctree}\n.*?^```$", "", english, flags=re.MULTILINE | re.DOTALL), chinese


def outside_code(text: str) -> str:
    return re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)


def targets(text: str) -> list[str]:
    """Where links and pictures lead, the languages' own pages as one."""
    found = re.findall(r"\]\(([^)]+)\)", outside_code(text))
    return sorted(target.replace(".zh.md", ".md").replace("index-zh.md", "index.md") for target in found)


@pytest.mark.parametrize("name", PAGES)
def test_headings_have_the_same_order_and_levels(name: str):
    levels = [re.findall(r"^(#+) \S", outside_code(text), re.MULTILINE) for text in both(name)]
    assert levels[0] and levels[0] == levels[1]


@pytest.mark.parametrize("name", PAGES)
def test_code_and_commands_are_the_same(name: str):
    blocks = [re.findall(r"^```.*?^```$", text, re.MULTILINE | re.DOTALL) for text in both(name)]
    assert blocks[0] == blocks[1]
    words = [sorted(re.findall(r"(?<!`)`([^`\n]+)`(?!`)", outside_code(text))) for text in both(name)]
    assert words[0] == words[1]


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_to_the_same_places(name: str):
    english, chinese = both(name)
    assert targets(english) == targets(chinese)


@pytest.mark.parametrize("name", PAGES)
def test_it_is_another_language_in_every_paragraph(name: str):
    """Nothing was left out of the translation, or left as it was."""
    english, chinese = map(outside_code, both(name))
    parts = [[part for part in re.split(r"\n\s*\n", text) if part.strip()] for text in (english, chinese)]
    assert len(parts[0]) == len(parts[1])
    for part in parts[1]:
        if re.search(r"[a-z]{3}", re.sub(r"`[^`]*`|\]\([^)]*\)|<[^>]*>|^# fieldgym$", "", part, flags=re.MULTILINE)):
            assert re.search(r"[\u4e00-\u9fff]", part) or part.lstrip().startswith((":", "```", "{")), part
