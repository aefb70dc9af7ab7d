"""What several test modules check in the same way."""

from collections.abc import Callable
from typing import Any

import pytest

from fieldgym import bounds
from fieldgym.agents import make_policy, policy_names
from fieldgym.agents.evaluation import evaluate

EXACT = 1e-9


@pytest.fixture
def no_policy_beats() -> Callable[[str, range, str], list[Any]]:
    """Play every policy of an id on seeds of a scenario, hold it against each seed's bound, and return the bounds."""

    def check(env_id: str, seeds: range, scenario: str) -> list[Any]:
        instances = [bounds.instance(env_id, seed, scenario=scenario) for seed in seeds]
        found = [instance.bound() for instance in instances]
        for name in policy_names(env_id):

            def make(env: Any, name: str = name) -> Any:
                return make_policy(name, env, 1)

            scores = evaluate(make, env_id, seeds, scenario=scenario)
            card = scores.scorecard
            for i, (instance, bound) in enumerate(zip(instances, found, strict=True)):
                rate = card["net_rate"][i]
                assert rate <= bound.net_rate + EXACT, name
                assert scores.returns[i] <= bound.episode_return + EXACT, name
                least_s = instance.cycle_time_at(rate - EXACT)
                assert not card["done"][i] or card["cycle_time_s"][i] >= least_s - EXACT, name
        return found

    return check
