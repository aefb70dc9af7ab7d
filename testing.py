"""The contract that every task keeps, as one check for anybody's task.

from fieldgym.testing import check_task

check_task("fieldgym/SafflowerPicking-v0")
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from math import isclose, isfinite
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

from .envs.core import COMMON_SCORES
from .envs.single import TaskEnv
from .envs.task import TaskSpec, task

if TYPE_CHECKING:
    from .agents.evaluation import Scores

MODES = {"NextStep": 1, "SameStep": 2}  # automatic resets that a batch is compared in, each with its threads
EXACT = 1e-9
"""Rounding that is allowed where numbers are added up in another order; everything else is compared bit for bit."""
_MOST_ENDS = 20_000


class ContractError(AssertionError):
    """A task breaks the contract; the message says where."""


def check_task(
    env_id: str,
    *,
    backends: Iterable[str] | None = None,
    worlds: int = 8,
    decisions: int = 300,
    settings: Mapping[str, Any] | None = None,
    on_check: Callable[[str], None] = lambda name: None,
) -> tuple[str, ...]:
    """Hold a task to the whole contract.

    Gymnasium's and, where it is installed, Stable-Baselines3's checkers with warnings as errors; masks in three
    conventions; arrays never shared; observations inside their space; illegal actions that cost time and are counted;
    a batch that equals its single worlds bit for bit; the same trajectories in another process; names for every column
    and scores; times and rewards that add up; fields that can be loaded again; policies that finish without an illegal
    action; no result above the bound where there is one.

    Args:
        env_id: a registered id, or ``module:id``.
        backends: those to check; by default all that the task has.
        worlds: of the batch that is compared with single environments.
        decisions: of that comparison.
        settings: keyword arguments of the environments that checkers and other processes make, as JSON has them.
        on_check: told the name of each check before it runs.

    Returns:
        The names of what was checked.

    Raises:
        ContractError: the first thing that does not hold.
    """
    spec = task(env_id)
    chosen = tuple(backends) if backends is not None else spec.backends
    checks: list[tuple[str, Callable[[], None]]] = [("the specification", lambda: _specification(spec))]
    for backend in chosen:
        given = spec, backend, dict(settings or {})
        checks += [
            (f"Gymnasium's checker, {backend}", partial(_gymnasium, *given)),
            (f"Stable-Baselines3's checker, {backend}", partial(_stable_baselines, *given)),
            (f"other processes, {backend}", partial(_processes, env_id, *given)),
        ]
    checks += [
        ("masks, arrays and spaces", lambda: _steps(spec)),
        ("names", lambda: _names(spec)),
        ("illegal actions", lambda: _illegal(spec)),
        ("sums", lambda: _sums(spec)),
        ("fields", lambda: _fields(spec)),
        ("policies and bound", lambda: _policies(spec)),
    ]
    for mode, threads in MODES.items():
        both = partial(check_batch, spec.id, spec.headline, mode, worlds, decisions, threads=min(threads, worlds))
        checks.append((f"batch = singles, {mode}", both))
    for name, check in checks:
        on_check(name)
        try:
            check()
        except ContractError as error:
            raise ContractError(f"{spec.id}, {name}: {error}") from None
    return tuple(name for name, _ in checks)


def _hold(condition: Any, what: str) -> None:
    if not condition:
        raise ContractError(what)


def _single(spec: TaskSpec, backend: str = "analytic", **kwargs: Any) -> Any:
    return gym.make(spec.id, backend=backend, disable_env_checker=True, **kwargs)


def _legal(mask: NDArray[Any], rng: np.random.Generator) -> int:
    """A random legal action."""
    return int(rng.choice(np.flatnonzero(mask)))


def _specification(spec: TaskSpec) -> None:
    _hold(spec.headline in spec.scenarios, f"the headline {spec.headline!r} is none of {spec.scenarios}")
    _hold(gym.spec(spec.id).to_json(), "its Gymnasium specification is no JSON")
    env = _single(spec)
    _hold(isinstance(env.unwrapped, TaskEnv), "its environment is no TaskEnv")
    _hold(env.unwrapped.scenario == spec.headline, "gym.make without a scenario is not the headline")
    env.close()


def _gymnasium(spec: TaskSpec, backend: str, settings: dict[str, Any]) -> None:
    env = _single(spec, backend, **settings)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
    env.close()
    env.close()


def _stable_baselines(spec: TaskSpec, backend: str, settings: dict[str, Any]) -> None:
    try:
        from stable_baselines3.common import env_checker
    except ImportError:
        return
    env = gym.make(spec.id, backend=backend, **settings)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env_checker.check_env(env, warn=True, skip_render_check=True)
        env_checker.check_env(env.unwrapped, warn=True, skip_render_check=True)
    env.close()


def trajectory_digest(env_id: str, backend: str, seeds: Iterable[int] = range(8), **settings: Any) -> str:
    """Digest of everything that short episodes give, random legal actions."""
    total = hashlib.sha256()
    env = _single(task(env_id), backend, **settings)
    for seed in seeds:
        (observation, info), rng = env.reset(seed=seed), np.random.default_rng(seed)
        total.update(_bytes(observation) + _bytes(info))
        for _ in range(6):
            *_, info = step = env.step(_legal(info["action_mask"], rng))
            total.update(b"".join(_bytes(part) for part in step))
            if step[2] or step[3]:
                break
    env.close()
    return total.hexdigest()


def _bytes(value: object) -> bytes:
    if isinstance(value, Mapping):
        return b"".join(str(name).encode() + _bytes(part) for name, part in value.items())
    return np.asarray(value).tobytes()


def _processes(env_id: str, spec: TaskSpec, backend: str, settings: dict[str, Any]) -> None:
    code = (
        "import json, sys; sys.path[:] = eval(sys.argv[1]); from fieldgym.testing import trajectory_digest; "
        "print(trajectory_digest(sys.argv[2], sys.argv[3], **json.loads(sys.argv[4])))"
    )
    if ":" not in env_id and isinstance(spec.entry_point, str):
        # A task that was registered by hand is unknown there until its module is imported.
        env_id = f"{spec.entry_point.partition(':')[0]}:{env_id}"
    command = [sys.executable, "-c", code, repr(sys.path), env_id, backend, json.dumps(settings)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    _hold(done.returncode == 0, f"a fresh process fails: {done.stderr.strip().splitlines()[-1:]}")
    here = trajectory_digest(env_id, backend, **settings)
    _hold(done.stdout.split()[-1] == here, "a fresh process plays other episodes")


def _steps(spec: TaskSpec) -> None:
    env = _single(spec)
    observation, info = env.reset(seed=1)
    rng = np.random.default_rng(1)
    for _ in range(60):
        masks = env.unwrapped.action_masks()
        _hold(masks.dtype == bool and masks.any(), "no action is legal")
        _hold(
            np.array_equal(observation["action_mask"], info["action_mask"]), "observation and info differ in the mask"
        )
        _hold(np.array_equal(masks, info["action_mask"].astype(bool)), "action_masks() and info differ in the mask")
        _hold(observation in env.observation_space, "an observation lies outside its space")
        kept = {name: values.copy() for name, values in observation.items()}
        following = env.step(_legal(masks, rng))
        for name, values in observation.items():
            _hold(np.array_equal(values, kept[name]), f"observation[{name!r}] changes after it was given")
            _hold(not np.shares_memory(values, following[0][name]), f"observation[{name!r}] is shared between steps")
        _hold(following[-1].keys() == info.keys(), "the keys of info change")
        _hold([type(part) for part in following[1:4]] == [float, bool, bool], "reward or ends have other types")
        observation, info = following[0], following[-1]
        if following[2] or following[3]:
            observation, info = env.reset()
    env.close()


def _names(spec: TaskSpec) -> None:
    env = _single(spec)
    observation, info = env.reset(seed=0)
    core = env.unwrapped.core
    _hold(tuple(info["scorecard"]) == tuple(core.score_names), "info['scorecard'] and score_names differ")
    _hold(core.score_names[: len(COMMON_SCORES)] == COMMON_SCORES, f"the scorecard does not begin with {COMMON_SCORES}")
    _hold(tuple(info["rewards"]) == tuple(core.reward_names), "info['rewards'] and reward_names differ")
    _hold(tuple(info["phases_s"]) == tuple(core.phase_names), "info['phases_s'] and phase_names differ")
    for phase in core.phase_names:
        _hold(f"phase_{phase}_s" in core.score_names, f"the scorecard has no phase_{phase}_s")
    for block in ("score_names", "reward_names", "phase_names", "machine_features", "candidate_features"):
        names = getattr(core, block)
        _hold(len(set(names)) == len(names), f"a name stands twice in {block}")
    _hold(
        observation["machine"].shape == (len(core.machine_features),), "machine and machine_features differ in length"
    )
    flat, columns = observation["candidates"].shape[-1], len(core.candidate_features)
    _hold(flat % columns == 0, f"{flat} candidate numbers are no table of {columns} candidate_features")
    env.close()


def _illegal(spec: TaskSpec) -> None:
    env = _single(spec)
    rng = np.random.default_rng(0)
    _, info = env.reset(seed=0)
    for _ in range(_MOST_ENDS):
        forbidden = np.flatnonzero(info["action_mask"] == 0)
        if len(forbidden):
            before = info["scorecard"]
            *_, after = env.step(int(forbidden[0]))
            after = after["scorecard"]
            _hold(after["illegal"] == before["illegal"] + 1, "an illegal action is not counted")
            _hold(after["duration_s"] > before["duration_s"], "an illegal action costs no time")
            _hold(after["done"] == before["done"], "an illegal action finishes a target")
            break
        _, _, terminated, truncated, info = env.step(_legal(info["action_mask"], rng))
        if terminated or truncated:
            break
    env.close()


def _sums(spec: TaskSpec) -> None:
    """Rewards and times add up; rates stay within what they can be."""
    env = _single(spec)
    rng = np.random.default_rng(5)
    _, info = env.reset(seed=5)
    for _ in range(_MOST_ENDS):
        before = info["scorecard"]
        _, reward, terminated, truncated, info = env.step(_legal(info["action_mask"], rng))
        card, phases = info["scorecard"], info["phases_s"]
        _hold(isclose(reward, sum(info["rewards"].values()), abs_tol=EXACT), "the reward is not the sum of its terms")
        elapsed = card["duration_s"] - before["duration_s"]
        _hold(isclose(elapsed, sum(phases.values()), abs_tol=1e-6), "the phases do not add up to the time that passed")
        for phase, seconds in phases.items():
            grown = card[f"phase_{phase}_s"] - before[f"phase_{phase}_s"]
            _hold(isclose(grown, seconds, abs_tol=1e-6), f"phase_{phase}_s of the scorecard does not add up")
            _hold(seconds >= 0.0, f"phase {phase} takes {seconds} s")
        _hold(all(isfinite(value) for value in card.values()), "a score is not finite")
        _hold(-EXACT <= card["net_rate"] <= 1.0 + EXACT, f"net_rate = {card['net_rate']} is no share")
        _hold(card["done"] >= before["done"], "finished targets become fewer")
        if terminated or truncated:
            break
    else:
        raise ContractError(f"no end after {_MOST_ENDS} random decisions")
    env.close()


def _fields(spec: TaskSpec) -> None:
    """A drawn field, loaded again, is the same episode; an unknown option is refused."""
    first, again = _single(spec), _single(spec)
    observation, info = first.reset(seed=9)
    field = first.unwrapped.field
    loaded, loaded_info = again.reset(seed=10, options={"field": field})
    rng = np.random.default_rng(9)
    for _ in range(40):
        _hold(_bytes(observation) == _bytes(loaded), "a field that is loaded gives other observations")
        _hold(_bytes(info) == _bytes(loaded_info), "a field that is loaded gives another info")
        action = _legal(info["action_mask"], rng)
        observation, _, terminated, truncated, info = first.step(action)
        loaded, _, _, _, loaded_info = again.step(action)
        if terminated or truncated:
            break
    _hold(again.unwrapped.field == field, "the field of a loaded episode is another")
    try:
        first.reset(options={"unheard-of": 1})
    except ValueError as error:
        _hold("unheard-of" in str(error), "the error about an unknown option does not name it")
    else:
        raise ContractError("reset takes an unknown option without a word")
    first.close()
    again.close()


def _policies(spec: TaskSpec) -> None:
    """What policies reach is not above the bound."""
    from .bounds import instance

    seeds = range(2)
    bounds = [instance(spec.id, seed).bound() for seed in seeds] if spec.bound is not None else ()
    for name, scores in check_policies(spec.id, spec.headline, seeds).items():
        for i, bound in enumerate(bounds):
            for value, limit in (
                (scores.scorecard["net_rate"][i], bound.net_rate),
                (scores.returns[i], bound.episode_return),
            ):
                _hold(value <= limit + EXACT, f"{name} beats the bound on seed {i}: {value} > {limit}")


def check_policies(env_id: str, scenario: str, seeds: Sequence[int] = range(2)) -> dict[str, Scores]:
    """Every policy that is for a scenario finishes its episodes and takes no illegal action.

    Args:
        env_id: a registered id.
        scenario: one of its scenarios.
        seeds: one an episode.

    Returns:
        What each policy reached, by its name.

    Raises:
        ContractError: a policy's action was illegal, or an episode did not end.
    """
    from .agents import make_policy, policy_names
    from .agents.evaluation import evaluate

    reached = {}
    for name in task(env_id).lineup(scenario, policy_names(env_id)):
        try:
            reached[name] = evaluate(lambda env, name=name: make_policy(name, env, 1), env_id, seeds, scenario=scenario)
        except RuntimeError as error:
            raise ContractError(f"policy {name}: {error}") from error
        illegal = reached[name].scorecard["illegal"]
        _hold((illegal == 0).all(), f"policy {name} takes {illegal.sum():g} illegal actions in {len(seeds)} episodes")
    return reached


def check_batch(
    env_id: str, scenario: str, mode: str, worlds: int = 8, decisions: int = 300, *, threads: int = 1, **kwargs: Any
) -> None:
    """On equal seeds and actions a batch gives what single environments give, through the ends of episodes.

    Args:
        env_id: a registered id.
        scenario: one of its scenarios.
        mode: of the automatic resets: ``"NextStep"`` or ``"SameStep"``.
        worlds: of the batch.
        decisions: steps.
        threads: of the batch.
        **kwargs: of the environments, both kinds (``perception``, ...).

    Raises:
        ContractError: something differs.
    """
    kwargs["scenario"] = scenario
    batch = gym.make_vec(env_id, worlds, "vector_entry_point", autoreset_mode=mode, threads=threads, **kwargs)
    singles = [_single(task(env_id), **kwargs) for _ in range(worlds)]
    together, info = batch.reset(seed=100)
    apart = [env.reset(seed=100 + i) for i, env in enumerate(singles)]
    over = np.zeros(worlds, bool)
    rng = np.random.default_rng(0)
    for number in range(decisions):
        for i, (observation, single_info) in enumerate(apart):
            where = f"world {i}, decision {number}"
            for name, values in observation.items():
                _hold(np.array_equal(values, together[name][i]), f"{where}: observation[{name!r}] differs")
            for part in ("rewards", "phases_s", "scorecard"):
                for name, value in single_info[part].items():
                    same = np.array_equal(value, info[part][name][i], equal_nan=True)
                    _hold(same, f"{where}: info[{part!r}][{name!r}] differs")
        actions = np.array([_legal(mask, rng) for mask in together["action_mask"]])
        together, reward, terminated, truncated, info = batch.step(actions)
        ended = np.zeros(worlds, bool)
        for i, env in enumerate(singles):
            if mode == "NextStep" and over[i]:
                apart[i] = env.reset()
                _hold(reward[i] == 0.0 and not terminated[i] and not truncated[i], "a world wakes up with a reward")
                continue
            observation, single_reward, end, cut, single_info = env.step(int(actions[i]))
            _hold((single_reward, end, cut) == (reward[i], terminated[i], truncated[i]), "reward or ends differ")
            ended[i] = end or cut
            if mode == "SameStep" and ended[i]:
                last = info["final_obs"][i]
                _hold(all(np.array_equal(v, last[k]) for k, v in observation.items()), "final_obs differs")
                apart[i] = env.reset()
            else:
                apart[i] = observation, single_info
        over = ended
    _hold(batch.metadata["autoreset_mode"].value == mode, "the metadata name another autoreset mode")
    batch.close()
    for env in singles:
        env.close()
