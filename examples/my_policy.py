"""A policy of one's own for laser weeding: the weed that leaves first, a low dose for the smallest ones.

fieldgym benchmark --env LaserWeeding --policies fifo,my_policy.py:LowDoseFirst --episodes 20 --backend analytic
"""

import numpy as np


class LowDoseFirst:
    """Slots are in the order in which their weeds leave, so the first legal action is the most urgent weed's."""

    def __init__(self, env, seed):
        """Learn from the environment what stands where in an observation."""
        core = env.unwrapped.core
        self.width = len(core.candidate_features)
        self.cotyledon = core.candidate_features.index("cotyledon")

    def act(self, observation):
        """Actions (B,) for a batch of observations, see the environment's page for their meaning."""
        mask = observation["action_mask"]
        worlds = np.arange(len(mask))
        first = mask.argmax(axis=1)
        table = observation["candidates"].reshape(len(mask), -1, self.width)
        slot = np.minimum(first // 3, table.shape[1] - 1)
        small = table[worlds, slot, self.cotyledon] > 0.5
        normal = np.minimum(3 * slot + 1, mask.shape[1] - 1)
        return np.where(~small & (mask[worlds, normal] > 0) & (first % 3 == 0), normal, first)
