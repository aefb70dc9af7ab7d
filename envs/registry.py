"""Which environments there are, in words that documents, tables and the command line share."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches

import gymnasium as gym


@dataclass(frozen=True)
class TaskDescription:
    """What a person needs to know to choose an environment."""

    id: str
    machine: str
    paper: str
    decision: str
    actions: str
    scenarios: tuple[str, ...]
    headline_scenario: str
    backends: tuple[str, ...]
    perceptions: tuple[str, ...]
    entry_point: str
    vector_entry_point: str


_FIELDS = ("load-0.7", "load-1.0", "load-1.25", "load-1.6", "load-1.0-even", "load-1.6-even", "dense")
_BACKENDS, _PERCEPTIONS = ("pybullet", "analytic"), ("perfect", "model", "camera")

TASKS = (
    TaskDescription(
        id="fieldgym/SafflowerPicking-v0",
        machine="planar five-bar with shear and suction on a cart that stops",
        paper="Guo et al. 2022, Engenharia Agricola 42(1) e20210129",
        decision="which head next, how thoroughly, when to drive on",
        actions="Discrete(3 K + 1): slot x (quick, normal, thorough), or drive on",
        scenarios=("pots", "row-sparse", "row", "row-dense"),
        headline_scenario="pots",
        backends=_BACKENDS,
        perceptions=_PERCEPTIONS,
        entry_point="fieldgym.envs.safflower.env:SafflowerPickingEnv",
        vector_entry_point="fieldgym.envs.safflower.env:SafflowerPickingVectorEnv",
    ),
    TaskDescription(
        id="fieldgym/TrayTransplanting-v0",
        machine="translational five-bar with a plug gripper over two indexed conveyors",
        paper="Qi, Hu, Ma, Zhang, CCTA 2011, 10.1007/978-3-642-27275-2_11",
        decision="which seedling into which cell, how gently, when to index",
        actions="Discrete(3 K + 2): pair x (gentle, normal, fast), index the source, or index the target",
        scenarios=("fill-low", "fill", "fill-high", "replug-low", "replug", "replug-high"),
        headline_scenario="fill",
        backends=_BACKENDS,
        perceptions=_PERCEPTIONS,
        entry_point="fieldgym.envs.transplanting.env:TrayTransplantingEnv",
        vector_entry_point="fieldgym.envs.transplanting.env:TrayTransplantingVectorEnv",
    ),
    TaskDescription(
        id="fieldgym/LaserWeeding-v0",
        machine="3UPS-RPU laser platform on a cart that drives on, front camera and tool camera",
        paper="Wang et al., 3UPS-RPU parallel mechanism for a laser weeding robot",
        decision="which weed next, with which dose, or wait",
        actions="Discrete(3 K + 1): slot x (low, normal, high dose), or wait a moment",
        scenarios=_FIELDS,
        headline_scenario="load-1.25",
        backends=_BACKENDS,
        perceptions=_PERCEPTIONS,
        entry_point="fieldgym.envs.weeding.env:LaserWeedingEnv",
        vector_entry_point="fieldgym.envs.weeding.env:LaserWeedingVectorEnv",
    ),
    TaskDescription(
        id="fieldgym/LaserWeedingSpeed-v0",
        machine="3UPS-RPU laser platform on a cart whose speed is chosen too",
        paper="Wang et al., 3UPS-RPU parallel mechanism for a laser weeding robot",
        decision="which weed next, with which dose, or wait; and how fast to drive",
        actions="Discrete(3 (3 K + 1)): those of LaserWeeding-v0, each holding, lowering or raising the speed",
        scenarios=_FIELDS,
        headline_scenario="load-1.25",
        backends=_BACKENDS,
        perceptions=_PERCEPTIONS,
        entry_point="fieldgym.envs.weeding.env:LaserWeedingSpeedEnv",
        vector_entry_point="fieldgym.envs.weeding.env:LaserWeedingSpeedVectorEnv",
    ),
    TaskDescription(
        id="fieldgym/HoeWeeding-v0",
        machine="six-degree-of-freedom 3-PRRS with a round hoe on a cart that drives on, front camera",
        paper="Du, Guo, Niu 2015, J. Shandong Univ. Technol. 29(5) 43-48",
        decision="which weed next, how deep to stir, or wait",
        actions="Discrete(3 K + 1): slot x (gentle, normal, deep), or wait a moment",
        scenarios=_FIELDS,
        headline_scenario="load-1.25",
        backends=_BACKENDS,
        perceptions=_PERCEPTIONS,
        entry_point="fieldgym.envs.weeding.tools.hoe.env:HoeWeedingEnv",
        vector_entry_point="fieldgym.envs.weeding.tools.hoe.env:HoeWeedingVectorEnv",
    ),
    TaskDescription(
        id="fieldgym/ProduceSorting-v0",
        machine="six-degree-of-freedom 3-PRRS with a two-finger gripper over a moving belt",
        paper="Du, Guo, Niu 2015, J. Shandong Univ. Technol. 29(5) 43-48",
        decision="which item next, or wait",
        actions="Discrete(K + 1): slot, or wait",
        scenarios=("load-0.7", "load-1.0", "load-1.25", "load-1.6", "clumped-1.25"),
        headline_scenario="load-1.25",
        backends=_BACKENDS,
        perceptions=_PERCEPTIONS,
        entry_point="fieldgym.envs.sorting.env:ProduceSortingEnv",
        vector_entry_point="fieldgym.envs.sorting.env:ProduceSortingVectorEnv",
    ),
)

ENV_IDS = tuple(task.id for task in TASKS)


def register() -> None:
    """Register every environment; calling it again changes nothing."""
    for task in TASKS:
        if task.id not in gym.registry:
            gym.register(task.id, entry_point=task.entry_point, vector_entry_point=task.vector_entry_point)


def describe(env_id: str) -> TaskDescription:
    """Description of a registered id.

    Raises:
        ValueError: unknown id; the message lists the choices.
    """
    for task in TASKS:
        if task.id == env_id:
            return task
    near = get_close_matches(env_id, ENV_IDS, n=1, cutoff=0.3)
    hint = f"did you mean {near[0]!r}? " if near else ""
    raise ValueError(f"environment {env_id!r} is unknown: {hint}choose one of {', '.join(ENV_IDS)}")
