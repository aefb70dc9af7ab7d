"""Policies from anywhere: found, made by one rule, named as they were asked for, and one line for every mistake."""

import itertools
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.agents import make_policy, policy_names
from fieldgym.agents.learning import portable
from fieldgym.agents.policies.weights import PolicyFileError
from fieldgym.agents.sources import PolicySourceError, policy_source
from fieldgym.envs import env_ids, register_policy, task

ENV = "fieldgym/LaserWeeding-v0"
FIRST = """
class {name}:
    {extra}
    def act(self, observation):
        return observation["action_mask"].argmax(axis=1)
"""
_NUMBERS = itertools.count()


@pytest.fixture(scope="module")
def env() -> Iterator[Any]:
    made = gym.make(ENV, backend="analytic", perception="model")
    yield made
    made.close()


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], str]:
    """Makes a package of one module that nothing else has the name of."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(text: str) -> str:
        package = f"guests{next(_NUMBERS)}"
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text("")
        (tmp_path / package / "policies.py").write_text(text)
        return f"{package}.policies"

    return write


@pytest.mark.parametrize("env_id", env_ids())
def test_a_policy_is_called_what_it_was_made_by(env_id: str):
    env = gym.make(env_id, backend="analytic", perception="model")
    for name in policy_names(env_id):
        assert make_policy(name, env).name == name
    env.close()


@pytest.mark.parametrize(
    ("extra", "told"),
    [
        ("", ()),
        ("def __init__(self): self.told = ()", ()),
        ("def __init__(self, env): self.told = (env,)", ("env",)),
        ("def __init__(self, seed): self.told = (seed,)", ("seed",)),
        ("def __init__(self, seed, *, env=None): self.told = (seed, env)", ("seed", "env")),
        ("def __init__(self, world, number): self.told = (world, number)", ("env", "seed")),
        ("def __init__(self, slots=3): self.told = (slots,)", (3,)),
        (
            "make = classmethod(lambda cls, env, seed: cls(seed));\n    def __init__(self, n): self.told = (n,)",
            ("seed",),
        ),
    ],
)
def test_a_class_gets_what_it_asks_for(env: Any, tmp_path: Path, extra: str, told: tuple[Any, ...]):
    (tmp_path / "mine.py").write_text(FIRST.format(name="Mine", extra=extra))
    name = f"{tmp_path}/mine.py:Mine"
    policy: Any = make_policy(name, env, 7)
    given = {"env": env, "seed": 7}
    assert policy.name == name
    assert getattr(policy.guest, "told", ()) == tuple(given.get(word, word) for word in told)
    observation, _ = env.reset(seed=1)
    batch = {key: np.stack([values] * 3) for key, values in observation.items()}
    policy.reset(np.ones(3, bool))
    assert (policy.act(batch) == batch["action_mask"].argmax(axis=1)).all()


def test_a_reset_is_passed_on_and_a_factory_may_lie_in_a_class(env: Any, tmp_path: Path):
    (tmp_path / "mine.py").write_text(
        "class A:\n    rows = None\n    act = None\n    def reset(self, rows): self.rows = rows\n"
        "    def act(self, observation): return [0]\n"
        "class Shelf:\n    @staticmethod\n    def best(env, seed): return A()\n"
    )
    policy: Any = make_policy(f"{tmp_path}/mine.py:Shelf.best", env)
    policy.reset(np.array([True]))
    assert policy.guest.rows.tolist() == [True]


def test_a_changed_file_is_another_policy_and_the_old_source_says_so(env: Any, tmp_path: Path):
    path = tmp_path / "mine.py"
    path.write_text(FIRST.format(name="Mine", extra="version = 1"))
    before = policy_source(ENV, f"{path}:Mine")
    assert before.make(env, 0).guest.version == 1  # type: ignore[attr-defined]
    path.write_text(FIRST.format(name="Mine", extra="version = 2"))
    after = policy_source(ENV, f"{path}:Mine")
    assert after.sha256 != before.sha256 and len(after.sha256) == 16
    assert after.make(env, 0).guest.version == 2  # type: ignore[attr-defined]
    with pytest.raises(PolicySourceError, match="has changed since it was named"):
        before.make(env, 0)


def test_a_module_s_class_and_its_digest(env: Any, module: Callable[[str], str], tmp_path: Path):
    name = module(FIRST.format(name="Mine", extra=""))
    policy = make_policy(f"{name}:Mine", env)
    assert policy.name == f"{name}:Mine"
    before = policy_source(ENV, f"{name}:Mine").sha256
    (tmp_path / name.split(".")[0] / "helpers.py").write_text("STEP = 2\n")
    assert policy_source(ENV, f"{name}:Mine").sha256 != before


def test_a_file_finds_what_lies_beside_it(env: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "path", list(sys.path))
    helper = f"beside{next(_NUMBERS)}"
    (tmp_path / f"{helper}.py").write_text(FIRST.format(name="Base", extra=""))
    (tmp_path / "mine.py").write_text(f"from {helper} import Base\nclass Mine(Base): pass\n")
    assert make_policy(f"{tmp_path}/mine.py:Mine", env).name.endswith("mine.py:Mine")


@pytest.mark.parametrize(
    ("text", "target", "message"),
    [
        ("def broken(:\n    pass\n", "Mine", r"mine\.py, line 1: SyntaxError: "),
        ("import numpy\n\nnumpy.nothing()\n", "Mine", r"mine\.py, line 3: AttributeError: "),
        ("raise SystemExit(3)\n", "Mine", r"mine\.py, line 1: SystemExit: 3"),
        ("import no_such_module_at_all\n", "Mine", r"mine\.py, line 1: ModuleNotFoundError: "),
        (FIRST.format(name="Mine", extra=""), "Mime", "there is no 'Mime': did you mean 'Mine'"),
        ("Mine = 3\n", "Mine", "is a int: name a class or a function"),
        ("class Mine: pass\n", "Mine", r"is a Mine: it needs act\(observation\)"),
        (
            FIRST.format(name="Mine", extra="def __init__(self, slots): pass"),
            "Mine",
            r"requires slots: let it take \(env,",
        ),
        (
            FIRST.format(name="Mine", extra="def __init__(self):\n        1 / 0"),
            "Mine",
            r"mine\.py, line 4: ZeroDivisionError",
        ),
    ],
)
def test_a_broken_file_gets_one_line(env: Any, tmp_path: Path, text: str, target: str, message: str):
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(PolicySourceError, match=message) as raised:
        make_policy(f"{path}:{target}", env)
    assert "\n" not in str(raised.value) and str(path) in str(raised.value)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("raise KeyError('no\\nsuch')", r"mine\.py, line 3: KeyError: "),
        ("return observation['action_mask']", r"act gave int8 of shape \(1, \d+\): give a whole number a world"),
        ("return [0.5]", r"act gave float64 of shape \(1,\)"),
        ("return None", r"act gave object of shape \(\)"),
    ],
)
def test_a_policy_that_fails_when_it_decides_gets_one_line(env: Any, tmp_path: Path, body: str, message: str):
    (tmp_path / "mine.py").write_text(f"class Mine:\n    def act(self, observation):\n        {body}\n")
    policy = make_policy(f"{tmp_path}/mine.py:Mine", env)
    observation, _ = env.reset(seed=1)
    with pytest.raises(ValueError, match=message) as raised:
        policy.act({name: values[None] for name, values in observation.items()})
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("fife", "did you mean 'fifo'"),
        ("mine.py", "is a whole file: say what in it, as in mine.py:Mine"),
        ("nowhere/mine.py:Mine", "cannot read .*nowhere/mine.py"),
        ("no_such_module_at_all:Mine", "there is no module 'no_such_module_at_all'"),
        ("json.nothing:Mine", "there is no module 'json.nothing'"),
        ("nowhere.npz", "a policy is NAME.npz with NAME.json"),
        ("nowhere.zip", "runs code from it: say --trust"),
        ("", "is unknown for"),
        (":", "is unknown for"),
    ],
)
def test_a_name_that_means_nothing_gets_one_line(env: Any, name: str, message: str):
    with pytest.raises(PolicySourceError, match=message) as raised:
        make_policy(name, env)
    assert "\n" not in str(raised.value)


def test_an_error_inside_the_package_is_told_where_a_user_s_code_called_it(env: Any, tmp_path: Path):
    path = tmp_path / "mine.py"
    path.write_text(
        "from fieldgym.agents import make_policy\n\ndef mine(env, seed):\n    return make_policy('no', env)\n"
    )
    with pytest.raises(PolicySourceError, match=rf"{path}, line 4: PolicySourceError: policy 'no' is unknown"):
        make_policy(f"{path}:mine", env)
    with pytest.raises(PolicySourceError) as raised:
        make_policy("no_such_package_at_all.policies:Mine", env)
    assert ", line " not in str(raised.value)


def test_portable_weights_are_a_policy(env: Any, tmp_path: Path):
    shipped = portable.shipped(ENV, task(ENV).headline)
    assert shipped is not None
    path = tmp_path / "own.npz"
    portable.save(path, portable.load(shipped))
    policy, learned = make_policy(str(path), env), make_policy("learned", env)
    assert policy.name == str(path)
    observation, _ = env.reset(seed=2)
    batch = {name: values[None] for name, values in observation.items()}
    assert policy.act(batch) == learned.act(batch)
    card = path.with_suffix(".json")
    before = policy_source(ENV, str(path)).sha256
    card.write_text(card.read_text().replace(ENV, "fieldgym/HoeWeeding-v0"))
    assert policy_source(ENV, str(path)).sha256 != before
    with pytest.raises(PolicyFileError, match="was trained on fieldgym/HoeWeeding-v0"):
        make_policy(str(path), env)
    # Who trained it named the task's module too.
    card.write_text(card.read_text().replace("fieldgym/HoeWeeding-v0", f"some.module:{ENV}"))
    assert make_policy(str(path), env).act(batch) == learned.act(batch)


def test_a_registered_policy_is_made_by_the_same_rule(monkeypatch: pytest.MonkeyPatch, module: Callable[[str], str]):
    from fieldgym.envs.task import _POLICIES

    monkeypatch.setitem(_POLICIES, ENV, {})
    name = module(FIRST.format(name="Mine", extra="__slots__ = ()"))
    register_policy(ENV, "mine", f"{name}:Mine")
    assert "mine" in policy_names(ENV)
    env = gym.make(ENV, backend="analytic", perception="model")
    assert make_policy("mine", env).name == "mine"
    assert policy_source(ENV, "mine").sha256 == policy_source(ENV, f"{name}:Mine").sha256 != ""
    assert policy_source(ENV, "fifo").sha256 == ""
    env.close()


@pytest.mark.slow
def test_a_saved_model_needs_trust_and_then_decides(env: Any, tmp_path: Path):
    contrib = pytest.importorskip("sb3_contrib")
    from stable_baselines3 import PPO

    from fieldgym.agents.learning.sb3 import make_vec_env

    worlds = make_vec_env(ENV, 2, seed=0)
    observation = worlds.reset()
    for algorithm in (contrib.MaskablePPO, PPO):
        path = tmp_path / f"{algorithm.__name__}.zip"
        model = algorithm("MultiInputPolicy", worlds, n_steps=2, batch_size=4, seed=1, policy_kwargs={"net_arch": [8]})
        model.save(path)
        with pytest.raises(PolicySourceError, match="runs code from it"):
            make_policy(str(path), env)
        policy = make_policy(str(path), env, trust=True)
        assert policy.name == str(path)
        masks: Any = {"action_masks": worlds.action_masks()} if algorithm is contrib.MaskablePPO else {}
        wanted, _ = model.predict(observation, deterministic=True, **masks)
        assert (policy.act(observation) == wanted).all()
    other = gym.make("fieldgym/TrayTransplanting-v0", backend="analytic")
    with pytest.raises(PolicyFileError, match="was trained on other observations or actions"):
        make_policy(str(tmp_path / "PPO.zip"), other, trust=True)
    (tmp_path / "text.zip").write_text("no archive")
    with pytest.raises(PolicyFileError, match="cannot be loaded as a model"):
        make_policy(str(tmp_path / "text.zip"), env, trust=True)
    other.close()


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"scenario": "load-1.0"}, "load-1.0$"),
        ({"slots": 9}, "load-1.25 with slots = 9$"),
        ({"overrides": {"scenario.strip_m": 5.0}}, "custom with scenario.strip_m = 5.0"),
        ({"eyes": "classical"}, "load-1.25 with eyes = classical$"),
    ],
)
def test_a_learned_policy_on_other_numbers_says_so(settings: dict[str, Any], told: str):
    env = gym.make(ENV, backend="analytic", perception="model", **settings)
    with pytest.warns(UserWarning, match=f"trained on load-1.25, this is {told}"):
        make_policy("learned", env)
    env.close()


def test_a_learned_policy_on_its_own_numbers_says_nothing():
    assert task(ENV).headline == "load-1.25"
    env = gym.make(ENV, backend="analytic", perception="model")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        make_policy("learned", env)
