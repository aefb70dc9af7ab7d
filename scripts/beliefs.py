"""What planners believe of their decisions, and what these bring: the accounts that ``measure_outcomes --check`` holds.

A planner tells what it expects of a decision (``agents.policies.base.Planner``); the terms of the environment's reward
tell what it brought, in the same unit. Decisions are told apart by what was reported of what they were taken for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise, product
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from fieldgym.agents.policies.base import Planner
from fieldgym.agents.registry import make_policy
from fieldgym.agents.rollout import BatchDecision, batch_decisions
from fieldgym.envs.safflower import features as heads
from fieldgym.envs.safflower.config import EFFORTS, OPEN_STAGES
from fieldgym.envs.safflower.config import STAGES as HEAD_STAGES
from fieldgym.envs.sorting import columns as produce
from fieldgym.envs.sorting.odds import GRADE_COLUMNS
from fieldgym.envs.task import task
from fieldgym.envs.transplanting import columns as trays
from fieldgym.envs.transplanting.config import SPEEDS
from fieldgym.envs.weeding import features as weeds
from fieldgym.envs.weeding.config import SPECIES, STAGES
from fieldgym.envs.weeding.outcomes import KINDS
from fieldgym.envs.weeding.state import MODES

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
LEAST = 200
"""Decisions that a class is told of."""
NEAR = 0.02
"""What a belief may be off by: two points of a kill, of an average head, of an item, of a cell."""
TOGETHER = 250
"""Fields that are played together."""
GRADES = ("ware", "seed", "ripe", "green")


class Kind(NamedTuple):
    """What is done in a task, and how it is told apart.

    Attributes:
        unit: of what is believed and of what happens, for axes.
        names: of what decisions are told apart by.
        edges: ascending beliefs that part classes, in the unit.
        look: gives, of the task's numbers and decisions: whether each (B,) is one that something is believed of, which
            of the names it has, and what it brought.
        scale: of what a planner believes, from the task's numbers.
    """

    unit: str
    names: tuple[str, ...]
    edges: tuple[float, ...]
    look: Callable[[Any, BatchDecision], tuple[NDArray[np.bool_], Whole, Array]]
    scale: Callable[[Any], float] = lambda config: 1.0


def _chosen(table: NDArray[Any], slot: Whole) -> NDArray[Any]:
    """Features (B, F) of the candidates (B, K, F) in slots (B,); of the last one where there is none."""
    return table[np.arange(len(slot)), np.minimum(slot, table.shape[1] - 1)]


def _shots(config: Any, decision: BatchDecision) -> tuple[NDArray[np.bool_], Whole, Array]:
    C = weeds.C
    candidates = weeds.candidate_table(decision.observation)
    # Where the speed is chosen the shots come again for each of its changes.
    slot, mode = np.divmod(decision.actions % (MODES * candidates.shape[1] + 1), MODES)
    seen = _chosen(candidates, slot)
    kind = 3 * (seen[:, C.grass] > 0.5) + seen[:, C.cotyledon : C.four_leaf + 1].argmax(axis=-1)
    killed = decision.info["rewards"]["killed"] / config.weights.killed
    return slot < candidates.shape[1], MODES * kind + mode, killed


def _picks(config: Any, decision: BatchDecision) -> tuple[NDArray[np.bool_], Whole, Array]:
    candidates = heads.candidate_table(decision.observation)
    slot, effort = np.divmod(decision.actions, len(EFFORTS))
    stage = _chosen(candidates, slot)[:, [heads.C.bud + stage for stage in OPEN_STAGES]].argmax(axis=1)
    grams = decision.info["rewards"]["collected"] / config.weights.collected_g
    return slot < candidates.shape[1], len(EFFORTS) * stage + effort, grams / config.head_mass_g


def _grips(config: Any, decision: BatchDecision) -> tuple[NDArray[np.bool_], Whole, Array]:
    candidates = produce.candidate_table(decision.observation)
    grade, rewards = _grade(candidates, decision.actions), decision.info["rewards"]
    return decision.actions < candidates.shape[1], grade, rewards["placed"] / config.weights.placed


def _grips_by_number(config: Any, decision: BatchDecision) -> tuple[NDArray[np.bool_], Whole, Array]:
    picks, grade, value = _grips(config, decision)
    # What is sold loose brings less than its value.
    return picks, grade, (value > 0.99 * np.array(config.produce.value)[grade]).astype(np.float64)


def _grips_by_reward(config: Any, decision: BatchDecision) -> tuple[NDArray[np.bool_], Whole, Array]:
    picks, grade, _ = _grips(config, decision)
    return picks, grade, decision.rewards


def _grade(candidates: NDArray[Any], slot: Whole) -> Whole:
    return _chosen(candidates, slot)[:, GRADE_COLUMNS].argmax(axis=1)


def _transplants(config: Any, decision: BatchDecision) -> tuple[NDArray[np.bool_], Whole, Array]:
    pairs = trays.candidate_table(decision.observation)
    pair, speed = np.divmod(decision.actions, len(SPEEDS))
    seen = _chosen(pairs, pair)
    label = 2 * (seen[:, trays.C.source_poor] > 0.5) + (seen[:, trays.C.clear] > 0.5)
    cells = decision.info["rewards"]["planted"] / config.weights.planted
    return pair < pairs.shape[1], len(SPEEDS) * label + speed, cells


SHOTS = Kind(
    "kills",
    tuple(f"{stage} {species}, mode {mode}" for species in SPECIES for stage in STAGES for mode in range(MODES)),
    (0.0, 0.5, 0.75, 1.0, 1.5, 9.0),
    _shots,
)
PICKS = Kind(
    "average heads",
    tuple(f"{HEAD_STAGES[stage]}, {effort}" for stage in OPEN_STAGES for effort in EFFORTS),
    (0.0, 0.6, 0.8, 0.9, 1.0, 1.1, 9.0),
    _picks,
    lambda config: 1.0 / config.head_mass_g,
)
GRIPS = Kind("items", GRADES, (0.0, 0.9, 0.96, 0.98, 1.0), _grips_by_number)
VALUES = Kind("value", GRADES, (0.0, 0.25, 0.5, 0.7, 0.9, 9.0), _grips)
REWARDS = Kind("reward", GRADES, (-1.0, 0.25, 0.5, 0.7, 0.9, 9.0), _grips_by_reward)
_PLUGS = ("healthy", "poor")
TRANSPLANTS = Kind(
    "cells",
    tuple(
        f"{plug} into {gap}, {speed}"
        for plug, gap, speed in product(_PLUGS, ("an empty cell", "one that is cleared"), SPEEDS)
    ),
    (0.0, 9.0),
    _transplants,
)
assert len(SHOTS.names) == KINDS * MODES


class Account(NamedTuple):
    """A planner whose beliefs are held to what happens.

    Attributes:
        env_id: of the environment.
        scenario: that it plays.
        policy: by name.
        kind: what it decides.
    """

    env_id: str
    scenario: str
    policy: str
    kind: Kind

    @property
    def name(self) -> str:
        """Of tables and pictures."""
        return f"{task(self.env_id).name}, {self.scenario}, {self.policy}"


def _headline(env_id: str, policy: str, kind: Kind) -> Account:
    return Account(env_id, task(env_id).headline, policy, kind)


LASER = "fieldgym/LaserWeeding-v0"
PICKER, SORTER, TRAYS = (f"fieldgym/{name}-v0" for name in ("SafflowerPicking", "ProduceSorting", "TrayTransplanting"))
ACCOUNTS = (
    _headline(LASER, "receding-horizon", SHOTS),
    Account(LASER, "battery", "receding-horizon", SHOTS),
    Account(LASER, "worth", "receding-horizon", SHOTS),
    _headline("fieldgym/HoeWeeding-v0", "receding-horizon", SHOTS),
    _headline("fieldgym/LaserWeedingSpeed-v0", "hold-backlog", SHOTS),
    Account(PICKER, "row", "route", PICKS),
    _headline(PICKER, "grams-per-second", PICKS),
    Account(PICKER, "bag", "bag-horizon", PICKS),
    _headline(SORTER, "receding-horizon", GRIPS),
    _headline(SORTER, "receding-horizon-value", VALUES),
    _headline(SORTER, "learned", REWARDS),
    Account(SORTER, "orders", "receding-horizon", GRIPS),
    Account(SORTER, "orders", "receding-horizon-value", VALUES),
    _headline(TRAYS, "assignment", TRANSPLANTS),
    Account(TRAYS, "orders", "receding-horizon", TRANSPLANTS),
)


class Cell(NamedTuple):
    """A class of decisions.

    Attributes:
        name: says what was reported, and how much was believed.
        rows: of the decisions.
        believed: mean.
        happened: mean.
        sure: half of the 95 % interval of their difference.
    """

    name: str
    rows: Whole
    believed: float
    happened: float
    sure: float


class Played(NamedTuple):
    """Decisions of a planner on some seeds, n of them.

    Attributes:
        believed: (n,).
        happened: (n,).
        label: (n,), see ``Kind.names``.
        kind: what they are.
    """

    believed: Array
    happened: Array
    label: Whole
    kind: Kind

    def cells(self, least: int = LEAST) -> Iterator[Cell]:
        """Every class by what was reported and by what was believed, with so many decisions at least."""
        for label, name in enumerate(self.kind.names):
            for low, high in pairwise(self.kind.edges):
                inside = (self.believed >= low) & (self.believed < high)
                rows = np.flatnonzero(inside & (self.label == label))
                if len(rows) >= least:
                    believed, happened = self.believed[rows], self.happened[rows]
                    sure = 1.96 * float((happened - believed).std()) / np.sqrt(len(rows))
                    between = f", {low:g} to {high:g}" if len(self.kind.edges) > 2 else ""
                    yield Cell(name + between, rows, float(believed.mean()), float(happened.mean()), sure)


def played(account: Account, seeds: Sequence[int], **settings: Any) -> Played:
    """What a planner believed and did on some seeds, in an environment with these settings."""
    parts = [_batch(account, seeds[begin : begin + TOGETHER], settings) for begin in range(0, len(seeds), TOGETHER)]
    believed, happened, label = (np.concatenate(values) for values in zip(*parts, strict=True))
    return Played(believed, happened, label, account.kind)


def _batch(account: Account, seeds: Sequence[int], settings: dict[str, Any]) -> tuple[Array, Array, Whole]:
    """What was believed of each decision (n,), what happened, and its label."""
    env: Any = gym.make_vec(
        account.env_id,
        len(seeds),
        vectorization_mode="vector_entry_point",
        autoreset_mode=gym.vector.AutoresetMode.DISABLED,
        scenario=account.scenario,
        perception="model",
        **settings,
    )
    policy: Any = make_policy(account.policy, env)
    planner: Planner = policy
    config, found = env.unwrapped.core.config, []
    scale = account.kind.scale(config)
    for decision in batch_decisions(env, planner, env.reset(seed=list(seeds))[0]):
        tried, label, happened = account.kind.look(config, decision)
        tried &= decision.under_way
        believed = scale * planner.expected(decision.observation, decision.actions)
        found.append([values[tried] for values in (believed, happened, label)])
    believed, happened, label = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return believed, happened, label


def told(account: Account, seeds: Sequence[int]) -> list[Cell]:
    """Print every class of a planner's decisions with what was believed and what happened, and give them."""
    seen = played(account, seeds)
    cells = list(seen.cells())
    for cell in cells:
        print(
            f"  {cell.name:44} {len(cell.rows):6}: {cell.believed:.3f} believed, "
            f"{cell.happened:.3f} +- {cell.sure:.3f} happened"
        )
    off = np.array([abs(cell.happened - cell.believed) for cell in cells])
    sure = np.array([cell.sure for cell in cells])
    error, known = seen.happened - seen.believed, sure <= NEAR
    print(
        f"{account.name}: {len(error)} decisions, {seen.believed.mean():.4f} {account.kind.unit} believed, "
        f"{seen.happened.mean():.4f} +- {1.96 * error.std() / np.sqrt(len(error)):.4f} happened; {len(off)} classes, "
        f"{known.sum()} known to 2 points, {(off[known] > NEAR).sum()} of these off by more; "
        f"of all {(off > NEAR).sum()} off by more, {(off > NEAR + sure).sum()} surely",
        flush=True,
    )
    return cells


def drawn(accounts: Sequence[tuple[Account, list[Cell]]], path: Path) -> None:
    """Draw the planners of one environment into one picture: what was believed against what happened."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5, 5), layout="constrained")
    for account, cells in accounts:
        believed, happened, sure = np.array([cell[2:] for cell in cells]).reshape(-1, 3).T
        name = f"{account.scenario}, {account.policy}"
        axes.errorbar(believed, happened, sure, fmt="o", markersize=3, label=name)
    units = ", ".join(dict.fromkeys(account.kind.unit for account, _ in accounts))
    somewhere = accounts[0][1][0].believed
    axes.axline((somewhere, somewhere), slope=1.0, linewidth=1, color="grey")
    axes.set(xlabel=f"believed ({units})", ylabel="happened", title=task(accounts[0][0].env_id).name)
    axes.legend(fontsize="small")
    figure.savefig(path)
    plt.close(figure)
