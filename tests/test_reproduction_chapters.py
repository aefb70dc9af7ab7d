"""The chapters as a whole: every equation has its row, the five-bars' verdicts, the counts that the errata state."""

import re
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

from fieldgym.papers import Chapter, Verdict, report

pytestmark = pytest.mark.slow

ERRATA = Path(__file__).resolve().parents[1] / "docs" / "errata.md"
EQUATIONS = {"laser": 19, "prrs": 6, "safflower": 35, "transplanting": 16}
"""Last numbered equation of each paper."""


@cache
def loaded(key: str) -> Chapter:
    return report.load(key)


def verdicts(key: str) -> dict[str, Verdict]:
    findings = loaded(key).findings
    assert len({finding.item for finding in findings}) == len(findings)
    return {finding.item: finding.verdict for finding in findings}


def named(item: str) -> set[int]:
    """Numbers of the equations in an item: "Eqs 1, 2, 7 and 8, D", "Eqs 2-4", "by eq. 35"."""
    found = set()
    for text in re.findall(r"[Ee]qs? ?\.? ?(\d[\d, and-]*)", item):
        for low, high in re.findall(r"(\d+)(?:-(\d+))?", text):
            found |= set(range(int(low), int(high or low) + 1))
    return found


@pytest.mark.parametrize("key", report.CHAPTERS)
def test_every_equation_has_its_row(key):
    rows = [finding.item for finding in loaded(key).findings if not finding.item.startswith("Text")]
    have = set().union(*map(named, rows))
    assert set(range(1, EQUATIONS[key] + 1)) <= have, set(range(1, EQUATIONS[key] + 1)) - have


def test_the_errata_state_the_counts():
    lines = ERRATA.read_text(encoding="utf-8").splitlines()
    for key in report.CHAPTERS:
        (line,) = [line for line in lines if line.startswith(f"| `{key}` |")]
        counts = Counter(finding.verdict for finding in loaded(key).findings)
        stated = [int(cell) for cell in line.strip("| ").split("|")[1:]]
        assert stated == [len(loaded(key).findings), *(counts[verdict] for verdict in Verdict)], key


def test_no_tolerance_is_wider_than_the_print():
    """Half a unit of the last printed digit; where two ends are rounded, both."""
    for key in report.CHAPTERS:
        for finding in loaded(key).findings:
            if finding.verdict is not Verdict.NOT_DETERMINABLE and finding.tolerance:
                assert isinstance(finding.published, float)
                digits = len(f"{finding.published:.10f}".rstrip("0").partition(".")[2])
                widest = 0.5 * 10.0**-digits * (2.0 if "width" in finding.item else 1.0)
                assert finding.tolerance <= widest * (1.0 + 1e-9), finding.item


def test_the_transplanting_chapter_finds_what_it_should():
    found = verdicts("transplanting")
    assert found["Eqs 1 and 5, constant of the quintic law"] is Verdict.REPRODUCED
    assert found["Eqs 6 and 10, constant of the septic law"] is Verdict.REPRODUCED
    assert found["Eq. 11, loop"] is Verdict.REPRODUCED
    for item in (
        "Section 2.4 and conclusion 3, time saved by the quintic law",
        "Section 2.1 with eqs 5 and 10, speed",
        "Eq. 3, acceleration",
        "Eq. 9, saltus",
        "Eq. 12, inverse position",
        "Eqs 13 and 15, motor speeds",
        "Eq. 16, Q",
        "Eq. 14, motor accelerations",
    ):
        assert found[item] is Verdict.REPRODUCED_WITH_CORRECTION, item
    assert found["Section 2.4 and Fig. 7, saltus"] is Verdict.REFUTED
    assert found["Fig. 8, peak motor speed over the gate"] is Verdict.NOT_DETERMINABLE
    # One claim, one row.
    (rate,) = [item for item in found if "transplants a minute" in item or "rate" in item]
    assert found[rate] is Verdict.NOT_DETERMINABLE


def test_the_safflower_chapter_finds_what_it_should():
    found = verdicts("safflower")
    as_printed = {"Eqs 1, 2, 7 and 8, D", "Eq. 3, rho_D", "Eqs 5 and 6, E", "Eqs 10 and 11, C", "Eq. 19, J_T"}
    as_printed |= {"Eq. 23, loop", "Eq. 33, error"}
    equations = {item for item in found if item.startswith("Eq")}
    assert as_printed < equations and len(equations) == 27
    for item in equations:
        wanted = Verdict.REPRODUCED if item in as_printed else Verdict.REPRODUCED_WITH_CORRECTION
        assert found[item] is wanted, item
    for delta in ("0.001", "0.002", "0.003", "0.004", "0.005"):
        assert found[f"Table 1, dT1 at {delta}"] is Verdict.REPRODUCED_WITH_CORRECTION
        assert found[f"Table 1, dT2 at {delta}"] is Verdict.REFUTED
    assert found["Table 1 as a whole"] is Verdict.REFUTED
    assert found["Text at Table 1, both angles"] is Verdict.REPRODUCED
    assert found["Fig. 6, workspace"] is Verdict.IDENTIFIED
    assert found["Abstract and eq. 34, picking period"] is Verdict.IDENTIFIED
    assert all(found[f"Table 2 by eq. 35, group {group}"] is Verdict.REPRODUCED for group in range(1, 6))
    assert found["Fig. 3, distance l7 of the motors"] is Verdict.NOT_DETERMINABLE
    assert found["Fig. 3, forearm length l2 = l5"] is Verdict.NOT_DETERMINABLE
    assert found["Abstract, average net rate"] is Verdict.REPRODUCED_WITH_CORRECTION
