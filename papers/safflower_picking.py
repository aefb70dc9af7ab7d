"""The safflower paper's picking test: its period (eq. 34) and its net rates (eq. 35, Table 2)."""

from __future__ import annotations

import numpy as np

from ..kernels.seeds import PICTURES
from .findings import Finding, identified, number, statement

PERIOD_S = 16.0
COLLECTED_G = np.array([2.583, 3.087, 2.620, 1.983, 2.139])
TOTAL_G = np.array([2.973, 3.607, 2.940, 2.233, 2.399])
NET_RATE_PERCENT = np.array([86.88, 85.58, 89.12, 88.80, 89.16])
"""Table 2."""
FIELDS = 200
"""Of the fields of the period's row: those that its parameter was found on begin elsewhere."""


def picking() -> list[Finding]:
    """The picking test in the paper's order."""
    return [_mean(), _period(), *_net_rates()]


def _mean() -> Finding:
    times = 10.0 + np.arange(12.0)
    n = len(times)
    printed = sum(times[-1] for _ in range(n)) / n
    corrected = sum(times[i] for i in range(n)) / n
    return statement(
        "Eq. 34, average period",
        "(sum over i = 1..n of T_n) / n",
        bool(np.isclose(printed, times.mean())),
        f"A sum over i of a term without i is n times the term: of {n} times from {times[0]:g} to {times[-1]:g} s the "
        f"printed form gives {printed:g} s, the last one, and with T_i in the sum {corrected:g} s, their mean.",
        corrected=bool(np.isclose(corrected, times.mean())),
    )


def period_s(locate_s: float, fields: int = FIELDS) -> float:
    """Mean seconds a head of the paper's protocol, with this time for finding one."""
    from ..agents import make_policy
    from ..agents.evaluation import evaluate

    scores = evaluate(
        lambda env: make_policy("fixed-order", env),
        "fieldgym/SafflowerPicking-v0",
        PICTURES.take(fields),
        scenario="pots",
        overrides={"process.locate_s": locate_s},
    )
    return float(np.mean(scores.scorecard["cycle_time_s"]))


def _period() -> Finding:
    from ..envs.safflower.config import ProcessConfig

    process = ProcessConfig()
    without, found = period_s(0.0), period_s(process.locate_s)
    return identified(
        "Abstract and eq. 34, picking period",
        PERIOD_S,
        f"{found:.2f} s; {without:.2f} s before the time to find a head",
        "The paper prints neither speeds of the arm nor times of recognition, so that nothing else can be held against "
        f"the 16 s. In the simulated protocol ({FIELDS} fields, fixed order, normal effort) moving, waiting, cutting "
        f"and collecting take {without:.2f} s, with assumed limits of the motion; the {process.locate_s:g} s for "
        f"finding a head were identified so that 16 s come out, on other fields: "
        f"{100 * process.locate_s / PERIOD_S:.0f} "
        "% of the period in one number.",
        unit="s",
    )


def _net_rates() -> list[Finding]:
    rates = 100.0 * COLLECTED_G / TOTAL_G
    pooled = float(100.0 * COLLECTED_G.sum() / TOTAL_G.sum())
    spread = float(np.std(rates, ddof=1))
    return [
        *(
            number(f"Table 2 by eq. 35, group {group + 1}", printed, rate, 0.005, "%", why="m1 over the total mass.")
            for group, (printed, rate) in enumerate(zip(NET_RATE_PERCENT, rates, strict=True))
        ),
        number(
            "Abstract, average net rate",
            87.91,
            pooled,
            0.005,
            "%",
            corrected=float(rates.mean()),
            why="Eq. 35 over the entire experiment, as its text defines it, gives the pooled rate. The printed average "
            f"is the mean of the five group rates; their standard deviation is {spread:.2f} points.",
        ),
    ]
