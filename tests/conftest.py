"""What several test modules check in the same way."""

import copy
import signal
import threading
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import hypothesis
import leftovers
import numpy as np
import pytest

from fieldgym import bounds
from fieldgym.agents import make_policy, policy_names
from fieldgym.agents.evaluation import evaluate
from fieldgym.envs import task

if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # Begun in a shell's background: every child would inherit that Ctrl-C is ignored, and tests send it to some.
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Every run tries the same examples: what fails once fails again.
hypothesis.settings.register_profile("fixed", derandomize=True)
hypothesis.settings.load_profile("fixed")

EXACT = 1e-9


@pytest.fixture(scope="session", autouse=True)
def _logs_of_learners_are_temporary(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Stable-Baselines3 makes a folder for every run that names none, and leaves it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SB3_LOGDIR", str(tmp_path_factory.mktemp("logs")))
        yield


@pytest.fixture(scope="module", autouse=True)
def _restored_after_a_module() -> Iterator[None]:
    """What the fixtures of a file register, and the folders of their modules, no other file sees."""
    with leftovers.restored():
        yield


@pytest.fixture(autouse=True)
def _nothing_is_left_behind() -> Iterator[None]:
    """Tests run in any order: what one changes beyond itself, another one would find."""
    before = leftovers.state()
    with leftovers.restored():
        yield
    left = leftovers.changed(before, leftovers.state())
    assert not left, f"the test leaves changed: {', '.join(left)}"


@pytest.fixture
def no_policy_beats() -> Callable[[str, range, str], list[Any]]:
    """Play every policy of an id on seeds of a scenario, hold it against each seed's bound, and return the bounds."""

    def check(env_id: str, seeds: range, scenario: str) -> list[Any]:
        instances = [bounds.instance(env_id, seed, scenario=scenario, carried_out=False) for seed in seeds]
        found = [instance.bound() for instance in instances]
        for name in task(env_id).lineup(scenario, policy_names(env_id)):

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


class Best(NamedTuple):
    """What can be had on a small instance: largest return, net rate, and shortest cycle time at that net rate."""

    episode_return: float
    net_rate: float
    cycle_time_s: float


@pytest.fixture
def best_by_trying() -> Callable[[Any], Best]:
    """Try every sequence of legal actions from where the rules of one world stand."""

    def search(core: Any) -> Best:
        best_return, cycles, ends = -np.inf, [], []

        def go_on(core: Any, total: float) -> None:
            nonlocal best_return
            for action in np.flatnonzero(core.observe()["action_mask"][0]):
                child = copy.deepcopy(core)
                plan = child.plan(np.array([action]))
                result = child.apply(plan, child.nominal(plan))
                value = total + float(result.rewards.sum())
                scores = dict(zip(child.score_names, child.scores()[0].tolist(), strict=True))
                cycles.append((scores["net_rate"], scores["cycle_time_s"], scores["done"]))
                if result.terminated[0] or result.truncated[0]:
                    best_return = max(best_return, value)
                    ends.append(scores["net_rate"])
                else:
                    go_on(child, value)

        go_on(core, 0.0)
        best_rate = max(ends)
        shortest = min((cycle for rate, cycle, done in cycles if done and rate >= best_rate - EXACT), default=np.inf)
        return Best(best_return, best_rate, shortest)

    return search
