"""The vector environment for SB3, the set policy, and policies in files."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.agents.learning import portable
from fieldgym.agents.policies.layout import Layout, layout_of
from fieldgym.agents.policies.network import NetworkPolicy, shapes
from fieldgym.agents.policies.weights import PolicyFileError
from fieldgym.envs import env_ids

ID = "fieldgym/SafflowerPicking-v0"
LAYOUT = Layout(machine=6, candidates=16, features=11, options=3, extras=1)


def legal(mask: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.where(mask > 0, rng.random(mask.shape), -1.0).argmax(axis=1)


def some_policy(hidden: int = 8, relations: int = 0) -> NetworkPolicy:
    rng = np.random.default_rng(1)
    weights = {n: rng.normal(size=s).astype(np.float32) for n, s in shapes(LAYOUT, hidden, relations).items()}
    return NetworkPolicy(LAYOUT, hidden, weights, {"env_id": ID}, relations=relations)


def observations(env_id: str = ID, worlds: int = 32, decisions: int = 6) -> dict[str, np.ndarray]:
    env = gym.make_vec(env_id, worlds, vectorization_mode="vector_entry_point")
    observation, _ = env.reset(seed=3)
    rng = np.random.default_rng(0)
    for _ in range(decisions):
        observation = env.step(legal(observation["action_mask"], rng))[0]
    return observation


def shuffled(observation: dict[str, np.ndarray], layout: Layout, order: np.ndarray) -> dict[str, np.ndarray]:
    table = observation["candidates"].reshape(-1, layout.candidates, layout.features)[:, order]
    mask = observation["action_mask"][:, layout.permute(order)]
    return {**observation, "candidates": table.reshape(len(table), -1), "action_mask": mask}


@pytest.mark.parametrize("env_id", env_ids())
def test_every_task_has_a_layout(env_id):
    env: Any = gym.make_vec(env_id, 2, vectorization_mode="vector_entry_point")
    layout = layout_of(env)
    assert layout.actions == env.single_action_space.n
    slots = np.arange(2 * layout.candidates * layout.blocks * layout.options).reshape(2, layout.candidates, -1)
    extras = -1 - np.arange(2 * layout.blocks * layout.extras).reshape(2, -1)
    logits = layout.join(slots, extras, np.concatenate)
    assert logits.shape == (2, layout.actions)
    assert sorted(logits.ravel()) == sorted([*slots.ravel(), *extras.ravel()])


def test_blocks_repeat_the_scheme_and_a_permutation_moves_slots_alone():
    layout = Layout(machine=1, candidates=2, features=1, options=2, extras=1, blocks=2)
    slots = np.array([[[1, 2, 11, 12], [3, 4, 13, 14]]])
    logits = layout.join(slots, np.array([[5, 15]]), np.concatenate)[0]
    assert logits.tolist() == [1, 2, 3, 4, 5, 11, 12, 13, 14, 15]
    assert logits[layout.permute(np.array([1, 0]))].tolist() == [3, 4, 1, 2, 5, 13, 14, 11, 12, 15]


@pytest.mark.parametrize("time_limit_ends", [False, True])
def test_sb3_env_equals_the_native_one(time_limit_ends):
    sb3 = pytest.importorskip("fieldgym.agents.learning.sb3")
    worlds = 16
    native = gym.make_vec(
        ID, worlds, vectorization_mode="vector_entry_point", autoreset_mode="SameStep", scenario="row-dense"
    )
    env = sb3.make_vec_env(ID, worlds, seed=7, scenario="row-dense", reward_scale=0.5, time_limit_ends=time_limit_ends)
    expected, _ = native.reset(seed=7)
    observation = env.reset()
    rng = np.random.default_rng(0)
    returns, lengths, ends, cut = np.zeros(worlds), np.zeros(worlds, int), 0, 0
    for _ in range(150):
        assert all(np.array_equal(observation[name], expected[name]) for name in expected)
        assert np.array_equal(np.stack(env.env_method("action_masks")), expected["action_mask"] > 0)
        actions = legal(expected["action_mask"], rng)
        expected, reward, terminated, truncated, info = native.step(actions)
        observation, scaled, done, infos = env.step(actions)
        assert np.array_equal(scaled, (0.5 * reward).astype(np.float32)) and scaled.dtype == np.float32
        assert np.array_equal(done, terminated | truncated)
        returns, lengths = returns + reward, lengths + 1
        for i in range(worlds):
            if not done[i]:
                assert infos[i] == {}
                continue
            last = info["final_obs"][i]
            assert all(np.array_equal(infos[i]["terminal_observation"][name], last[name]) for name in last)
            assert infos[i]["TimeLimit.truncated"] is (bool(truncated[i]) and not time_limit_ends)
            assert infos[i]["episode"]["r"] == pytest.approx(returns[i]) and infos[i]["episode"]["l"] == lengths[i]
            assert infos[i]["scorecard"]["net_rate"] == info["final_info"]["scorecard"]["net_rate"][i]
            returns[i], lengths[i], ends, cut = 0.0, 0, ends + 1, cut + bool(truncated[i])
    assert ends > worlds and 0 < cut
    env.close()
    env.close()


def test_sb3_env_answers_what_learners_ask():
    sb3 = pytest.importorskip("fieldgym.agents.learning.sb3")
    from sb3_contrib.common.maskable.utils import get_action_masks, is_masking_supported
    from stable_baselines3.common.evaluation import evaluate_policy
    from stable_baselines3.common.vec_env import VecCheckNan

    env = sb3.make_vec_env(ID, 3, seed=1)
    observation = env.reset()
    assert is_masking_supported(env) and is_masking_supported(VecCheckNan(env))
    assert np.array_equal(get_action_masks(env), observation["action_mask"] > 0)
    assert np.array_equal(env.get_attr("action_masks", [2])[0](), observation["action_mask"][2] > 0)
    assert env.get_attr("render_mode") == [None] * 3 and not env.has_attr("nonsense")
    with pytest.raises(AttributeError, match="action_masks"):
        env.env_method("fly")

    class DriveOn:
        def predict(self, observation: Any, **_: Any) -> tuple[np.ndarray, None]:
            return np.full(len(observation["machine"]), 48), None

    driver: Any = DriveOn()
    mean = np.mean(evaluate_policy(driver, env, 6)[0])
    assert -5.0 < mean < 0.0
    for make in (
        lambda: sb3.make_vec_env(ID, 0),
        lambda: sb3.make_vec_env(ID, 2, reward_scale=0.0),
        lambda: sb3.NativeVecEnv(gym.make_vec(ID, 2, vectorization_mode="vector_entry_point")),
    ):
        with pytest.raises(ValueError, match=r"num_envs|reward_scale|SameStep"):
            make()
    with pytest.raises(TypeError, match="native"):
        sb3.NativeVecEnv(gym.make_vec("CartPole-v1", 2))


@pytest.fixture(scope="module", params=[0, 4], ids=["pooling", "relations"])
def learner(request):
    """A few updates of MaskablePPO with the set policy."""
    sb3 = pytest.importorskip("fieldgym.agents.learning.sb3")
    import torch
    from sb3_contrib import MaskablePPO

    from fieldgym.agents.learning.set_policy import MaskableSetPolicy

    torch.set_num_threads(1)
    env = sb3.make_vec_env(ID, 16, seed=1)
    model = MaskablePPO(
        MaskableSetPolicy,
        env,
        n_steps=16,
        batch_size=128,
        n_epochs=2,
        learning_rate=3e-3,
        seed=0,
        device="cpu",
        policy_kwargs={"layout": layout_of(env.native), "hidden": 16, "critic_hidden": 16, "relations": request.param},
    )
    return model.learn(16 * 16 * 4)


def torch_logits(model: Any, observation: dict[str, np.ndarray]) -> np.ndarray:
    import torch

    with torch.no_grad():
        features = model.policy.extract_features(model.policy.obs_to_tensor(observation)[0])
        return model.policy.mlp_extractor.forward_actor(features).numpy()


def test_maskable_ppo_learns_with_the_set_policy(learner):
    assert learner.num_timesteps == 1024 and learner._n_updates == 8
    observation = observations()
    masks = observation["action_mask"] > 0
    actions, _ = learner.predict(observation, action_masks=masks)
    assert masks[np.arange(len(actions)), actions].all()


def test_slot_order_moves_the_logits_and_nothing_else(learner):
    import torch

    observation = observations()
    order = np.random.default_rng(5).permutation(LAYOUT.candidates)
    logits, moved = (torch_logits(learner, o) for o in (observation, shuffled(observation, LAYOUT, order)))
    assert not np.allclose(logits[:, :-1], moved[:, :-1])
    assert np.allclose(logits[:, LAYOUT.permute(order)], moved, atol=1e-5)
    with torch.no_grad():
        values = [
            learner.policy.predict_values(learner.policy.obs_to_tensor(o)[0]).numpy()
            for o in (observation, shuffled(observation, LAYOUT, order))
        ]
    assert np.allclose(*values, atol=1e-5) and np.ptp(values[0]) > 0.0


def test_a_file_decides_as_the_network_did(learner, tmp_path):
    actor = learner.policy.mlp_extractor.actor
    weights = {name: values.numpy() for name, values in actor.state_dict().items()}
    card = {"env_id": ID, "note": "test"}
    portable.save(tmp_path / "p.npz", NetworkPolicy(LAYOUT, 16, weights, card, relations=learner.policy.relations))
    policy = portable.load(tmp_path / "p.npz")
    assert isinstance(policy, NetworkPolicy)
    observation = observations(worlds=64)
    possible = observation["action_mask"] > 0
    difference = np.abs(policy.logits(observation) - torch_logits(learner, observation))[possible]
    assert difference.max() < 1e-5
    actions, _ = learner.predict(observation, deterministic=True, action_masks=possible)
    assert np.array_equal(policy.act(observation), actions)
    assert policy.card["note"] == "test" and sorted(path.name for path in tmp_path.iterdir()) == ["p.json", "p.npz"]


def test_the_file_s_policy_needs_no_pytorch(tmp_path):
    portable.save(tmp_path / "p.npz", some_policy())
    code = f"""
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("torch", "stable_baselines3", "sb3_contrib", "yaml", "ortools"):
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Absent())
import gymnasium as gym, numpy as np
from pathlib import Path
import fieldgym
from fieldgym.agents import act_single
from fieldgym.agents.learning import portable
env = gym.make({ID!r}, backend="analytic")
policy = portable.load_for(Path({str(tmp_path / "p.npz")!r}), env)
observation, info = env.reset(seed=0)
assert env.step(act_single(policy, observation))[4]["scorecard"]["illegal"] == 0
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("relations", [0, 3])
def test_a_policy_fits_another_number_of_slots_and_no_other_task(tmp_path, relations):
    portable.save(tmp_path / "p.npz", some_policy(relations=relations))
    env: Any = gym.make(ID, backend="analytic", slots=5)
    policy = portable.load_for(tmp_path / "p.npz", env)
    observation, _ = env.reset(seed=1)
    assert policy.layout.candidates == 5
    assert observation["action_mask"][policy.act({n: v[None] for n, v in observation.items()})[0]] == 1
    with pytest.raises(ValueError, match="16 x 11"):
        some_policy(relations=relations).logits({n: v[None] for n, v in observation.items()})
    other = [env_id for env_id in env_ids() if env_id != ID]
    for env_id in other:
        with pytest.raises(PolicyFileError, match="was trained on"):
            portable.load_for(tmp_path / "p.npz", gym.make_vec(env_id, 1, vectorization_mode="vector_entry_point"))


def edit_card(path: Path, **changes: Any) -> None:
    card = path.with_suffix(".json")
    card.write_text(json.dumps({**json.loads(card.read_text()), **changes}))


def rewrite(path: Path, **changes: Any) -> None:
    with np.load(path) as arrays:
        weights: dict[str, Any] = dict(arrays)
    np.savez_compressed(path, **{name: v for name, v in {**weights, **changes}.items() if v is not None})


@pytest.mark.parametrize(
    ("damage", "word"),
    [
        (lambda p: p.unlink(), "cannot be read"),
        (lambda p: p.with_suffix(".json").unlink(), "NAME.json"),
        (lambda p: p.with_suffix(".json").write_text("{"), "no JSON"),
        (lambda p: p.with_suffix(".json").write_text("[" * 100_000), "no JSON"),
        (lambda p: p.with_suffix(".json").write_text("[]"), "format None"),
        (lambda p: p.with_suffix(".json").write_text(" " * 600_000), "at most"),
        (lambda p: edit_card(p, format="pickle"), "format 'pickle'"),
        (lambda p: edit_card(p, layout=7), "layout"),
        (lambda p: edit_card(p, layout={"machine": 6}), "layout"),
        (lambda p: edit_card(p, layout={**vars(LAYOUT), "candidates": -3}), "candidates = -3"),
        (lambda p: edit_card(p, layout={**vars(LAYOUT), "candidates": 10**9}), "out of range"),
        (lambda p: edit_card(p, hidden=10**9), "out of range"),
        (lambda p: edit_card(p, hidden="8"), "whole number"),
        (lambda p: edit_card(p, hidden=9), "wanted float32"),
        (lambda p: edit_card(p, relations=-1), "out of range"),
        (lambda p: edit_card(p, relations=2), "missing"),
        (lambda p: p.write_bytes(p.read_bytes()[:200]), "damaged"),
        (lambda p: p.write_bytes(b"GIF89a"), "damaged"),
        (lambda p: p.write_bytes(bytes(3_000_000)), "at most 2000000"),
        (lambda p: rewrite(p, bomb=np.zeros(5_000_000, np.float32)), "unpacks to"),
        (lambda p: rewrite(p, **{"own.bias": np.array([object()] * 8)}), "plain arrays"),
        (lambda p: rewrite(p, **{"own.bias": np.zeros(8)}), "float64"),
        (lambda p: rewrite(p, **{"own.bias": np.full(8, np.nan, np.float32)}), "not finite"),
        (lambda p: rewrite(p, **{"own.bias": None}), "own.bias"),
    ],
)
def test_a_bad_file_is_named_in_one_line(tmp_path, damage, word):
    path = tmp_path / "p.npz"
    portable.save(path, some_policy())
    damage(path)
    with pytest.raises(PolicyFileError, match=word) as caught:
        portable.load(path)
    assert "\n" not in str(caught.value) and path.stem in str(caught.value)


def test_what_cannot_be_saved_is_refused(tmp_path):
    with pytest.raises(PolicyFileError, match=r"\.npz"):
        portable.save(tmp_path / "p.pkl", some_policy())
    with pytest.raises(PolicyFileError, match="at most"):
        portable.save(tmp_path / "p.npz", some_policy(hidden=400))
    assert not list(tmp_path.iterdir())
