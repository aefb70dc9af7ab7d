"""The page on how cost grows: what people wrote behind its curves outlives a new measurement."""

from pathlib import Path

from fieldgym.scripts.growth import BY_HAND, by_hand, page

PAGE = Path(__file__).parents[1] / "docs" / "scaling.md"


def test_what_was_written_by_hand_is_kept_once() -> None:
    assert by_hand("# Curves\n\n| 1 | 2 |\n" + BY_HAND + "\nBecause.\n") == BY_HAND + "\nBecause.\n"
    assert by_hand("# Curves\n") == ""


def test_the_page_explains_what_is_missed() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text.count(BY_HAND) == 1
    assert BY_HAND not in page({"machine": "any", "sections": {}, "load": {}}, {})
