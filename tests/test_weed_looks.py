"""How the weeders' cameras are judged: which weeds lessons are about, and tables of what became of weeds and tracks."""

import numpy as np

from fieldgym.envs.weeding.tools.laser.calibration import Seen
from fieldgym.scripts.weed_agreement import shares
from fieldgym.scripts.weed_lessons import one_of
from fieldgym.scripts.weed_looks import CATEGORIES, RIGHT, Strip, by_confidence, by_gap, by_kind, tracks_of

WEED = np.array([[0.1, 0.05], [0.1, 0.06], [0.5, 0.0]])
CROP = np.array([[0.0, 0.0], [0.47, 0.0]])
AIM = np.array([[0.1, 0.05], [0.035, 0.0], [0.503, 0.0]])
KIND, NAMED = np.array([[0, 0], [1, 1], [1, 2]]), np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 2.0]])


def strip():
    """Three weeds: one is seen, one is missed beside it, one is off by 3 mm; a track lies where nothing is."""
    sure = np.array([0.95, 0.45, 0.75])
    seen = Seen(WEED, KIND, CROP, AIM, AIM, AIM, np.ones(3), NAMED, confidence=sure, confirmed_m=np.zeros(3))
    error = np.array([0.0, np.nan, 0.003])
    return Strip(None, seen, np.array([0, -1, 2]), [1], [RIGHT, CATEGORIES[3], CATEGORIES[5]], error)  # type: ignore[arg-type]


def cells(table):
    """Rows of a table as lists of text."""
    return [list(row) for row in zip(*(column._cells for column in table.columns), strict=True)]


def test_tracks_are_those_of_weeds_before_the_false_ones():
    tracks, true = tracks_of(strip())
    assert tracks.tolist() == [0, 2, 1] and true.tolist() == [True, True, False]


def test_kinds_are_those_of_weeds_for_recall_and_those_that_are_told_for_precision():
    assert cells(by_kind([strip()])) == [
        ["broadleaf cotyledon", "1", "1.00", "1", "1.00", "1.00", "0.00", "0.00"],
        ["grass two-leaf", "1", "0.00", "1", "0.00", "0.00", "nan", "nan"],
        ["grass four-leaf", "1", "1.00", "1", "1.00", "0.00", "3.00", "3.00"],
    ]


def test_gaps_are_those_from_weeds_for_recall_and_from_the_aim_for_precision():
    crop, weed = cells(by_gap([strip()], "crop")), cells(by_gap([strip()], "weed"))
    # One weed is 30 mm from a crop plant, two are farther than 80; aims are 33 and, where no weed is, 35 mm from one.
    assert [(row[0], row[1], row[3], row[4]) for row in crop] == [
        ("30-45", "1", "2", "0.50"),
        ("> 80", "2", "1", "1.00"),
    ]
    # The missed weed lies 10 mm from the seen one, whose track does not count it as itself.
    assert [(row[0], row[1], row[2], row[3]) for row in weed] == [
        ("8-12", "2", "0.50", "1"),
        ("> 50", "1", "1.00", "2"),
    ]


def test_confidence_stands_beside_how_often_it_was_right():
    assert [row[:4] for row in cells(by_confidence([strip()]))] == [
        ["0.4-0.5", "1", "0.45", "0.00"],
        ["0.7-0.8", "1", "0.75", "1.00"],
        ["0.9-1.0", "1", "0.95", "1.00"],
    ]


def test_shares_are_percent_of_the_weeds():
    right, *rest = shares([strip()])[0].round(1).tolist()
    assert right == 33.3 and rest.count(33.3) == 3 and sum(rest) == 3 * 33.3


def test_a_kind_without_a_share_is_never_what_a_cut_is_about():
    kind, rng = np.array([4, 0, 4, 1]), np.random.default_rng(0)
    chosen = [one_of(kind, np.array([True, True, True, False]), rng, (1.0, 1.0, 1.0, 1.0, 0.0, 1.0)) for _ in range(20)]
    assert set(chosen) == {1}
