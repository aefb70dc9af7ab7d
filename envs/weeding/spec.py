"""What the package knows of weeding with a laser and with a hoe."""

from __future__ import annotations

from ..task import TaskSpec

_WANG = "Wang et al., 3UPS-RPU parallel mechanism for a laser weeding robot"
_RULES = {
    "fifo": "fieldgym.agents.policies.weeding:Fifo.make",
    "edf": "fieldgym.agents.policies.weeding:EarliestDeadline.make",
    "nearest": "fieldgym.agents.policies.weeding:Nearest.make",
    "shortest-dwell": "fieldgym.agents.policies.weeding:ShortestDwell.make",
    "kill-per-second": "fieldgym.agents.policies.weeding:KillPerSecond.make",
    "receding-horizon": "fieldgym.agents.policies.weeding_horizon:RecedingHorizon.make",
    "learned": "fieldgym.agents.registry:make_learned",
}

LASER_WEEDING = TaskSpec(
    id="fieldgym/LaserWeeding-v0",
    entry_point="fieldgym.envs.weeding.tools.laser.env:LaserWeedingEnv",
    vector_entry_point="fieldgym.envs.weeding.tools.laser.env:LaserWeedingVectorEnv",
    machine="3UPS-RPU laser platform on a cart that drives on, front camera and tool camera",
    paper=_WANG,
    decision="which weed next, with which dose, or wait",
    actions="Discrete(3 K + 1): slot x (low, normal, high dose), or wait a moment",
    policies=_RULES,
    reference="fifo",
    bound="fieldgym.bounds.weeding:instance_of",
    learning="fieldgym.agents.learning:settings/LaserWeeding-v0.yaml",
    best={"": "receding-horizon"},
    ordering=("battery", "worth"),
    planners=("receding-horizon",),
    sights=(
        ({}, 200),
        ({"eyes": "classical"}, 24),
        ({"pictures": "easy"}, 200),
        ({"eyes": "classical", "pictures": "easy"}, 24),
    ),
)

LASER_WEEDING_SPEED = TaskSpec(
    id="fieldgym/LaserWeedingSpeed-v0",
    entry_point="fieldgym.envs.weeding.tools.laser.env:LaserWeedingSpeedEnv",
    vector_entry_point="fieldgym.envs.weeding.tools.laser.env:LaserWeedingSpeedVectorEnv",
    machine="3UPS-RPU laser platform on a cart whose speed is chosen too",
    paper=_WANG,
    decision="which weed next, with which dose, or wait; and how fast to drive",
    actions="Discrete(3 (3 K + 1)): those of LaserWeeding-v0, each holding, lowering or raising the speed",
    policies={
        "constant-0.75": "fieldgym.agents.policies.weeding_horizon:constant_075",
        "constant-1": "fieldgym.agents.policies.weeding_horizon:constant_1",
        "constant-1.5": "fieldgym.agents.policies.weeding_horizon:constant_15",
        "hold-backlog": "fieldgym.agents.policies.weeding_horizon:hold_backlog",
        "hold-backlog-0.65": "fieldgym.agents.policies.weeding_horizon:hold_backlog_065",
        "learned": "fieldgym.agents.registry:make_learned",
    },
    reference="constant-1",
    demands={"demand-0.90": "perfect", "demand-0.60": "model"},
    bound="fieldgym.bounds.weeding:instance_of",
    learning="fieldgym.agents.learning:settings/LaserWeedingSpeed-v0.yaml",
    best={"": "hold-backlog", "demand-0.90": "hold-backlog-0.65", "demand-0.60": "hold-backlog-0.65"},
    planners=("hold-backlog", "hold-backlog-0.65"),  # the others' shots are planned too, their speed is constant
    sights=(({}, 16),),  # the laser's cameras, which play many more above
)

HOE_WEEDING = TaskSpec(
    id="fieldgym/HoeWeeding-v0",
    entry_point="fieldgym.envs.weeding.tools.hoe.env:HoeWeedingEnv",
    vector_entry_point="fieldgym.envs.weeding.tools.hoe.env:HoeWeedingVectorEnv",
    machine="six-degree-of-freedom 3-PRRS with a round hoe on a cart that drives on, front camera",
    paper="Du, Guo, Niu 2015, J. Shandong Univ. Technol. 29(5) 43-48",
    decision="which weed next, how deep to stir, or wait",
    actions="Discrete(3 K + 1): slot x (gentle, normal, deep), or wait a moment",
    policies=_RULES,
    reference="fifo",
    bound="fieldgym.bounds.weeding:instance_of",
    learning="fieldgym.agents.learning:settings/HoeWeeding-v0.yaml",
    best={"": "receding-horizon"},
    planners=("receding-horizon",),
    sights=(({}, 24),),
)
