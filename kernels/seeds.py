"""Which seeds are for what: the one place in which blocks of fields are told apart.

A seed is a field with all of its luck. What was tuned, fitted or chosen on some fields is told on others, so every
purpose has a block of its own, and no two overlap. Scripts and rooms take their seeds from here
(``tests/test_seeds.py`` looks for numbers that stand elsewhere).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


class Block(NamedTuple):
    """Seeds from ``first`` to before ``end``, and what they are for."""

    first: int
    end: int
    purpose: str

    def take(self, count: int, skip: int = 0) -> range:
        """So many of them, behind the first ``skip``.

        Raises:
            ValueError: the block has not as many.
        """
        if not 0 <= skip <= skip + count <= self.end - self.first:
            raise ValueError(f"{count} seeds behind {skip}: the block holds {self.end - self.first} ({self.purpose})")
        return range(self.first + skip, self.first + skip + count)

    def holds(self, seed: int) -> bool:
        """Whether a seed is one of them."""
        return self.first <= seed < self.end


TUNED = Block(0, 100_000, "rules and planners are tried and tuned on them; the quick suite and films show them")
SHOWN = Block(
    100_000, 200_000, "development prints them: settings are never chosen on them, figures in the docs are theirs"
)
BELIEFS = Block(200_000, 300_000, "what planners believe is held to what happens on them: nothing is chosen on them")
DRIVES = Block(700_000, 800_000, "limits and errors of drives")
CAMERAS = Block(900_000, 920_000, "the weeders' cameras were fitted on them")
LESSONS = Block(920_000, 940_000, "the networks of the weeders' eyes learned from pictures of them")
EYES_CHOSEN = Block(940_000, 960_000, "thresholds of the weeders' eyes were chosen on them")
EYES_SHOWN = Block(960_000, 1_000_000, "figures of the weeders' eyes are theirs: nothing is chosen on them")
CHOOSING = Block(1_000_000, 2_000_000, "training runs choose their best weights on them")
OUTCOMES = Block(3_000_000, 4_000_000, "planners' tables of outcomes were measured on them")
PICKER = Block(5_000_000, 6_000_000, "the picker's process was calibrated on them")
PICTURES = Block(7_000_000, 7_100_000, "the picker's camera was fitted on them; the picking paper's fields")
PRODUCE = Block(7_100_000, 8_000_000, "the sorter's camera was fitted on them")
PLUGS = Block(8_000_000, 9_000_000, "the trays' camera was measured on them")
HELD_OUT = Block(40_000_000, 41_000_000, "the benchmark's: nothing in development plays or prints them")
TRAINING = Block(1_000_000_000, 2_000_000_000, "learned policies learned from them")
DATASETS = Block(2_000_000_000, 2_100_000_000, "datasets are collected on them")
CLONES = Block(3_000_000_000, 3_100_000_000, "a clone and its teacher are compared on them")

BLOCKS = {
    "tuned": TUNED,
    "shown": SHOWN,
    "beliefs": BELIEFS,
    "drives": DRIVES,
    "cameras": CAMERAS,
    "lessons": LESSONS,
    "eyes-chosen": EYES_CHOSEN,
    "eyes-shown": EYES_SHOWN,
    "choosing": CHOOSING,
    "outcomes": OUTCOMES,
    "picker": PICKER,
    "pictures": PICTURES,
    "produce": PRODUCE,
    "plugs": PLUGS,
    "held-out": HELD_OUT,
    "training": TRAINING,
    "datasets": DATASETS,
    "clones": CLONES,
}
"""All blocks by name, ascending."""

SEEDS_A_RUN = 10_000
"""A training run with seed s begins with the seeds of ``TRAINING`` behind ``SEEDS_A_RUN s``."""
POLICY_SEEDS = 1_000_000
"""A policy's own chance gets this much more than its field's seed; no field is drawn from it."""


class HeldOutError(ValueError):
    """Fields that are held out for the benchmark were asked for elsewhere; the message is one line."""


def refuse_held_out(seeds: Iterable[int]) -> None:
    """Hold what is no benchmark to other seeds than the benchmark's.

    Raises:
        HeldOutError: one of them is held out.
    """
    for seed in seeds:
        if HELD_OUT.holds(seed):
            raise HeldOutError(
                f"seed {seed} is held out for the benchmark ({HELD_OUT.first} to {HELD_OUT.end - 1}): give others, "
                f"{SHOWN.first} to {SHOWN.end - 1} are for showing"
            )
