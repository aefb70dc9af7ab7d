"""Learned policies as files that are safe to open: weights in ``.npz`` without pickle, a card in JSON beside them.

A policy runs with NumPy alone, whatever it was trained with. A stranger's file can at worst decide badly: its size,
its names, its shapes and its numbers are checked before anything is computed with it.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...envs.references import resolved
from ...envs.task import task
from ...kernels.files import read_file, replace_file, unpacked_bytes
from ..foreign import in_words
from ..policies.network import FORMAT as NETWORK
from ..policies.network import NetworkPolicy
from ..policies.pixels import FORMAT as PIXELS
from ..policies.pixels import PixelPolicy
from ..policies.value_weights import FORMAT as SORTING_VALUE
from ..policies.weights import LEARNED, PolicyFileError, Weights

MOST_BYTES = 2_000_000
"""Largest file, packed or unpacked: a policy is small, what is larger is something else."""
MOST_CARD_BYTES = 500_000


class Portable(Protocol):
    """A learned policy, or what becomes one for an environment: it can be kept in a file.

    Attributes:
        name: of the policy in tables.
        card: what is known of it: task, settings, seeds, scores, weaknesses.
        weights: plain arrays by name.
        head: what a card has to say for the weights to be read, its format among it.
    """

    name: str
    card: dict[str, Any]
    weights: Weights

    @property
    def head(self) -> dict[str, Any]:
        """See above."""
        ...

    def fitted(self, env: Any) -> Any:
        """The policy for an environment."""


READERS: dict[str, str | Callable[[Mapping[str, Any], Weights, str], Portable]] = {
    NETWORK: NetworkPolicy.of,
    PIXELS: PixelPolicy.of,
    SORTING_VALUE: "fieldgym.agents.policies.sorting_value:ValueWeights.of",
}
"""By format; text where a task's rules would have to load for it."""


def save(path: Path, policy: Portable, card: Mapping[str, Any] | None = None) -> None:
    """Write ``path`` (``.npz``) and its card (``.json``), each to a temporary name first.

    Args:
        path: ends in ``.npz``.
        policy: whose weights are kept.
        card: whatever should be known of the policy, JSON values; by default what it says itself.

    Raises:
        PolicyFileError: the file would be too large, or is not called ``.npz``.
    """
    if path.suffix != ".npz":
        raise PolicyFileError(f"{path}: name a file that ends in .npz")
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **policy.weights)  # type: ignore[arg-type]
    if len(buffer.getvalue()) > MOST_BYTES:
        raise PolicyFileError(
            f"{path} would have {len(buffer.getvalue())} bytes, at most {MOST_BYTES}: use less hidden"
        )
    # The head stands first, whatever an older card says.
    text = json.dumps(
        policy.head | dict(policy.card if card is None else card) | policy.head, indent=2, allow_nan=False
    )
    replace_file(path, buffer.getvalue())
    replace_file(path.with_suffix(".json"), text + "\n")


def load(path: Path, name: str = LEARNED) -> Portable:
    """Read a policy: ``path`` (``.npz``) and the card of the same name (``.json``).

    Raises:
        PolicyFileError: a file is missing, too large, damaged or of another kind.
    """
    card = _read_card(path.with_suffix(".json"))
    with _told_of(path):
        return resolved(READERS[card["format"]])(card, _read_weights(path), name)


def load_for(path: Path, env: Any, name: str = LEARNED) -> Any:
    """Read a policy and fit it to an environment.

    Raises:
        PolicyFileError: it was made for another task.
    """
    saved = load(path, name)
    spec = env.unwrapped.spec
    made_for = saved.card.get("env_id")
    if spec is not None and made_for is not None and str(made_for).rpartition(":")[2] != spec.id:
        raise PolicyFileError(f"{path} was trained on {' '.join(str(made_for).split())[:80]}, this is {spec.id}")
    with _told_of(path):
        return saved.fitted(env)


@contextmanager
def _told_of(path: Path) -> Iterator[None]:
    """Make one line of whatever a stranger's card or weights bring about."""
    try:
        yield
    except PolicyFileError as error:
        raise PolicyFileError(f"{path}: {' '.join(str(error).split())}") from None
    except (TypeError, ValueError, KeyError, IndexError, AttributeError, OverflowError, RecursionError) as error:
        raise PolicyFileError(f"{path}: its card or its weights are damaged ({in_words(error)[:200]})") from None


def shipped(env_id: str, scenario: str | None = None) -> Path | None:
    """File of the policy that the package ships for an environment, None where there is none.

    Args:
        env_id: registered id.
        scenario: the policy trained on this scenario where there is one, else that of the headline, else any.
    """
    folder = resources.files(__name__.rsplit(".", 3)[0]) / "assets" / "policies"
    stem = env_id.split("/")[-1]
    if not isinstance(folder, Path) or not folder.is_dir():
        return None
    there = {path.stem.removeprefix(stem + "."): path for path in sorted(folder.glob(f"{stem}.*.npz"))}
    if not there:
        return None
    return there.get(scenario or "", there.get(task(env_id).headline, next(iter(there.values()))))


def task_digest(env: Any) -> str:
    """Digest of every number of a task's configuration: a policy's card says with it what it was trained on."""
    return hashlib.sha256(repr(env.unwrapped.core.config).encode()).hexdigest()[:16]


def _read_card(path: Path) -> dict[str, Any]:
    try:
        text = read_file(path, MOST_CARD_BYTES)
    except OSError as error:
        raise PolicyFileError(f"cannot read {path} ({error.strerror}): a policy is NAME.npz with NAME.json") from None
    try:
        card = json.loads(text)
    except (ValueError, RecursionError):
        raise PolicyFileError(f"{path} is no JSON: fetch the policy again") from None
    found = card.get("format") if isinstance(card, dict) else None
    if not isinstance(found, str) or found not in READERS:
        raise PolicyFileError(f"{path} has the format {repr(found)[:80]}, this version reads {', '.join(READERS)}")
    return card


def _read_weights(path: Path) -> dict[str, NDArray[np.float32]]:
    try:
        data = io.BytesIO(read_file(path, MOST_BYTES))
        unpacked = unpacked_bytes(data)
        if unpacked > MOST_BYTES:
            raise PolicyFileError(f"it unpacks to {unpacked} bytes, at most {MOST_BYTES} are read")
        with np.load(data, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in list(arrays)}
    except PolicyFileError:
        raise
    except OSError as error:
        raise PolicyFileError(f"cannot be read ({error.strerror or error})") from None
    except Exception as error:  # NumPy and zipfile raise many kinds for damaged files, pickled objects among them.
        raise PolicyFileError(f"damaged, or no file of plain arrays ({error})") from None
