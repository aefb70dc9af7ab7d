"""Actions of any kind, in any order of calls, for ``torture.py``: what comes back fits, or an error has one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import isclose, isfinite
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from numpy.typing import NDArray

from fieldgym.envs import env_ids, task
from fieldgym.scripts.torture_parts import SLACK, Tally, check_observation
from fieldgym.scripts.torture_values import ANYTHING, ARRAYS, NUMBERS, any_of, called

SINGLE_STEPS = {"analytic": 700, "pybullet": 40, "camera": 25}
BATCH_STEPS = {"features": 150, "camera": 8}
MOST_WORLDS = {"features": 200, "camera": 4}
MODES = ("NextStep", "SameStep", "Disabled")
SHOWN = ("features", "features", "features", "features", "pixels", "both")
REFUSED = (ValueError, ResetNeeded, ClosedEnvironmentError)


def own_ids() -> tuple[str, ...]:
    """The package's own environments."""
    return tuple(env_id for env_id in env_ids() if env_id.startswith("fieldgym/"))


def case(rng: np.random.Generator, number: int, tally: Tally) -> None:
    """One environment, single or batched, from before its first reset until after its end."""
    env_id = own_ids()[number % len(own_ids())]
    kind = number // len(own_ids()) % 8
    if kind == 0:
        _single(rng, env_id, "pybullet", tally)
    elif kind < 4:
        _single(rng, env_id, "analytic", tally)
    else:
        _batch(rng, env_id, str(any_of(rng, MODES)), tally)


@contextmanager
def _expected(tally: Tally, error: type[BaseException], what: str) -> Iterator[None]:
    """Take down unless the block raises this error, in one line."""
    try:
        yield
    except Exception as raised:
        tally.refused(raised, (error,), what)
        tally.counts["refused"] += 1
    else:
        tally.fault(f"{what}: no {error.__name__}")


def _seen(rng: np.random.Generator, env_id: str, backend: str) -> tuple[dict[str, Any], str]:
    """Keywords of an environment, and how slow it is."""
    spec = task(env_id)
    shown = str(any_of(rng, SHOWN))
    perceptions = [name for name in spec.perceptions if name != "camera"] * 3 + ["camera"]
    perception = str(rng.choice(perceptions))
    asked = {"perception": perception, "scenario": str(rng.choice(spec.scenarios)), "observation": shown}
    if shown != "features":
        asked |= {"pixel_rows": int(rng.integers(16, 40)), "depth": bool(rng.random() < 0.5)}
    return asked, "camera" if "camera" in (perception,) or shown != "features" else backend


# Single environments


def _single(rng: np.random.Generator, env_id: str, backend: str, tally: Tally) -> None:
    asked, pace = _seen(rng, env_id, backend)
    what = f"{env_id} {backend} {asked}"
    env: Any = gym.make(env_id, backend=backend, disable_env_checker=True, **asked).unwrapped
    actions = int(env.action_space.n)
    for early in (env.action_masks, env.get_state, lambda: env.step(any_of(rng))):
        with _expected(tally, ResetNeeded, f"{what}: before reset"):
            early()
    tally.counts["actions"] += 1
    episode = Episode(env, tally, what)
    episode.begin(int(rng.integers(2**31)))
    for _ in range(SINGLE_STEPS[pace]):
        tally.counts["actions"] += 1
        if episode.over:
            with _expected(tally, ResetNeeded, f"{what}: after the end"):
                env.step(any_of(rng) if rng.random() < 0.3 else int(rng.integers(actions)))
            if rng.random() < 0.5:
                episode.begin(None)
            continue
        dice = rng.random()
        if dice < 0.06:
            _odd_action(rng, env, actions, episode, tally, what)
            continue
        legal = dice < 0.85
        masks = episode.masks
        among = np.flatnonzero(masks) if legal else np.flatnonzero(~masks) if dice < 0.93 else np.arange(actions)
        episode.step(int(rng.choice(among)) if len(among) else int(rng.integers(actions)))
        if rng.random() < 0.003:
            episode.begin(int(rng.integers(2**31)) if rng.random() < 0.5 else None)
    tally.counts[pace if pace != "analytic" else "single"] += SINGLE_STEPS[pace]
    env.close()
    for late in (env.reset, env.get_state, lambda: env.step(any_of(rng))):
        with _expected(tally, ClosedEnvironmentError, f"{what}: after close"):
            late()
    tally.counts["actions"] += 1


def _odd_action(rng: np.random.Generator, env: Any, actions: int, episode: Episode, tally: Tally, what: str) -> None:
    """An action that is none: refused in one line and nothing happens; or it is a number after all."""
    odd = any_of(rng, (*ANYTHING, -1, actions, actions + 1, np.int32(actions), np.array([actions])))
    before = env.core.scores().tobytes()
    try:
        result = env.step(odd)
    except Exception as error:
        tally.refused(error, (ValueError,), f"{what}: action {called(odd)}")
        tally.counts["refused"] += 1
        tally.hold(env.core.scores().tobytes() == before, f"{what}: {called(odd)} was refused and changed scores")
        return
    number = np.asarray(odd)
    fits = number.size == 1 and number.dtype.kind in "iu" and 0 <= int(number.reshape(())) < actions
    tally.hold(fits, f"{what}: action {called(odd)} was taken")
    episode.take(int(number.reshape(())) if fits else 0, result)


class Episode:
    """A single environment's episode, and what must hold of it.

    Attributes:
        over: whether it has ended.
        masks: which actions are possible.
    """

    def __init__(self, env: Any, tally: Tally, what: str):
        """Nothing has begun."""
        self._env, self._tally, self._what = env, tally, what
        self.over, self.masks = False, np.zeros(0, bool)
        self._card: dict[str, float] = {}

    def begin(self, seed: int | None) -> None:
        """Reset."""
        observation, info = self._env.reset(seed=seed)
        self.over = False
        self._show(observation, info)
        self._tally.counts["episodes"] += 1

    def step(self, action: int) -> None:
        """A decision."""
        self.take(action, self._env.step(action))

    def take(self, action: int, result: tuple[Any, ...]) -> None:
        """What a decision gave."""
        observation, reward, terminated, truncated, info = result
        tally, what, before = self._tally, self._what, self._card
        illegal = not self.masks[action]
        self._show(observation, info)
        card, phases = self._card, info["phases_s"]
        tally.hold(type(reward) is float and isfinite(reward), f"{what}: reward {reward!r}")
        tally.hold(isclose(reward, sum(info["rewards"].values()), abs_tol=SLACK), f"{what}: reward is not its terms")
        tally.hold(type(terminated) is bool and type(truncated) is bool, f"{what}: ends {terminated!r}, {truncated!r}")
        elapsed = card["duration_s"] - before["duration_s"]
        tally.hold(isclose(elapsed, sum(phases.values()), abs_tol=SLACK), f"{what}: phases are not {elapsed} s")
        tally.hold(all(seconds >= 0.0 for seconds in phases.values()), f"{what}: phases {phases}")
        tally.hold(card["illegal"] - before["illegal"] == illegal, f"{what}: illegal counted wrongly")
        tally.hold(not illegal or elapsed > 0.0, f"{what}: an illegal action took {elapsed} s")
        for name, seconds in phases.items():
            grown = card[f"phase_{name}_s"] - before[f"phase_{name}_s"]
            tally.hold(isclose(grown, seconds, abs_tol=SLACK), f"{what}: phase_{name}_s grew by {grown} s")
        tally.hold(card["done"] >= before["done"], f"{what}: done fell")
        self.over = terminated or truncated

    def _show(self, observation: Any, info: Any) -> None:
        tally, what = self._tally, self._what
        check_observation(self._env.observation_space, observation, tally, what)
        self.masks = observation["action_mask"] > 0
        tally.hold(self.masks.any(), f"{what}: no action is possible")
        tally.hold(np.array_equal(self.masks, self._env.action_masks()), f"{what}: masks differ")
        card = self._card = info["scorecard"]
        tally.hold(all(map(isfinite, card.values())), f"{what}: scorecard {card}")
        tally.hold(-SLACK <= card["net_rate"] <= 1.0 + SLACK, f"{what}: net rate {card['net_rate']}")


# Batches


def _batch(rng: np.random.Generator, env_id: str, mode: str, tally: Tally) -> None:
    asked, pace = _seen(rng, env_id, "features")
    worlds = int(rng.integers(1, MOST_WORLDS[pace] + 1))
    threads = int(rng.integers(1, min(worlds, 4) + 1)) if pace == "features" and rng.random() < 0.3 else 1
    what = f"{env_id} x {worlds} {mode}, {threads} threads {asked}"
    env: Any = gym.make_vec(
        env_id, worlds, "vector_entry_point", autoreset_mode=mode, threads=threads, **asked
    ).unwrapped
    for early in (env.action_masks, env.get_state, lambda: env.step(np.zeros(worlds, int))):
        with _expected(tally, ResetNeeded, f"{what}: before reset"):
            early()
    batch = Batch(env, mode, tally, what)
    batch.begin(int(rng.integers(2**31)), None)
    actions = int(env.single_action_space.n)
    for _ in range(BATCH_STEPS[pace]):
        if rng.random() < 0.05:
            _odd_actions(rng, env, worlds, actions, batch, tally, what)
            continue
        # Whoever mostly goes on, the last action, comes to the end; whoever works never does in a few steps.
        chosen = np.where(batch.masks, rng.random(batch.masks.shape), -1.0).argmax(axis=1)
        chosen[rng.random(worlds) < 0.3] = actions - 1
        anything = rng.random(worlds) < 0.1
        chosen[anything] = rng.integers(0, actions, int(anything.sum()))
        batch.step(chosen.astype(any_of(rng, (np.int64, np.int32, np.uint16))))
        tally.counts["actions"] += worlds
        if mode == "Disabled" and batch.over.any() and rng.random() < 0.3:
            batch.begin(None, batch.over | (rng.random(worlds) < 0.1))
        elif rng.random() < 0.01:
            batch.begin(None, rng.random(worlds) < 0.5)
    tally.counts["batched" if pace == "features" else pace] += worlds * BATCH_STEPS[pace]
    env.close()
    for late in (env.reset, env.get_state, lambda: env.step(np.zeros(worlds, int))):
        with _expected(tally, ClosedEnvironmentError, f"{what}: after close"):
            late()


def _odd_actions(
    rng: np.random.Generator, env: Any, worlds: int, actions: int, batch: Batch, tally: Tally, what: str
) -> None:
    """Actions that are none are refused in one line, and no world moves."""
    odd: Any = any_of(rng, (*NUMBERS, *ARRAYS, *ANYTHING))
    if rng.random() < 0.5:
        odd = np.zeros(worlds, any_of(rng, (np.int64, np.int32, np.float64, bool, object, complex)))
        odd[int(rng.integers(worlds))] = any_of(rng, (-1, actions, actions + 5, 1, 0))
    before = env.core.scores().tobytes()
    tally.counts["actions"] += worlds
    try:
        result = env.step(odd)
    except Exception as error:
        tally.refused(error, (ValueError,), f"{what}: actions {called(odd)}")
        tally.counts["refused"] += worlds
        tally.hold(env.core.scores().tobytes() == before, f"{what}: {called(odd)} was refused and changed scores")
        return
    numbers = np.asarray(odd)
    fits = numbers.shape == (worlds,) and numbers.dtype.kind in "iu" and ((numbers >= 0) & (numbers < actions)).all()
    tally.hold(fits, f"{what}: actions {called(odd)} were taken")
    batch.take(numbers.astype(int) if fits else np.zeros(worlds, int), result)


class Batch:
    """A batch of worlds, and what must hold of each.

    Attributes:
        over: which worlds have ended and did not begin anew yet.
        masks: which actions are possible.
    """

    def __init__(self, env: Any, mode: str, tally: Tally, what: str):
        """Nothing has begun."""
        self._env, self._mode, self._tally, self._what = env, mode, tally, what
        self.over = np.zeros(env.num_envs, bool)
        self.masks = np.zeros((env.num_envs, int(env.single_action_space.n)), bool)
        self._card: dict[str, NDArray[Any]] = {}

    def begin(self, seed: int | None, rows: NDArray[np.bool_] | None) -> None:
        """Reset all worlds, or some."""
        if rows is not None and not rows.any():
            return
        observation, info = self._env.reset(seed=seed, options=None if rows is None else {"reset_mask": rows})
        fresh = np.ones_like(self.over) if rows is None else rows
        self.over = self.over & ~fresh
        before = self._card
        self._show(observation)
        told = info["scorecard"]
        self._card = {name: np.where(fresh, told[name], before.get(name, 0.0)) for name in self._names(told)}
        self._check_card(self._card)
        self._tally.counts["episodes"] += int(fresh.sum())

    def step(self, actions: NDArray[Any]) -> None:
        """A decision in every world."""
        self.take(actions, self._env.step(actions))

    def take(self, actions: NDArray[Any], result: tuple[Any, ...]) -> None:
        """What a decision gave."""
        observation, reward, terminated, truncated, info = result
        tally, what, before = self._tally, self._what, self._card
        asleep, illegal = self.over, ~self.masks[np.arange(len(actions)), actions]
        self._show(observation)
        ended = terminated | truncated
        tally.hold(reward.dtype == np.float64 and np.isfinite(reward).all(), f"{what}: rewards {reward}")
        same = self._mode == "SameStep"
        parts = ("rewards", "phases_s", "scorecard")
        rewards, phases, card = ({n: info[part][n].copy() for n in self._names(info[part])} for part in parts)
        self._card = {name: values.copy() for name, values in card.items()}
        self._check_card(card)
        if same and ended.any():
            last = info["final_info"]
            for kept, part in ((rewards, "rewards"), (phases, "phases_s"), (card, "scorecard")):
                for name, values in kept.items():
                    values[ended] = last[part][name][ended]
            for row in np.flatnonzero(ended):
                check_observation(self._env.single_observation_space, info["final_obs"][row], tally, f"{what}: last")
        awake = ~asleep
        total = np.sum(list(rewards.values()), axis=0)
        tally.hold(np.allclose(reward, total, atol=SLACK), f"{what}: rewards are not their terms")
        seconds = np.sum(list(phases.values()), axis=0)
        elapsed = card["duration_s"] - before["duration_s"]
        tally.hold(np.allclose(elapsed[awake], seconds[awake], atol=SLACK), f"{what}: phases are not the time")
        tally.hold(all((values >= 0.0).all() for values in phases.values()), f"{what}: a phase is negative")
        counted = card["illegal"] - before["illegal"]
        tally.hold(np.array_equal(counted[awake], illegal[awake]), f"{what}: illegal counted wrongly")
        tally.hold((card["done"] >= before["done"])[awake].all(), f"{what}: done fell")
        tally.hold(not reward[asleep].any(), f"{what}: a world that is over earned {reward[asleep]}")
        if self._mode == "Disabled":
            tally.hold(ended[asleep].all(), f"{what}: a world that is over went on")
        elif not same:
            tally.hold(not ended[asleep].any(), f"{what}: a world began anew and was over")
        self.over = np.zeros_like(ended) if same else ended
        tally.counts["episodes"] += int(ended.sum()) if self._mode != "Disabled" else 0

    def _show(self, observation: Any) -> None:
        tally, what = self._tally, self._what
        check_observation(self._env.single_observation_space, observation, tally, what)
        self.masks = observation["action_mask"] > 0
        tally.hold(self.masks.any(axis=1).all(), f"{what}: no action is possible")
        tally.hold(np.array_equal(self.masks, self._env.action_masks()), f"{what}: masks differ")

    def _check_card(self, card: dict[str, NDArray[Any]]) -> None:
        finite = all(np.isfinite(values).all() for values in card.values())
        self._tally.hold(finite, f"{self._what}: a score is not finite")
        rate = card["net_rate"]
        fits = ((rate >= -SLACK) & (rate <= 1.0 + SLACK)).all()
        self._tally.hold(fits, f"{self._what}: net rate {rate}")

    @staticmethod
    def _names(part: dict[str, Any]) -> list[str]:
        return [name for name in part if not name.startswith("_")]
