"""What a chapter of the reproduction is made of. Verdicts are computed here and nowhere typed in."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas


class Verdict(str, Enum):
    """What the computation says about a published result."""

    REPRODUCED = "reproduced"
    REPRODUCED_WITH_CORRECTION = "reproduced with correction"
    REFUTED = "refuted"
    IDENTIFIED = "identified"
    """The published value was used to find numbers that the paper does not print: agreement confirms nothing."""
    NOT_DETERMINABLE = "not determinable"


EXTRACTION = " May be the text extraction's fault, not the paper's."
"""Ends the reason of a row whose fault is a single sign, index or symbol."""


@dataclass(frozen=True)
class Finding:
    """One published result beside the computed one. Build it with one of the functions below.

    Attributes:
        item: what is compared, with its place in the paper ("Table 1, dT at 0.003").
        published: the printed number, or the printed claim.
        computed: the value from the formula, unit or reading as printed; what was found, for a claim.
        deviation: computed minus published, of the corrected value where the correction decides; None for claims.
        verdict: follows from the numbers.
        why: reason for the verdict, one or two sentences.
        unit: of the three numbers.
        corrected: value under the correction that ``why`` states, None where none is offered.
        tolerance: largest |deviation| that counts as reproduced.
    """

    item: str
    published: float | str
    computed: float | str
    deviation: float | None
    verdict: Verdict
    why: str
    unit: str = ""
    corrected: float | str | None = None
    tolerance: float | None = None


@dataclass(frozen=True)
class Figure:
    """A figure of the paper, drawn again.

    Attributes:
        stem: file name without ending, unique within its chapter.
        caption: what it shows, with the paper's figure number.
        draw: fills an empty matplotlib figure (it may set its size); called once.
    """

    stem: str
    caption: str
    draw: Callable[[Canvas], None]


@dataclass(frozen=True)
class Chapter:
    """One paper.

    Attributes:
        key: short name on the command line.
        title: heading of the chapter.
        paper: full reference.
        findings: rows of the table, in the paper's order.
        figures: drawn below the table.
    """

    key: str
    title: str
    paper: str
    findings: Sequence[Finding]
    figures: Sequence[Figure]


def number(
    item: str,
    published: float,
    computed: float,
    tolerance: float,
    unit: str,
    corrected: float | None = None,
    why: str = "",
) -> Finding:
    """Compare a printed number with the computed one.

    Args:
        item: what is compared.
        published: as printed.
        computed: from the paper's own formula, unit or reading.
        tolerance: half a unit of the last printed digit, unless ``why`` states another reason for its size.
        unit: of all numbers.
        corrected: from the corrected formula or unit that ``why`` names.
        why: reason.

    Returns:
        Reproduced when ``computed`` lies within the tolerance, reproduced with correction when ``corrected`` does,
        else refuted.

    Raises:
        ValueError: a number is not finite, or the tolerance is negative.
    """
    for name, value in (("published", published), ("computed", computed), ("corrected", corrected)):
        if value is not None and not math.isfinite(value):
            raise ValueError(f"{item}: {name} = {value} is not a finite number; state a missing value as a statement")
    if not 0.0 <= tolerance < math.inf:
        raise ValueError(f"{item}: tolerance = {tolerance} must be finite and >= 0")
    deviation, verdict = float(computed) - published, Verdict.REFUTED
    if abs(deviation) <= tolerance:
        verdict = Verdict.REPRODUCED
    elif corrected is not None:
        deviation = float(corrected) - published
        if abs(deviation) <= tolerance:
            verdict = Verdict.REPRODUCED_WITH_CORRECTION
    return Finding(
        item,
        float(published),
        float(computed),
        deviation,
        verdict,
        why,
        unit,
        None if corrected is None else float(corrected),
        float(tolerance),
    )


def statement(
    item: str, claim: str, holds: bool, why: str, found: str | None = None, corrected: bool | None = None
) -> Finding:
    """Test a sentence of the paper.

    Args:
        item: where it stands.
        claim: the sentence, in short.
        holds: outcome of the computation.
        why: what was computed, with its numbers.
        found: text of the computed column, "holds" or "does not hold" by default.
        corrected: outcome under the correction that ``why`` names.
    """
    verdict = Verdict.REPRODUCED if holds else Verdict.REFUTED
    if not holds and corrected:
        verdict = Verdict.REPRODUCED_WITH_CORRECTION
    words = {True: "holds", False: "does not hold"}
    return Finding(
        item,
        claim,
        found if found is not None else words[bool(holds)],
        None,
        verdict,
        why,
        corrected=None if corrected is None else words[bool(corrected)],
    )


def undeterminable(
    item: str, published: float | str, why: str, *, alternatives: Sequence[float], tolerance: float, unit: str = ""
) -> Finding:
    """State that the paper's data admit more than one value.

    Args:
        item: what is asked for.
        published: as printed, or "not printed".
        why: which computation produced the alternatives.
        alternatives: values that fit the paper's data equally well; at least two, further apart than ``tolerance``.
        tolerance: difference below which two values count as the same.
        unit: of the numbers.

    Raises:
        ValueError: the alternatives agree, so the value is determined: compare it with ``number``.
    """
    low, high = float(min(alternatives)), float(max(alternatives))
    if not high - low > tolerance:
        raise ValueError(
            f"{item}: the alternatives {list(alternatives)} {unit} agree within {tolerance}, so the value is "
            "determined: compare it with number()"
        )
    spread = f"{low:.6g} to {high:.6g}"
    printed = published if isinstance(published, str) else float(published)
    return Finding(item, printed, spread, None, Verdict.NOT_DETERMINABLE, why, unit, tolerance=float(tolerance))


def identified(item: str, published: float | str, found: str, why: str, unit: str = "") -> Finding:
    """State that a published result was used to find what the paper does not print.

    Args:
        item: what is compared.
        published: as printed.
        found: text of the computed column: what comes out with the numbers found, and how far off it is.
        why: which numbers were found from it.
        unit: of ``published``.
    """
    printed = published if isinstance(published, str) else float(published)
    return Finding(item, printed, found, None, Verdict.IDENTIFIED, why, unit)


def lost(item: str, what: str, why: str) -> Finding:
    """State that a formula or value is missing in the source's text, so that nothing can be compared with it.

    Args:
        item: its place.
        what: what stood there, as the sentences around it tell.
        why: what this package uses in its place.
    """
    return Finding(item, what, "lost in the source's text", None, Verdict.NOT_DETERMINABLE, why)
