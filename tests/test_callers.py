"""Whoever calls: the order of calls, what is over stays over, copies, states, seeds, questions to a batch."""

import copy
import pickle
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.vector import AutoresetMode

from fieldgym import env_ids

pytestmark = pytest.mark.portable

OWN = tuple(env_id for env_id in env_ids() if env_id.startswith("fieldgym/"))
PICKER, TRAYS, LASER, SORTER = OWN[0], OWN[1], OWN[2], OWN[-1]
BACKENDS = ("analytic", "pybullet")
EQUIPPED = [(env_id, backend) for env_id in OWN for backend in BACKENDS]
SEEN: list[Any] = [(env_id, backend, "perfect") for env_id, backend in EQUIPPED]
SLOW = pytest.mark.slow
SEEN += [
    pytest.param(TRAYS, "pybullet", "camera", marks=SLOW),
    pytest.param(LASER, "analytic", "camera", marks=SLOW),
]


def single(env_id, backend="analytic", perception="perfect", **kwargs) -> Any:
    quick = {"eyes": "classical", "pictures": "easy"} if perception == "camera" and env_id == LASER else {}
    return gym.make(env_id, backend=backend, perception=perception, **quick, **kwargs).unwrapped


def batch(env_id, worlds, mode="NextStep", **kwargs) -> Any:
    return gym.make_vec(env_id, worlds, vectorization_mode="vector_entry_point", autoreset_mode=mode, **kwargs)


def chosen(mask, rng):
    return int(rng.choice(np.flatnonzero(mask)))


def played(env, decisions, seed=0):
    """What random legal decisions bring, as bytes, until the episode ends."""
    rng, seen = np.random.default_rng(seed), []
    for _ in range(decisions):
        observation, reward, terminated, truncated, info = env.step(chosen(env.action_masks(), rng))
        seen.append(
            (reward, terminated, truncated, str(info["scorecard"]), *(v.tobytes() for v in observation.values()))
        )
        if terminated or truncated:
            break
    return seen


def ended(env, seed=0):
    """Play to the end."""
    env.reset(seed=seed)
    played(env, 20_000)


@pytest.mark.parametrize(("env_id", "backend"), EQUIPPED)
def test_the_order_of_calls_is_held(env_id, backend):
    env = single(env_id, backend)
    for early in (lambda: env.step(0), env.action_masks, env.render, env.get_state):
        with pytest.raises(ResetNeeded, match=r"was not reset yet: call reset\(\) first$"):
            early()
    env.reset(seed=3)
    state, observation = env.get_state(), env.reset(seed=4)[0]
    env.close()
    env.close()
    for late in (lambda: env.step(0), env.reset, env.render, env.get_state, lambda: env.set_state(state)):
        with pytest.raises(ClosedEnvironmentError, match="closed: make a new one"):
            late()
    assert observation["action_mask"].any()
    with pytest.raises(ClosedEnvironmentError, match="closed"):
        copy.deepcopy(env).reset()


@pytest.mark.parametrize("env_id", OWN)
def test_a_finished_episode_does_not_go_on(env_id):
    env = single(env_id)
    ended(env)
    card, masks = env.core.scores().tobytes(), env.action_masks()
    for action in (0, int(env.action_space.n) - 1):
        with pytest.raises(ResetNeeded, match=r"the episode is over: call reset\(\)"):
            env.step(action)
    assert env.core.scores().tobytes() == card and np.array_equal(env.action_masks(), masks)
    twin = copy.deepcopy(env)
    with pytest.raises(ResetNeeded, match="over"):
        twin.step(0)
    twin.reset()
    env.reset()
    assert played(env, 5) == played(twin, 5)


@pytest.mark.parametrize("env_id", OWN)
def test_worlds_of_a_batch_that_are_over_stay_so(env_id):
    worlds, rng = 3, np.random.default_rng(2)
    env = batch(env_id, worlds, "Disabled", perception="perfect")
    observation, info = env.reset(seed=7)
    over = np.zeros(worlds, bool)
    last: list[Any] = [()] * worlds
    checked = 0
    while not over.all() or checked < 20:
        # Whoever mostly goes on, the last action, leaves something behind that a world could go on with.
        actions = np.array([chosen(mask, rng) for mask in observation["action_mask"]])
        going_on = ~over & (rng.random(worlds) < 0.8) & (observation["action_mask"][:, -1] > 0)
        actions[going_on] = int(env.single_action_space.n) - 1
        observation, reward, terminated, truncated, info = env.step(actions)
        for row in range(worlds):
            now = (
                *(values[row].tobytes() for values in observation.values()),
                *(values[row] for name, values in info["scorecard"].items() if not name.startswith("_")),
                terminated[row],
                truncated[row],
            )
            if over[row]:
                checked += 1
                assert now == last[row] and reward[row] == 0.0
                assert not any(part[row] for name, part in info["phases_s"].items() if not name.startswith("_"))
                assert np.array_equal(env.action_masks()[row], observation["action_mask"][row] > 0)
            last[row] = now
        over |= terminated | truncated
    first = np.arange(worlds) == 0
    observation, _ = env.reset(options={"reset_mask": first})
    assert all(values[1].tobytes() == last[1][i] for i, values in enumerate(observation.values()))
    _, _, terminated, truncated, _ = env.step(np.array([chosen(m, rng) for m in observation["action_mask"]]))
    assert (terminated | truncated)[1:].all() and not (terminated | truncated)[0]


def test_a_batch_s_order_of_calls_is_held():
    env = batch(PICKER, 3)
    for early in (lambda: env.step(np.zeros(3, int)), env.unwrapped.action_masks, env.unwrapped.get_state):
        with pytest.raises(ResetNeeded, match="world 0 was not reset yet"):
            early()
    env.reset(seed=1, options={"reset_mask": np.array([True, True, False])})
    with pytest.raises(ResetNeeded, match="world 2 was not reset yet"):
        env.step(np.zeros(3, int))
    env.reset(seed=1, options={"reset_mask": np.array([False, False, True])})
    env.step(np.zeros(3, int))
    state = env.unwrapped.get_state()
    env.close()
    for late in (lambda: env.step(np.zeros(3, int)), env.reset, lambda: env.unwrapped.set_state(state)):
        with pytest.raises(ClosedEnvironmentError, match="closed"):
            late()


@pytest.mark.parametrize(("env_id", "backend", "perception"), SEEN)
def test_copies_are_equal_and_go_on_by_themselves(env_id, backend, perception):
    env = single(env_id, backend, perception)
    before = pickle.loads(pickle.dumps(env))
    env.reset(seed=5)
    before.reset(seed=5)
    assert played(env, 4) == played(before, 4)
    before.close()
    within, other = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
    scores = other.core.scores().tobytes()
    there = played(env, 6, 1)
    assert other.core.scores().tobytes() == scores
    env.close()
    assert there == played(within, 6, 1) == played(other, 6, 1)
    within.reset()
    other.reset()
    assert played(within, 3, 2) == played(other, 3, 2)
    within.close()
    other.close()


@pytest.mark.parametrize(("env_id", "backend", "perception"), SEEN)
def test_states_lead_back_here_and_in_another_environment(env_id, backend, perception):
    env, other = single(env_id, backend, perception), single(env_id, backend, perception)
    env.reset(seed=5)
    other.reset(seed=99)
    played(other, 2)
    played(env, 4)
    state, told, field = env.get_state(), env.describe_last_decision(), env.field
    there = played(env, 6, 1)
    after = env.reset()[0]["candidates"].tobytes()
    for back in (env, other):
        observation, info = back.set_state(pickle.loads(pickle.dumps(state)))
        assert np.array_equal(observation["action_mask"], info["action_mask"])
        assert back.describe_last_decision() == told and back.field == field
        assert played(back, 6, 1) == there
        assert back.reset()[0]["candidates"].tobytes() == after
        back.close()


@pytest.mark.parametrize("env_id", OWN)
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_batch_copies_and_goes_back(env_id, mode):
    def rewards(env, decisions):
        rng, seen = np.random.default_rng(3), []
        for _ in range(decisions):
            observation, reward, *_ = env.step(np.array([chosen(mask, rng) for mask in env.action_masks()]))
            seen.append((reward.tobytes(), *(values.tobytes() for values in observation.values())))
        return seen

    env, other = (batch(env_id, 2, mode).unwrapped for _ in range(2))
    env.reset(seed=[4, np.int64(9)])
    rewards(env, 30)
    twin, state = pickle.loads(pickle.dumps(env)), env.get_state()
    there = rewards(env, 30)
    assert rewards(twin, 30) == there
    for back in (env, other):
        back.set_state(state)
        assert rewards(back, 30) == there and back.np_random_seed == (4, 9)


def test_a_state_that_does_not_fit_is_refused():
    env = single(PICKER)
    env.reset(seed=1)
    state = env.get_state()
    worlds = batch(PICKER, 1, perception="perfect").unwrapped
    refused = {
        "give what get_state": (env, 5),
        "perception = 'perfect', this environment has 'model'": (single(PICKER, perception="model"), state),
        "of another configuration": (single(PICKER, overrides={"slots": 5}), state),
        "use its own kind": (worlds, state),
        "1 worlds, this environment has 2": (batch(PICKER, 2, perception="perfect").unwrapped, state),
    }
    for message, (other, given) in refused.items():
        with pytest.raises(ValueError, match=message):
            other.set_state(given)
    name = "state.totals"
    for broken in (state.arrays[name][:, 1:], state.arrays[name].astype(np.float32)):
        changed = {**state.arrays, name: broken}
        with pytest.raises(ValueError, match=r"the state's state\.totals is"):
            env.set_state(replace(state, arrays=changed))
    with pytest.raises(ValueError, match=r"not those of these rules \(state\.totals\)"):
        env.set_state(replace(state, arrays={key: v for key, v in state.arrays.items() if key != name}))
    with pytest.raises(ValueError, match="read-only"):
        state.arrays[name][...] = 0.0


@pytest.mark.parametrize("seed", [np.int64(6), np.uint8(6), 6])
def test_numpy_s_integers_are_seeds(seed):
    env, worlds = single(PICKER), batch(PICKER, 2, perception="perfect")
    alone = env.reset(seed=seed)[0]["candidates"]
    assert env.np_random_seed == 6
    for seeds in (seed, [seed, np.int32(7)], np.array([6, 7])):
        together = worlds.reset(seed=seeds)[0]["candidates"]
        assert np.array_equal(together[0], alone) and worlds.unwrapped.np_random_seed == (6, 7)


@pytest.mark.parametrize("seed", [-1, 1.0, "5", True, np.float64(2.0)])
def test_what_is_no_seed_is_named(seed):
    for env in (single(PICKER), batch(PICKER, 2)):
        with pytest.raises(ValueError, match=r"^seed = .*: give a whole number from 0, or None$"):
            env.reset(seed=seed)
    with pytest.raises(ValueError, match=r"^seed = "):
        batch(PICKER, 2).reset(seed=[1, seed])
    with pytest.raises(ValueError, match="3 seeds for 2 worlds"):
        batch(PICKER, 2).reset(seed=[1, 2, 3])


@pytest.mark.parametrize("options", [5, "field", ["field"], {"feild": 1}])
def test_options_of_another_type_are_named(options):
    for env in (gym.make(PICKER, backend="analytic"), batch(PICKER, 2)):
        with pytest.raises(ValueError, match="option") as caught:
            env.reset(seed=1, options=options)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("env_id", [PICKER, LASER, SORTER])
@pytest.mark.parametrize("slots", [True, "4", 2.5, 0])
def test_slots_are_a_whole_number(env_id, slots):
    for make in (lambda: single(env_id, slots=slots), lambda: batch(env_id, 2, slots=slots)):
        with pytest.raises(ValueError, match="slots") as caught:
            make()
        assert "\n" not in str(caught.value)


def test_masks_are_found_behind_wrappers_as_the_readme_says():
    env: Any = gym.make(PICKER, backend="analytic")
    _, info = env.reset(seed=1)
    assert np.array_equal(env.unwrapped.action_masks(), info["action_mask"] > 0)
    assert np.array_equal(env.get_wrapper_attr("action_masks")(), info["action_mask"] > 0)


def test_a_batch_answers_as_gymnasium_s_does():
    env = batch(PICKER, 3, perception="perfect")
    made: Any = gym.vector.SyncVectorEnv([lambda: gym.make(PICKER, backend="analytic", perception="perfect")] * 3)
    env.reset(seed=2)
    made.reset(seed=2)
    for name in ("action_masks", "scenario", "backend", "perception", "np_random_seed", "action_space", "render_mode"):
        ours, theirs = env.unwrapped.call(name), made.call(name)
        assert isinstance(ours, tuple) and len(ours) == 3
        assert all(np.array_equal(a, b) for a, b in zip(ours, theirs, strict=True)), name
    assert [mask().shape for mask in env.unwrapped.get_attr("action_masks")] == [(int(env.single_action_space.n),)] * 3
    with pytest.raises(AttributeError, match="no attribute 'nothing': ask for action_masks, "):
        env.unwrapped.get_attr("nothing")
    for values, got in (([1, 2, 3], (1, 2, 3)), ("x", ("x",) * 3)):
        env.unwrapped.set_attr("difficulty", values)
        assert env.unwrapped.get_attr("difficulty") == env.unwrapped.call("difficulty") == got
    with pytest.raises(ValueError, match="2 values for 3 worlds"):
        env.unwrapped.set_attr("difficulty", [1, 2])
    with pytest.raises(AttributeError, match="'scenario' cannot be set"):
        env.unwrapped.set_attr("scenario", "pots")


def test_final_info_has_masks_of_the_worlds_that_ended_only():
    env, rng = batch(PICKER, 4, "SameStep", perception="perfect"), np.random.default_rng(0)
    _, info = env.reset(seed=1)
    seen = 0
    for _ in range(400):
        _, _, terminated, truncated, info = env.step(np.array([chosen(mask, rng) for mask in info["action_mask"]]))
        if "final_info" in info:
            over, masks = terminated | truncated, info["final_info"]["action_mask"]
            assert not masks[~over].any() and np.array_equal(info["final_info"]["_action_mask"], over)
            assert all(
                np.array_equal(masks[row], info["final_obs"][row]["action_mask"]) for row in np.flatnonzero(over)
            )
            seen += not over.all()
    assert seen
    _, info = env.reset(options={"reset_mask": np.array([True, False, False, False])})
    assert info["action_mask"][0].any() and not info["action_mask"][1:].any()
