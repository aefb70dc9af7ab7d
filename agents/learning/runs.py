"""What training runs leave, whatever they learn with: the best and the latest policy, the curve, where time went."""

from __future__ import annotations

import json
import math
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from ... import __version__
from ...kernels.files import replace_file
from ...kernels.seeds import CHOOSING, SEEDS_A_RUN, TRAINING
from ..evaluation import Scores, evaluate, mean
from ..foreign import in_words
from .portable import Portable, save, task_digest
from .train_settings import TrainSettings

BEST, LAST, CURVE = "best.npz", "last.npz", "curve.json"


def first_training_seed(seed: int) -> int:
    """Where the training instances of a run begin.

    Raises:
        ValueError: ``seed`` is out of range.
    """
    if not 0 <= seed < 100_000:
        raise ValueError(f"seed = {seed}: allowed range [0, 99999]")
    return TRAINING.first + SEEDS_A_RUN * seed


class CheckpointError(ValueError):
    """A checkpoint cannot be used; the message says why and what to do."""


@contextmanager
def told_as_damage(what: str) -> Iterator[None]:
    """Make a ``CheckpointError`` of whatever the values of a damaged or strange checkpoint bring about."""
    try:
        yield
    except CheckpointError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError, RuntimeError) as error:
        raise CheckpointError(f"{what} is damaged ({in_words(error)[:200]}): start without --resume") from None


class Log(Protocol):
    """Where numbers go beside the files."""

    def record(self, key: str, value: Any) -> None:
        """Keep a number for the next ``dump``."""

    def dump(self, step: int = 0) -> None:
        """Write what was kept."""


@dataclass
class Progress:
    """How far a run is; sums go on after a resume.

    Attributes:
        steps: decisions learned from.
        total: decisions wanted.
        updates: so far.
        returns: mean return of the latest training episodes, NaN before the first.
        net_rate: the same for the net rate.
        cycle_time_s: the same for the cycle time.
        taught: share of its teacher's decisions that the network took over, NaN without a teacher.
        environment_s: wall seconds inside the environment.
        acting_s: choosing actions and keeping what was seen.
        learning_s: updates.
        other_s: evaluations, checkpoints.
        held_out: latest evaluation, empty before the first.
    """

    steps: int = 0
    total: int = 0
    updates: int = 0
    returns: float = math.nan
    net_rate: float = math.nan
    cycle_time_s: float = math.nan
    taught: float = math.nan
    environment_s: float = 0.0
    acting_s: float = 0.0
    learning_s: float = 0.0
    other_s: float = 0.0
    held_out: dict[str, float] = field(default_factory=dict)

    @property
    def wall_s(self) -> float:
        """Wall seconds, those before a resume included."""
        return self.environment_s + self.acting_s + self.learning_s + self.other_s

    def split(self) -> str:
        """Where the time went, in words."""
        total = max(self.wall_s, 1e-9)
        parts = {
            "environment": self.environment_s,
            "choosing actions": self.acting_s,
            "learning": self.learning_s,
            "evaluation and checkpoints": self.other_s,
        }
        shares = ", ".join(f"{name} {seconds / total:.0%}" for name, seconds in parts.items())
        return f"{self.steps:,} decisions in {self.wall_s:.0f} s ({self.steps / total:,.0f}/s): {shares}"


@dataclass(frozen=True)
class Result:
    """What a run leaves: the folder's best policy, how it went, and the curve of held-out scores."""

    best: Path
    progress: Progress
    curve: list[dict[str, float]]


class Journal:
    """What a run has found so far, in memory and in its folder.

    Attributes:
        progress: how far it is.
        curve: every evaluation.
        best: highest return on held-out seeds.
    """

    def __init__(self, env_id: str, settings: TrainSettings, seed: int, folder: Path, log: Log):
        """Begin with nothing."""
        self.env_id, self.settings, self.seed, self.folder, self._log = env_id, settings, seed, folder, log
        self.progress = Progress(total=settings.steps)
        self.curve: list[dict[str, float]] = []
        self.best = -math.inf
        self._mark = time.perf_counter()

    @property
    def time_left(self) -> float:
        """Share of the time that its settings give the run; 1 where they give it any."""
        minutes = self.settings.minutes
        return 1.0 if minutes is None else max(0.0, 1.0 - self.progress.wall_s / (60.0 * minutes))

    def lap(self) -> float:
        """Wall seconds since the last call."""
        before, self._mark = self._mark, time.perf_counter()
        return self._mark - before

    def text(self) -> dict[str, Any]:
        """What a checkpoint keeps of it, as JSON values."""
        return {
            "env_id": self.env_id,
            "seed": self.seed,
            "settings": self.settings.as_dict(),
            "progress": {name: getattr(self.progress, name) for name in Progress.__dataclass_fields__},
            "curve": self.curve,
            "best": self.best if math.isfinite(self.best) else None,
        }

    def restore(self, run: dict[str, Any]) -> None:
        """Go on from what ``text`` gave.

        Raises:
            CheckpointError: it is of a run with other settings, of another task or seed.
        """
        with told_as_damage(f"the checkpoint in {self.folder}"):
            self._restore(run)

    def _restore(self, run: dict[str, Any]) -> None:
        before, now = dict(run["settings"]), self.settings.as_dict()
        for name in now:
            if name not in ("steps", "minutes") and before.get(name) != now[name]:
                raise CheckpointError(
                    f"the checkpoint in {self.folder} was made with {name} = {before.get(name)!r}, now it is "
                    f"{now[name]!r}: go on with the same settings, or start without --resume"
                )
        if run["env_id"] != self.env_id or run["seed"] != self.seed:
            raise CheckpointError(
                f"the checkpoint in {self.folder} is of {run['env_id']!r} with seed {run['seed']!r}: "
                "choose that, another --out, or start without --resume"
            )
        progress = Progress(**{**run["progress"], "total": self.settings.steps})
        counted = (progress.steps, progress.updates)
        numbers = [value for name, value in vars(progress).items() if name != "held_out"]
        best = -math.inf if run["best"] is None else run["best"]
        points = isinstance(run["curve"], list) and all(isinstance(point, dict) for point in run["curve"])
        if not all(type(count) is int and count >= 0 for count in counted) or not points:
            raise TypeError("steps, updates or curve")
        if not all(isinstance(value, (int, float)) for value in (*numbers, *progress.held_out.values(), best)):
            raise TypeError("seconds, scores or best")
        self.progress, self.curve, self.best = progress, run["curve"], best

    def keep(self, policy: Portable, env: Any, **facts: Any) -> None:
        """Evaluate a policy on the held-out seeds and write it, with a card, where it belongs.

        Args:
            policy: what was learned.
            env: the environment that it learned in.
            **facts: what else its card says.
        """
        settings = self.settings
        seeds = CHOOSING.take(settings.evaluation_episodes)
        scores = evaluate(policy.fitted, self.env_id, seeds, scenario=settings.scenario)
        point = _point(scores)
        self.progress.held_out = point
        self.curve.append({"steps": self.progress.steps, "wall_s": round(self.progress.wall_s, 1), **point})
        for name, value in point.items():
            self._log.record(f"held_out/{name}", value)
        self._log.dump(self.progress.steps)
        names = [LAST]
        if point["return"] > self.best:
            self.best = point["return"]
            names.append(BEST)
        card = {
            "env_id": self.env_id,
            "scenario": settings.scenario,
            "algorithm": settings.algo,
            "settings": settings.as_dict(),
            "seed": self.seed,
            "training_seeds": f"from {first_training_seed(self.seed)}, one a world, drawn on from there",
            "chosen_on_seeds": [seeds[0], seeds[-1]],
            "decisions": self.progress.steps,
            "wall_s": round(self.progress.wall_s, 1),
            "wall_split": self.progress.split(),
            "held_out": point,
            "learning_curve": self.curve,
            "task_numbers": task_digest(env),
            "fieldgym": __version__,
            "machine": f"{platform.system()} {platform.machine()}",
            **facts,
        }
        for name in names:
            save(self.folder / name, policy, card)
        replace_file(self.folder / CURVE, json.dumps(self.curve, indent=1) + "\n")


def _point(scores: Scores) -> dict[str, float]:
    return {
        "return": round(mean(scores.returns), 6),
        "net_rate": round(mean(scores.scorecard["net_rate"]), 6),
        "cycle_time_s": round(mean(scores.scorecard["cycle_time_s"]), 4),
    }
