"""What the package knows of produce sorting."""

from __future__ import annotations

from ..task import TaskSpec

SORTING = TaskSpec(
    id="fieldgym/ProduceSorting-v0",
    entry_point="fieldgym.envs.sorting.env:ProduceSortingEnv",
    vector_entry_point="fieldgym.envs.sorting.env:ProduceSortingVectorEnv",
    machine="six-degree-of-freedom 3-PRRS with a two-finger gripper over a moving belt",
    paper="Du, Guo, Niu 2015, J. Shandong Univ. Technol. 29(5) 43-48",
    decision="which item next, or wait",
    actions="Discrete(K + 1): slot, or wait",
    policies={
        "fifo": "fieldgym.agents.policies.sorting:Fifo.make",
        "edf": "fieldgym.agents.policies.sorting:EarliestDeadline.make",
        "nearest": "fieldgym.agents.policies.sorting:Nearest.make",
        "shortest-cycle": "fieldgym.agents.policies.sorting:ShortestCycle.make",
        "value-per-second": "fieldgym.agents.policies.sorting:ValuePerSecond.make",
        "receding-horizon": "fieldgym.agents.policies.sorting_orders:receding_horizon",
        "receding-horizon-value": "fieldgym.agents.policies.sorting_orders:receding_horizon_by_value",
        "learned": "fieldgym.agents.registry:make_learned",
    },
    reference="fifo",
    ordering=("orders",),
    best={"": "receding-horizon-value", "load-1.25": "learned"},
    planners=("receding-horizon", "receding-horizon-value"),
    bound="fieldgym.bounds.sorting:instance_of",
    learning="fieldgym.agents.learning:settings/ProduceSorting-v0.yaml",
    learners={"policy-iteration": "fieldgym.agents.learning.policy_iteration:iterate"},
)
