"""Configurations of any kind, for ``torture.py``: an environment that can be played, or an error of one line."""

from __future__ import annotations

import tempfile
from functools import cache
from math import isfinite, isinf
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from fieldgym.envs import task
from fieldgym.envs.assembly import KEYWORDS as ASSEMBLED
from fieldgym.kernels.config import to_mapping
from fieldgym.kernels.config_tables import Line, rows
from fieldgym.scripts.torture_actions import own_ids
from fieldgym.scripts.torture_parts import Tally, check_observation
from fieldgym.scripts.torture_values import ANYTHING, NUMBERS, any_of, called

STEPS = 4
WITH = " was raised from the environment creator"
KEYWORDS = ("scenario", "backend", "engine", "perception", "config", "overrides", "observation", "pixel_rows", "depth")
KEYWORDS += ("camera", "width", "height", "slots", "motion", "source_tray", "target_tray", "wheels", "preset")
ODD_TEXT = (b"", b"\n", b"\t", b":", b"- ", b"{", b"[" * 50, b"&a ", b"*a", b"!!int ", b"%", b"\xff", b"nan", b"#")
USUAL = (1, 3, 40, "model", "machine", "features", True)
BATCHED = ("autoreset_mode", "threads", "num_envs")
REFUSED = (ValueError, TypeError, gym.error.Error)


def case(rng: np.random.Generator, number: int, tally: Tally) -> None:
    """Make an environment of a fuzzed configuration, reset it, and decide a few times."""
    env_id = own_ids()[number % len(own_ids())]
    way = ("values", "values", "values", "mapping", "scenario", "file", "keywords", "presets")[
        number // len(own_ids()) % 8
    ]
    tally.counts["configs"] += 1
    with tempfile.TemporaryDirectory() as folder:
        asked = _WAYS[way](rng, env_id, Path(folder))
        batched = bool(rng.random() < 0.25)
        if batched and way == "keywords":
            asked[str(rng.choice(BATCHED))] = any_of(rng)
        what = f"{way} {env_id}{' batched' if batched else ''} {called(asked) if way != 'values' else _short(asked)}"
        _play(rng, env_id, asked, batched, tally, what)


def _short(asked: dict[str, Any]) -> str:
    return "; ".join(f"{name} = {called(value)}" for name, value in asked["overrides"].items())


def _play(rng: np.random.Generator, env_id: str, asked: dict[str, Any], batched: bool, tally: Tally, what: str) -> None:
    env: Any = None
    try:
        if batched:
            worlds = asked.pop("num_envs", 3)
            env = gym.make_vec(env_id, worlds, "vector_entry_point", **asked).unwrapped
        else:
            env = gym.make(env_id, disable_env_checker=True, **{"backend": "analytic", **asked}).unwrapped
        observation, _ = env.reset(seed=int(rng.integers(2**31)))
    except Exception as error:
        # To a TypeError Gymnasium adds all keywords as they are.
        told = TypeError(str(error).partition(WITH)[0]) if isinstance(error, TypeError) else error
        tally.refused(told, REFUSED, what)
        tally.counts["refused"] += 1
        if env is not None:
            tally.counts["refused at reset"] += 1
            env.close()
        return
    tally.counts["played"] += 1
    space = env.single_observation_space if batched else env.observation_space
    check_observation(space, observation, tally, what)
    for _ in range(STEPS):
        masks = observation["action_mask"].reshape(-1, observation["action_mask"].shape[-1]) > 0
        if not masks.any(axis=1).all():
            tally.fault(f"{what}: no action is possible")
            break
        chosen = np.array([int(rng.choice(np.flatnonzero(mask))) for mask in masks])
        try:
            observation, reward, terminated, truncated, info = env.step(chosen if batched else int(chosen[0]))
        except Exception as error:
            tally.fault(f"{what}: step raised {type(error).__name__}: {error}")
            break
        check_observation(space, observation, tally, what)
        tally.hold(np.isfinite(reward).all(), f"{what}: reward {reward!r}")
        card = {name: values for name, values in info["scorecard"].items() if not name.startswith("_")}
        odd = [name for name, values in card.items() if not np.isfinite(values).all()]
        tally.hold(not odd, f"{what}: scores are not finite: {odd}")
        if not batched and (terminated or truncated):
            observation, _ = env.reset()
            check_observation(space, observation, tally, what)
    env.close()


# What is asked for


@cache
def _lines(env_id: str) -> tuple[Line, ...]:
    return tuple(rows(task(env_id).assembly.configured()))


def _number(rng: np.random.Generator, line: Line) -> Any:
    """A number of a declared range, at an end of it, beyond it, or the default."""
    low = -1e3 if line.low is None else line.low
    high = 1e3 if line.high is None else line.high
    dice = rng.random()
    if dice < 0.45:
        whole = isinstance(line.default, int) and not isinstance(line.default, bool)
        if low > 0.0 and isfinite(high) and high / low > 100.0:
            value = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        else:
            value = float(rng.uniform(low, min(high, 1e12)))
        return int(value) if whole else value
    if dice < 0.65:
        return low if rng.random() < 0.5 else high
    if dice < 0.85 and isinstance(line.default, (int, float)) and not isinf(line.default):
        return type(line.default)(line.default * any_of(rng, (0.5, 0.9, 1.1, 2.0, 10.0, 0.0, -1.0)))
    if dice < 0.9:
        return float(np.nextafter(high, np.inf)) if rng.random() < 0.5 else float(np.nextafter(low, -np.inf))
    return line.default


def _value(rng: np.random.Generator, line: Line) -> Any:
    if rng.random() < 0.05:
        return any_of(rng)
    if isinstance(line.default, bool):
        return bool(rng.random() < 0.5)
    if isinstance(line.default, str) and " | " in line.type:
        return str(rng.choice([word.strip("' ") for word in line.type.split("|")]))
    if isinstance(line.default, list):
        if rng.random() < 0.2:
            return any_of(rng)
        return [_number(rng, line._replace(default=part)) for part in line.default]
    return _number(rng, line)


def _values(rng: np.random.Generator, env_id: str, folder: Path) -> dict[str, Any]:
    lines = _lines(env_id)
    chosen = rng.choice(len(lines), int(rng.integers(1, 4)), replace=False)
    spec = task(env_id)
    asked: dict[str, Any] = {"overrides": {lines[i].name: _value(rng, lines[i]) for i in chosen}}
    if rng.random() < 0.5:
        asked["scenario"] = str(rng.choice(spec.scenarios))
    asked["perception"] = str(rng.choice(["perfect", "model"]))
    if rng.random() < 0.005:
        asked["perception"] = "camera"
    return asked


def _mutated(rng: np.random.Generator, value: Any) -> Any:
    """A value in which a part, at any depth, is gone or another."""
    if isinstance(value, dict) and value and rng.random() < 0.95:
        name = any_of(rng, tuple(value))
        dice = rng.random()
        if dice < 0.08:
            return {key: part for key, part in value.items() if key != name}
        if dice < 0.12:
            return {**value, any_of(rng, (name + "x", "", 3, "a.b", "\n", name.upper())): value[name]}
        return {**value, name: _mutated(rng, value[name])}
    if isinstance(value, list) and value and rng.random() < 0.8:
        place = int(rng.integers(len(value)))
        dice = rng.random()
        if dice < 0.15:
            return value[:place] + value[place + 1 :]
        if dice < 0.3:
            return [*value, value[place]]
        return [*value[:place], _mutated(rng, value[place]), *value[place + 1 :]]
    if isinstance(value, (int, float)) and not isinstance(value, bool) and rng.random() < 0.6:
        return value * any_of(rng, (0.5, 0.9, 1.1, 2, 10, 0, -1, 1000))
    return any_of(rng)


def _mapping(rng: np.random.Generator, env_id: str, folder: Path) -> dict[str, Any]:
    config = to_mapping(task(env_id).assembly.configured())
    for _ in range(int(rng.integers(1, 4))):
        config = _mutated(rng, config)
    return {"config": config}


def _scenario(rng: np.random.Generator, env_id: str, folder: Path) -> dict[str, Any]:
    numbers = _scenario_of(rng, env_id)
    for _ in range(int(rng.integers(1, 4))):
        numbers = _mutated(rng, numbers)
    return {"overrides": {"scenario": numbers}}


def _scenario_of(rng: np.random.Generator, env_id: str) -> Any:
    spec = task(env_id)
    return to_mapping(spec.assembly.scenario(str(rng.choice(spec.scenarios))))


def _file(rng: np.random.Generator, env_id: str, folder: Path) -> dict[str, Any]:
    """A scenario's file, its text damaged."""
    import yaml

    numbers = _scenario_of(rng, env_id)
    if rng.random() < 0.4:
        few = rng.choice(list(numbers), min(3, len(numbers)), replace=False)
        numbers = {str(name): numbers[str(name)] for name in few}
        numbers["base"] = any_of(rng, (*task(env_id).scenarios, "nothing", str(folder / "s.yaml"), 3, [], {}))
    if rng.random() < 0.6:
        numbers = _mutated(rng, numbers)
    try:
        text = yaml.safe_dump(numbers, sort_keys=False)
    except Exception:  # what YAML cannot say
        text = called(numbers)
    data = text.encode("utf-8", "replace")
    for _ in range(int(rng.integers(0, 3))):
        at = int(rng.integers(len(data) + 1))
        odd = any_of(rng, ODD_TEXT)
        data = data[:at] + odd + data[at + int(rng.integers(4)) :]
    (folder / "s.yaml").write_bytes(data)
    return {"scenario": folder / "s.yaml" if rng.random() < 0.5 else str(folder / "s.yaml")}


def _keywords(rng: np.random.Generator, env_id: str, folder: Path) -> dict[str, Any]:
    names = [str(name) for name in rng.choice(KEYWORDS, int(rng.integers(1, 3)), replace=False)]
    known = (*ASSEMBLED, *task(env_id).assembly.settings)
    # Beside a keyword that a task does not know Gymnasium repeats all as they are, and fails where one cannot be shown.
    values = (*ANYTHING, *USUAL) if set(names) <= set(known) else (*NUMBERS, *USUAL)
    return {name: any_of(rng, values) for name in names}


def _presets(rng: np.random.Generator, env_id: str, folder: Path) -> dict[str, Any]:
    presets = tuple(task(env_id).assembly.presets)
    asked = any_of(rng, (*presets, list(presets), list(presets)[:2], "nothing", 3, None, [3], [[]], {}, "", *ANYTHING))
    return {"overrides": {"preset": asked}}


_WAYS = {
    "values": _values,
    "mapping": _mapping,
    "scenario": _scenario,
    "file": _file,
    "keywords": _keywords,
    "presets": _presets,
}
