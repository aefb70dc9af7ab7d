"""Chapter of the transplanting paper."""

from __future__ import annotations

from ...motion import QUINTIC, SEPTIC
from .findings import Chapter, number


def chapter() -> Chapter:
    """The transplanting paper's numbers."""
    findings = [
        number("Eq. 1, quintic peak acceleration constant", 5.7735, QUINTIC.peak_acceleration, 5e-5, ""),
        number("Eq. 6, septic peak acceleration constant", 7.51, SEPTIC.peak_acceleration, 5e-3, ""),
    ]
    return Chapter("transplanting", "Seedling transplanter", "Qi, Hu, Ma, Zhang, CCTA 2011", findings, [])
