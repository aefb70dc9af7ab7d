"""What the package knows of tray transplanting."""

from __future__ import annotations

from ..task import TaskSpec

TRANSPLANTING = TaskSpec(
    id="fieldgym/TrayTransplanting-v0",
    entry_point="fieldgym.envs.transplanting.env:TrayTransplantingEnv",
    vector_entry_point="fieldgym.envs.transplanting.env:TrayTransplantingVectorEnv",
    machine="translational five-bar with a plug gripper over two indexed conveyors",
    paper="Qi, Hu, Ma, Zhang, CCTA 2011, 10.1007/978-3-642-27275-2_11",
    decision="which seedling into which cell, how gently, when to index",
    actions="Discrete(3 K + 2): pair x (gentle, normal, fast), index the source, or index the target",
    policies={
        "fixed-order": "fieldgym.agents.policies.transplanting:FixedOrder.make",
        "fixed-order-speed": "fieldgym.agents.policies.transplanting:FixedOrderChosenSpeed.make",
        "nearest": "fieldgym.agents.policies.transplanting:Nearest.make",
        "shortest-cycle": "fieldgym.agents.policies.transplanting:ShortestCycle.make",
        "assignment": "fieldgym.agents.policies.transplanting:Assignment.make",
        "2-opt": "fieldgym.agents.policies.transplanting:TwoOpt.make",
        "learned": "fieldgym.agents.registry:make_learned",
    },
    reference="fixed-order",
    best={"": "assignment", "fill": "learned"},
    planners=("assignment", "2-opt"),
    bound="fieldgym.bounds.transplanting:instance_of",
    learning="fieldgym.agents.learning:settings/TrayTransplanting-v0.yaml",
)
