"""Results that nobody played, for tests of what reads and writes them."""

import json
from pathlib import Path

from fieldgym.benchmark import store
from fieldgym.benchmark.record import Record, identity
from fieldgym.benchmark.suites import BOUND, Case, Condition, Episode, Suite

WHERE = Condition("fieldgym/SafflowerPicking-v0", "pots", "analytic", "model")


def record(policy: str, seed: int) -> Record:
    """An episode's record with all that one can have."""
    card = {"net_rate": 0.5 + 0.01 * (seed % 7), "cycle_time_s": 9.0, "throughput_per_min": 5.0, "damaged": 0.0}
    return {
        **identity(Episode(WHERE, policy, seed)),
        "return": 1.0 + 0.1 * (seed % 5),
        "rewards": {"picked": 1.0},
        "steps": 3,
        "terminated": True,
        "scorecard": {**card, "done": 2.0, "duration_s": 30.0, "phase_reach_s": 4.0},
        "last_s": 20.0,
        "wall_s": 0.1,
        "decision_s": 0.01,
        "decision_p95_ms": 4.0,
        "decision_before_last_s": 0.01,
        "curve": [0.0, 0.25, 0.5],
        "timeline": {
            "began_s": 1.0,
            "words": ["pick 1", "pick 2"],
            "phases": ["reach", "return"],
            "seconds": [[1.0, 2.0], [1.5, 2.5]],
            "net_rate": [0.25, 0.5],
            "done": [1, 2],
            "damaged": [0, 0],
        },
    }


def bound(seed: int) -> Record:
    """A bound's record."""
    values = {"net_rate": 0.9, "episode_return": 30.0, "method": "a relaxation", "proven": True, "gap": None}
    values |= {"cycle_time_s": 9.0, "curve": [[0.0, 6.0], [0.85, 9.0]]}
    return {**identity(Episode(WHERE, BOUND, seed)), "bound": values, "wall_s": 0.2}


def write(folder: Path, records: list[Record]) -> Path:
    """A folder with these episodes."""
    folder.mkdir()
    (folder / store.EPISODES).write_text("".join(json.dumps(item) + "\n" for item in records), "utf-8")
    return folder


def small_suite(seeds: int = 4) -> Suite:
    """Two policies."""
    return Suite("quick", (Case(WHERE, ("fixed-order", "nearest"), "fixed-order", tuple(range(seeds)), False),))


class Playing:
    """Stands in for the episodes; Ctrl-C comes before one of them."""

    def __init__(self, stop_before: int = -1):
        self.left = stop_before

    def __call__(self, episode: Episode, cancelled=None) -> Record:
        if self.left == 0:
            raise KeyboardInterrupt
        self.left -= 1
        return record(episode.policy, episode.seed)
