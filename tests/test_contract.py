"""Every task keeps the contract, and the check of it notices the tasks that do not."""

import importlib
import sys
from dataclasses import replace
from itertools import count
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from twins import at_night

import fieldgym
from fieldgym import TaskSpec, env_ids, register_policy, register_task, task
from fieldgym.agents import policy_names
from fieldgym.envs import register
from fieldgym.envs.vector import TaskVectorEnv
from fieldgym.testing import MODES, ContractError, check_batch, check_policies, check_task

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
OWN = tuple(env_id for env_id in env_ids() if env_id.startswith("fieldgym/"))
KEEPERS = [pytest.param(own, marks=at_night(own)) for own in OWN]


@pytest.mark.parametrize("env_id", KEEPERS)
def test_the_package_s_tasks_keep_the_contract(env_id):
    easy = {"eyes": "classical", "pictures": "easy"} if "Weeding" in env_id else {}
    assert len(check_task(env_id, settings=easy)) >= 14


BATCHES = [(env_id, task(env_id).headline, "NextStep", 64, 110) for env_id in OWN]
BATCHES += [(env_id, task(env_id).scenarios[-1], mode, 8, 400) for env_id in OWN for mode in ("NextStep", "SameStep")]


@pytest.mark.slow
@pytest.mark.parametrize(("env_id", "scenario", "mode", "worlds", "decisions"), BATCHES)
def test_larger_batches_equal_single_worlds(env_id, scenario, mode, worlds, decisions):
    check_batch(env_id, scenario, mode, worlds, decisions, threads=MODES[mode])


@pytest.mark.parametrize("env_id", OWN)
def test_registration_is_idempotent_and_the_module_may_be_named(env_id):
    register()
    env = gym.make("fieldgym:" + env_id, backend="analytic")
    assert env.spec is not None and env.spec.id == env_id


@pytest.fixture(scope="module")
def strawberry():
    """The example's module, its task registered."""
    sys.path.insert(0, str(EXAMPLES / "strawberry"))
    module = importlib.import_module("strawberry")
    register_task(module.SPEC)
    yield module
    sys.path.remove(str(EXAMPLES / "strawberry"))


def test_a_task_of_one_s_own_keeps_it_too(strawberry):
    told = []
    assert list(check_task("farm/StrawberryPicking-v0", on_check=told.append)) == told


def shares_its_arrays(core):
    def observe(self):
        if not hasattr(self, "kept"):
            self.kept = core.observe(self)
        for name, values in core.observe(self).items():
            self.kept[name][...] = values
        return self.kept

    return {"observe": observe}


def leaves_its_space(core):
    return {"observe": lambda self: {**(seen := core.observe(self)), "machine": seen["machine"] + np.float32(99.0)}}


def swaps_two_scores(core):
    return {"score_names": (core.score_names[1], core.score_names[0], *core.score_names[2:])}


def forgets_time(core):
    return {"apply": lambda self, plan, outcome: core.apply(self, plan, outcome)._replace(phases_s=0.5 * outcome[3])}


def counts_nothing_illegal(core):
    def scores(self):
        card = core.scores(self)
        card[:, 7] = 0.0
        return card

    return {"scores": scores}


def is_not_what_it_was_loaded_with(core):
    loads = count()

    def load(self, rows, batch):
        core.load(self, rows, batch)
        self.place[rows, 0, 0] += 0.01 * (next(loads) % 5)

    return {"load": load}


def plays_with_open_dice(core):
    def draw_field(self, generator):
        return core.draw_field(self, np.random.default_rng())

    return {"draw_field": draw_field}


def depends_on_its_neighbours(core):
    def observe(self):
        seen = core.observe(self)
        seen["machine"][:, 2] += np.float32(0.001 * (self.worlds - 1))
        return seen

    return {"observe": observe}


def yields_more_than_there_is(core):
    def scores(self):
        card = core.scores(self)
        card[:, 0] += 1.0
        return card

    return {"scores": scores}


BREAKS = {
    shares_its_arrays: "observation",
    leaves_its_space: "space",
    swaps_two_scores: "scorecard does not begin",
    forgets_time: "phases do not add up",
    counts_nothing_illegal: "not counted",
    is_not_what_it_was_loaded_with: "other",
    plays_with_open_dice: "other episodes|other observations",
    depends_on_its_neighbours: "differs",
    yields_more_than_there_is: "net_rate",
}


@pytest.mark.parametrize("fault", BREAKS, ids=lambda fault: fault.__name__)
def test_a_task_that_breaks_it_is_told_where(strawberry, fault, monkeypatch):
    name = fault.__name__.replace("_", "-")
    core = type("Broken", (strawberry.StrawberryCore,), fault(strawberry.StrawberryCore))
    parts = replace(strawberry.StrawberryEnv.assembly, core=core)
    single = type("BrokenEnv", (strawberry.StrawberryEnv,), {"assembly": parts})
    batch: type[TaskVectorEnv] = type("BrokenVectorEnv", (strawberry.StrawberryVectorEnv,), {"assembly": parts})
    # Not registered under a module's name: what a fresh process does is checked with a task that it can import.
    monkeypatch.setattr("fieldgym.testing._processes", lambda *args: None)
    monkeypatch.setattr("fieldgym.testing._gymnasium", lambda *args: None)
    monkeypatch.setattr("fieldgym.testing._stable_baselines", lambda *args: None)
    monkeypatch.setattr("fieldgym.testing._specification", lambda *args: None)
    spec = replace(strawberry.SPEC, id=f"broken/{name}-v0", entry_point=single, vector_entry_point=batch)
    register_task(spec)
    with pytest.raises(ContractError, match=BREAKS[fault]):
        check_task(spec.id, worlds=3, decisions=40)


class Blind:
    """Picks the first berry again and again."""

    def __init__(self, env, seed):
        pass

    def act(self, observation):
        return np.zeros(len(observation["machine"]), int)


def test_a_policy_that_acts_illegally_is_named(strawberry):
    policies = {"nearest": "strawberry:Nearest", "blind": Blind}
    register_task(replace(strawberry.SPEC, id="broken/blind-v0", policies=policies))
    with pytest.raises(ContractError, match=r"^policy blind takes \d{3} illegal actions in 2 episodes$"):
        check_policies("broken/blind-v0", "wall")
    with pytest.raises(ContractError, match="policies and bound: policy blind takes"):
        check_task("broken/blind-v0", backends=(), worlds=1, decisions=1)


def test_what_is_registered_twice_or_nowhere_is_named(strawberry):
    assert fieldgym.task("strawberry:farm/StrawberryPicking-v0") is fieldgym.task("farm/StrawberryPicking-v0")
    register_task(strawberry.SPEC)
    with pytest.raises(ValueError, match="is called 'farm/StrawberryPicking-v0' already"):
        register_task(replace(strawberry.SPEC, reference="random"))
    with pytest.raises(ValueError, match=r"did you mean 'farm/StrawberryPicking-v0'"):
        task("farm/StrawberyPicking-v0")
    with pytest.raises(ValueError, match="cannot import no_such_module"):
        task("no_such_module:farm/Nothing-v0")
    with pytest.raises(ValueError, match="namespace/Name-v0"):
        replace(strawberry.SPEC, id="Berries")
    with pytest.raises(ValueError, match="name one of its policies"):
        replace(strawberry.SPEC, reference="nobody")


def test_a_policy_s_name_is_taken_once_and_is_a_word(strawberry):
    register_policy("farm/StrawberryPicking-v0", "again", "strawberry:Nearest")
    register_policy("farm/StrawberryPicking-v0", "again", "strawberry:Nearest")
    assert policy_names("farm/StrawberryPicking-v0") == ("random", "nearest", "again")
    for name, factory in (("nearest", "x:y"), ("random", "x:y"), ("again", "strawberry:Other")):
        with pytest.raises(ValueError, match="already"):
            register_policy("farm/StrawberryPicking-v0", name, factory)
    for name in ("", "a b", "mine.py", "a:b", "a,b", "x.npz"):
        with pytest.raises(ValueError, match="give a word"):
            register_policy("farm/StrawberryPicking-v0", name, "x:y")


def test_a_specification_is_a_value(strawberry):
    assert isinstance(strawberry.SPEC, TaskSpec) and strawberry.SPEC == replace(strawberry.SPEC)
    assert strawberry.SPEC.scenarios == ("wall", "dense") and strawberry.SPEC.headline == "wall"
    assert strawberry.SPEC.backends == ("analytic",) and strawberry.SPEC.perceptions == ("perfect",)
