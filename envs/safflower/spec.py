"""What the package knows of safflower picking."""

from __future__ import annotations

from ..task import TaskSpec

_RULES = ("fixed-order", "nearest", "nearest-2opt", "grams-per-second", "route")

PICKING = TaskSpec(
    id="fieldgym/SafflowerPicking-v0",
    entry_point="fieldgym.envs.safflower.env:SafflowerPickingEnv",
    vector_entry_point="fieldgym.envs.safflower.env:SafflowerPickingVectorEnv",
    machine="planar five-bar with shear and suction on a cart that stops",
    paper="Guo et al. 2022, Engenharia Agricola 42(1) e20210129",
    decision="which head next, how thoroughly, when to drive on",
    actions="Discrete(3 K + 1): slot x (quick, normal, thorough), or drive on; on bag one more, empty the bag",
    policies={
        "fixed-order": "fieldgym.agents.policies.safflower:FixedOrder.make",
        "nearest": "fieldgym.agents.policies.safflower:Nearest.make",
        "nearest-2opt": "fieldgym.agents.policies.safflower:NearestTwoOpt.make",
        "grams-per-second": "fieldgym.agents.policies.safflower:GramsPerSecond.make",
        "route": "fieldgym.agents.policies.safflower:Route.make",
        "closing-first": "fieldgym.agents.policies.safflower_bag:ClosingFirst.make",
        "bag-horizon": "fieldgym.agents.policies.safflower_bag:BagHorizon.make",
        "learned": "fieldgym.agents.registry:make_learned",
    },
    reference="fixed-order",
    best={"": "route", "pots": "grams-per-second", "row": "learned", "bag": "bag-horizon"},
    planners=("nearest-2opt", "route", "bag-horizon"),
    bound="fieldgym.bounds.safflower:instance_of",
    ordering=("bag",),
    lineups={"": (*_RULES, "learned"), "bag": (*_RULES, "closing-first", "bag-horizon", "learned")},
    learning="fieldgym.agents.learning:settings/SafflowerPicking-v0.yaml",
)
