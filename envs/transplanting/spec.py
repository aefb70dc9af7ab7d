"""What the package knows of tray transplanting."""

from __future__ import annotations

from ..task import TaskSpec

_IN_LINE = ("fixed-order", "fixed-order-speed", "nearest", "shortest-cycle", "assignment", "2-opt", "learned")
_ORDERED = ("fixed-order", "nearest", "assignment", "earliest-due", "richest-tray", "receding-horizon", "learned")

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
        "earliest-due": "fieldgym.agents.policies.transplanting:EarliestDueFirst.make",
        "richest-tray": "fieldgym.agents.policies.transplanting:RichestTray.make",
        "receding-horizon": "fieldgym.agents.policies.tray_horizon:RecedingHorizon.make",
        "learned": "fieldgym.agents.registry:make_learned",
    },
    reference="fixed-order",
    best={"": "assignment", "fill": "learned", "orders": "receding-horizon"},
    planners=("assignment", "2-opt", "receding-horizon"),
    ordering=("orders",),
    lineups={"": _IN_LINE, "orders": _ORDERED},
    bound="fieldgym.bounds.orders:instance_of",
    learning="fieldgym.agents.learning:settings/TrayTransplanting-v0.yaml",
)
