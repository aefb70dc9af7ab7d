"""Policies: which target comes next."""

from .policies.base import Policy, act_single
from .registry import make_policy, policy_names, reference_policy

__all__ = ["Policy", "act_single", "make_policy", "policy_names", "reference_policy"]
