"""The whole state of a training run in one file of plain tensors, so that a run that was killed goes on as it was.

Weights and optimiser, every array of the environment's rules, every world's generator and the learner's own: after a
restore the run takes the same decisions that it would have taken. The file is read with ``weights_only``: no code in
it can run. Every shape, kind of number and index in it is compared with what the settings make before a kernel works
with it.
"""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ...envs.state import held
from ...kernels.files import read_file, replaced, unpacked_bytes
from .runs import CheckpointError, told_as_damage
from .sb3 import NativeVecEnv

FORMAT = 2
MOST_BYTES = 2**31
"""Largest file that is read, packed or not."""
_MT_WORDS = 624


def write(path: Path, model: Any, env: NativeVecEnv, run: dict[str, Any]) -> None:
    """Write the state between two updates, to a temporary name first.

    Args:
        path: the file.
        model: SB3's learner.
        env: its environment.
        run: JSON values of the run itself: settings, curve, best score, clocks.
    """
    # SB3 shuffles its minibatches with NumPy's global generator.
    kind, keys, position, has_gauss, gauss = np.random.get_state()  # noqa: NPY002
    state = {
        "format": FORMAT,
        "policy": model.policy.state_dict(),
        "optimizer": model.policy.optimizer.state_dict(),
        "torch_generator": torch.get_rng_state(),
        "numpy_keys": torch.from_numpy(np.asarray(keys).astype(np.int64)),
        **{part: {name: _tensor(array) for name, array in arrays.items()} for part, arrays in _arrays(env).items()},
        "last_obs": {name: _tensor(values) for name, values in model._last_obs.items()},
        "last_starts": _tensor(model._last_episode_starts),
        "text": json.dumps(
            {
                "numpy": [kind, position, has_gauss, gauss],
                "generators": [_generator_state(g) for g in env.native.np_random],
                "num_timesteps": model.num_timesteps,
                "n_updates": model._n_updates,
                "episodes": list(model.ep_info_buffer or ()),
                "run": run,
            }
        ),
    }
    with replaced(path) as temporary:
        torch.save(state, temporary)


def read(path: Path) -> dict[str, Any]:
    """Read a checkpoint; its run's own values are under ``"text"`` as parsed JSON.

    Raises:
        CheckpointError: it is missing, damaged or of another version.
    """
    try:
        data = io.BytesIO(read_file(path, MOST_BYTES))
        unpacked = unpacked_bytes(data)
        if unpacked > MOST_BYTES:
            raise ValueError(f"it unpacks to {unpacked} bytes, at most {MOST_BYTES} are read")
        state = torch.load(data, weights_only=True, map_location="cpu")
        state["text"] = json.loads(state["text"])
        version = state["format"]
    except FileNotFoundError:
        raise CheckpointError(f"there is no checkpoint {path}: start without --resume") from None
    except Exception as error:  # torch.load raises many kinds for damaged files
        reason = str(error).split("\n", 1)[0]
        raise CheckpointError(f"{path} is damaged ({reason}): start without --resume") from None
    if version != FORMAT:
        raise CheckpointError(f"{path} has format {version}, this version reads {FORMAT}: start without --resume")
    return state


@told_as_damage("the checkpoint")
def restore(state: dict[str, Any], model: Any, env: NativeVecEnv) -> None:
    """Put a learner and its environment, made with the same settings, where the checkpoint was written.

    Raises:
        CheckpointError: the environment or the network is not the one that the checkpoint was written with, or a
            part of it is damaged.
    """
    text = state["text"]
    _check_counts(text)
    # Of the learner: it has the channels of pictures first.
    _check_seen(state, model.observation_space, env.num_envs)
    env.reset()
    for part, arrays in _arrays(env).items():
        _put(arrays, state[part], part)
    # Who draws the worlds notices another episode by its number.
    episode = getattr(env.native.core, "episode", None)
    if isinstance(episode, np.ndarray):
        episode += 1
    wrong = env.native.core.misplaced()
    if wrong:
        raise CheckpointError(f"the checkpoint's {wrong} points outside its array: start without --resume")
    for generator, saved in zip(env.native.np_random, text["generators"], strict=True):
        if generator is not None:
            generator.bit_generator.state = saved
    try:
        model.policy.load_state_dict(state["policy"])
        model.policy.optimizer.load_state_dict(state["optimizer"])
    except (RuntimeError, ValueError) as error:
        reason = str(error).split("\n", 1)[0]
        raise CheckpointError(f"the checkpoint holds another network ({reason}): start without --resume") from None
    _check_optimizer(model.policy.optimizer)
    model._last_obs = {name: values.numpy() for name, values in state["last_obs"].items()}
    model._last_episode_starts = state["last_starts"].numpy()
    model.num_timesteps, model._n_updates = text["num_timesteps"], text["n_updates"]
    model._restored_episodes = text["episodes"]
    torch.set_rng_state(state["torch_generator"])
    kind, position, has_gauss, gauss = text["numpy"]
    keys = state["numpy_keys"].numpy().astype(np.uint32)
    # NumPy would read beyond its words.
    if kind != "MT19937" or keys.shape != (_MT_WORDS,) or type(position) is not int or not 0 <= position <= _MT_WORDS:
        raise CheckpointError("the checkpoint's generator is none: start without --resume")
    np.random.set_state((kind, keys, position, has_gauss, gauss))  # noqa: NPY002


def _arrays(env: NativeVecEnv) -> dict[str, dict[str, np.ndarray]]:
    """What the environment stands at: numbers by name, of its rules, of its face and of what SB3 sees."""
    whole: dict[str, dict[str, Any]] = {"core": held(env.native.core), "face": vars(env.native), "env": vars(env)}
    return {
        part: {name: v for name, v in values.items() if isinstance(v, np.ndarray) and v.dtype != object}
        for part, values in whole.items()
    }


def _tensor(values: Any) -> torch.Tensor:
    return torch.from_numpy(np.array(values))


def _put(now: dict[str, np.ndarray], saved: dict[str, torch.Tensor], what: str) -> None:
    if set(now) != set(saved):
        odd = sorted(set(now) ^ set(saved))
        raise CheckpointError(f"the checkpoint's {what} does not fit ({', '.join(odd[:3])}): start without --resume")
    for name, values in saved.items():
        array = now[name]
        if array.shape != tuple(values.shape) or array.dtype != values.numpy().dtype:
            raise CheckpointError(f"the checkpoint's {what}.{name} does not fit: start without --resume")
        if array.flags.writeable:
            # In place: one array may be a view of another.
            array[...] = values.numpy()


def _check_counts(text: dict[str, Any]) -> None:
    """Raise unless steps and updates are counts and the log's episodes are what SB3 wrote."""
    counts = text["num_timesteps"], text["n_updates"]
    episodes = text["episodes"]
    numbers = [item[name] for item in episodes for name in ("r", "l", "t")]
    if any(type(count) is not int or count < 0 for count in counts):
        raise CheckpointError("the checkpoint's steps or updates are no counts: start without --resume")
    if not all(isinstance(number, (int, float)) for number in numbers):
        raise CheckpointError("the checkpoint's episodes are no numbers: start without --resume")


def _check_seen(state: dict[str, Any], space: Any, worlds: int) -> None:
    """Raise unless the last observation is one of the learner's space, of all worlds."""
    seen = state["last_obs"]
    fits = set(seen) == set(space.spaces) and all(
        tuple(values.shape) == (worlds, *space[name].shape) and values.numpy().dtype == space[name].dtype
        for name, values in seen.items()
    )
    starts = state["last_starts"]
    if not fits or tuple(starts.shape) != (worlds,) or starts.dtype not in (torch.bool, torch.float32):
        raise CheckpointError("the checkpoint's last observation does not fit: start without --resume")


def _check_optimizer(optimizer: torch.optim.Optimizer) -> None:
    """Raise unless what the optimiser remembers of each weight has the weight's shape."""
    for weight, memory in optimizer.state.items():
        for name, values in memory.items():
            if not isinstance(values, torch.Tensor) or (name != "step" and values.shape != weight.shape):
                raise CheckpointError(f"the checkpoint's optimiser does not fit ({name}): start without --resume")


def _generator_state(generator: np.random.Generator | None) -> Any:
    return None if generator is None else generator.bit_generator.state
