"""Learned policies as files that are safe to open: weights in ``.npz`` without pickle, a card in JSON beside them.

A policy runs with NumPy alone, whatever it was trained with. A stranger's file can at worst decide badly: its size,
its names, its shapes and its numbers are checked before anything is computed with it.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .layout import Layout, layout_of
from .policy import Actions, Observation, StatelessPolicy

Weights = Mapping[str, NDArray[np.float32]]

FORMAT = "fieldgym-set-policy-1"
MOST_BYTES = 2_000_000
"""Largest file, packed or unpacked: a policy is small, what is larger is something else."""
MOST_CARD_BYTES = 500_000
MOST_HIDDEN = 512
LEARNED = "learned"
"""Name under which a shipped policy is found."""


class PolicyFileError(ValueError):
    """A policy file cannot be used; the message says why and what to do."""


def shapes(layout: Layout, hidden: int, relations: int = 0) -> dict[str, tuple[int, ...]]:
    """Names and shapes of an actor's weights, as ``set_policy.SetActor`` names them."""
    h, r = hidden, relations
    heard = {"from_one.weight": (r, h), "from_one.bias": (r,), "to_other.weight": (r, h)} if r else {}
    return heard | {
        "encoder.candidate.weight": (h, layout.features),
        "encoder.candidate.bias": (h,),
        "encoder.machine.weight": (h, layout.machine),
        "encoder.second.weight": (h, h),
        "encoder.second.bias": (h,),
        "encoder.context.weight": (h, 2 * h + layout.machine + 1),
        "encoder.context.bias": (h,),
        "own.weight": (h, h + 2 * r),
        "own.bias": (h,),
        "shared.weight": (h, h),
        "options.weight": (layout.blocks * layout.options, h),
        "options.bias": (layout.blocks * layout.options,),
        "extras.weight": (layout.blocks * layout.extras, h),
        "extras.bias": (layout.blocks * layout.extras,),
    }


class LearnedPolicy(StatelessPolicy):
    """A trained set policy in NumPy: the most probable possible action.

    Attributes:
        name: of the policy in tables.
        layout: of the task that it decides.
        card: what is known of it: task, settings, seeds, scores, weaknesses.
    """

    def __init__(
        self,
        layout: Layout,
        hidden: int,
        weights: Weights,
        card: Mapping[str, Any],
        name: str = LEARNED,
        *,
        relations: int = 0,
    ):
        """Take checked weights.

        Raises:
            PolicyFileError: a weight is missing, of the wrong shape or type, or not finite.
        """
        wanted = shapes(layout, hidden, relations)
        if set(weights) != set(wanted):
            odd = sorted(set(weights) ^ set(wanted))
            raise PolicyFileError(f"the weights {', '.join(map(repr, odd[:4]))} are missing or unknown")
        for key, shape in wanted.items():
            values = weights[key]
            if values.dtype != np.float32 or values.shape != shape:
                raise PolicyFileError(f"weight {key!r} is {values.dtype} {values.shape}, wanted float32 {shape}")
            if not np.isfinite(values).all():
                raise PolicyFileError(f"weight {key!r} holds numbers that are not finite")
        self.name, self.layout, self.hidden, self.relations, self.card = name, layout, hidden, relations, dict(card)
        self.weights = {key: np.ascontiguousarray(values) for key, values in weights.items()}
        # Transposed once: a matrix product with the batch in front is what every call needs.
        self._w = {key: np.ascontiguousarray(values.T) for key, values in self.weights.items()}

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        return np.where(observation["action_mask"] > 0, self.logits(observation), -np.inf).argmax(axis=1)

    def logits(self, observation: Observation) -> NDArray[np.float32]:
        """Logits (B, actions) before the mask.

        Raises:
            ValueError: the observation is of another task or number of slots.
        """
        layout, w = self.layout, self._w
        machine, flat = observation["machine"], observation["candidates"]
        if machine.shape[1:] != (layout.machine,) or flat.shape[1:] != (layout.candidates * layout.features,):
            raise ValueError(
                f"machine {machine.shape[1:]} and candidates {flat.shape[1:]} do not fit this policy, made for "
                f"{layout.machine} and {layout.candidates} x {layout.features} numbers"
            )
        candidates = flat.reshape(-1, layout.candidates, layout.features)
        present = (candidates[..., :1] > 0.0).astype(np.float32)
        code = candidates @ w["encoder.candidate.weight"] + w["encoder.candidate.bias"]
        code += (machine @ w["encoder.machine.weight"])[:, None]
        code = np.maximum(code, 0.0) @ w["encoder.second.weight"] + w["encoder.second.bias"]
        code = np.maximum(code, 0.0)
        there = code * present
        count = present.sum(axis=1)
        mean = there.sum(axis=1) / np.maximum(count, 1.0)
        pooled = np.concatenate([mean, there.max(axis=1), machine, count / np.float32(layout.candidates)], axis=1)
        context = np.maximum(pooled @ w["encoder.context.weight"] + w["encoder.context.bias"], 0.0)
        if self.relations:
            code = np.concatenate([code, self._heard(code, present)], axis=2)
        joined = code @ w["own.weight"] + w["own.bias"] + (context @ w["shared.weight"])[:, None]
        slots = (np.maximum(joined, 0.0) @ w["options.weight"] + w["options.bias"]) * present
        extras = context @ w["extras.weight"] + w["extras.bias"]
        return layout.join(slots, extras, np.concatenate)

    def _heard(self, code: NDArray[np.float32], present: NDArray[np.float32]) -> NDArray[np.float32]:
        """Mean and maximum (B, K, 2 R) over the present candidates of what each is to each candidate (B, K, H)."""
        w, there = self._w, present[:, None]
        one = code @ w["from_one.weight"] + w["from_one.bias"]
        pairs = np.maximum(one[:, :, None] + (code @ w["to_other.weight"])[:, None], 0.0) * there
        mean = pairs.sum(axis=2) / np.maximum(there.sum(axis=2), 1.0)
        return np.concatenate([mean, pairs.max(axis=2)], axis=2)

    def resized(self, candidates: int) -> LearnedPolicy:
        """The same weights for another number of slots; what was learned of K is kept as it is."""
        return LearnedPolicy(
            replace(self.layout, candidates=candidates), self.hidden, self.weights, self.card, self.name
        )


def save(
    path: Path, layout: Layout, hidden: int, weights: Weights, card: Mapping[str, Any], *, relations: int = 0
) -> None:
    """Write ``path`` (``.npz``) and its card (``.json``), each to a temporary name first.

    Args:
        path: ends in ``.npz``.
        layout: of the task.
        hidden: width of the actor.
        weights: as ``shapes`` names them, float32.
        card: whatever should be known of the policy, JSON values.
        relations: numbers that candidates hear of each other.

    Raises:
        PolicyFileError: the weights do not fit, or the files would be too large.
    """
    if path.suffix != ".npz":
        raise PolicyFileError(f"{path}: name a file that ends in .npz")
    LearnedPolicy(layout, hidden, weights, card, relations=relations)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **weights)  # type: ignore[arg-type]
    if len(buffer.getvalue()) > MOST_BYTES:
        raise PolicyFileError(
            f"{path} would have {len(buffer.getvalue())} bytes, at most {MOST_BYTES}: use less hidden"
        )
    head = {"format": FORMAT, "layout": vars(layout), "hidden": hidden, "relations": relations}
    text = json.dumps({**head, **card}, indent=2, allow_nan=False) + "\n"
    _replace(path, buffer.getvalue())
    _replace(path.with_suffix(".json"), text.encode())


def load(path: Path, name: str | None = None) -> LearnedPolicy:
    """Read a policy: ``path`` (``.npz``) and the card of the same name (``.json``).

    Raises:
        PolicyFileError: a file is missing, too large, damaged or of another kind.
    """
    card = _read_card(path.with_suffix(".json"))
    try:
        hidden = _integer(card.get("hidden"), "hidden")
        relations = _integer(card.get("relations", 0), "relations")
        layout = Layout(**{str(key): _integer(value, key) for key, value in card["layout"].items()})
    except (TypeError, AttributeError, ValueError, KeyError) as error:
        raise PolicyFileError(f"{path.with_suffix('.json')}: its layout cannot be used ({error})") from None
    if not (1 <= hidden <= MOST_HIDDEN and 0 <= relations <= MOST_HIDDEN) or max(vars(layout).values()) > 4096:
        raise PolicyFileError(f"{path.with_suffix('.json')}: hidden = {hidden} or its layout is out of range")
    try:
        return LearnedPolicy(layout, hidden, _read_weights(path), card, name or LEARNED, relations=relations)
    except PolicyFileError as error:
        raise PolicyFileError(f"{path}: {error}") from None


def load_for(path: Path, env: Any, name: str | None = None) -> LearnedPolicy:
    """Read a policy and fit it to an environment.

    Raises:
        PolicyFileError: it was made for another task.
    """
    policy, layout = load(path, name), layout_of(env)
    spec = env.unwrapped.spec
    made_for = policy.card.get("env_id")
    if spec is not None and made_for not in (None, spec.id):
        raise PolicyFileError(f"{path} was trained on {made_for}, this is {spec.id}")
    if policy.layout != layout:
        policy = policy.resized(layout.candidates)
        if policy.layout != layout:
            raise PolicyFileError(f"{path} was made for {policy.layout}, this environment has {layout}")
    return policy


def shipped(env_id: str, scenario: str | None = None) -> Path | None:
    """File of the policy that the package ships for an environment, None where there is none.

    Args:
        env_id: registered id.
        scenario: the policy trained on this scenario where there is one, else one of another scenario.
    """
    folder = resources.files(__name__.rsplit(".", 2)[0]) / "assets" / "policies"
    stem = env_id.split("/")[-1]
    if not isinstance(folder, Path) or not folder.is_dir():
        return None
    there = {path.stem.removeprefix(stem + "."): path for path in sorted(folder.glob(f"{stem}.*.npz"))}
    if not there:
        return None
    return there.get(scenario or "", next(iter(there.values())))


def task_digest(env: Any) -> str:
    """Digest of every number of a task's configuration: a policy's card says with it what it was trained on."""
    return hashlib.sha256(repr(env.unwrapped.core.config).encode()).hexdigest()[:16]


def _read_card(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > MOST_CARD_BYTES:
            raise PolicyFileError(f"{path} has {path.stat().st_size} bytes, at most {MOST_CARD_BYTES} are read")
        text = path.read_bytes()
    except OSError as error:
        raise PolicyFileError(f"cannot read {path} ({error.strerror}): a policy is NAME.npz with NAME.json") from None
    try:
        card = json.loads(text)
    except (ValueError, RecursionError):
        raise PolicyFileError(f"{path} is no JSON: fetch the policy again") from None
    if not isinstance(card, dict) or card.get("format") != FORMAT:
        found = card.get("format") if isinstance(card, dict) else None
        raise PolicyFileError(f"{path} has the format {found!r}, this version reads {FORMAT!r}")
    return card


def _read_weights(path: Path) -> dict[str, NDArray[np.float32]]:
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise PolicyFileError(f"it has {size} bytes, at most {MOST_BYTES} are read")
        with zipfile.ZipFile(path) as archive:
            unpacked = sum(item.file_size for item in archive.infolist())
            if unpacked > MOST_BYTES:
                raise PolicyFileError(f"it unpacks to {unpacked} bytes, at most {MOST_BYTES} are read")
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in list(arrays)}
    except PolicyFileError:
        raise
    except OSError as error:
        raise PolicyFileError(f"cannot be read ({error.strerror or error})") from None
    except Exception as error:  # NumPy and zipfile raise many kinds for damaged files, pickled objects among them.
        raise PolicyFileError(f"damaged, or no file of plain arrays ({error})") from None


def _integer(value: Any, name: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        raise PolicyFileError(f"{name} = {value!r} is no whole number")
    return value


def _replace(path: Path, data: bytes) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
