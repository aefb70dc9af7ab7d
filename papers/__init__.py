"""The four papers' published results beside the computed ones: one module a paper, one report for all."""

from .findings import Chapter, Figure, Finding, Verdict, identified, lost, number, statement, undeterminable

__all__ = [
    "Chapter",
    "Figure",
    "Finding",
    "Verdict",
    "identified",
    "lost",
    "number",
    "statement",
    "undeterminable",
]
