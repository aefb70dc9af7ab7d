"""Policies from anywhere: registered by name, in a Python file or module, as portable weights, as a saved SB3 model.

A *source* says where a policy comes from and what its code is, so that a worker of a benchmark finds the same one and
results of two states of a file are told apart:

- a registered name (``policy_names``), or ``best``, which stands for the one that the task recommends for the scenario;
- ``path/to/file.py:Name`` and ``package.module:Name``, a class or a factory, made as ``foreign.made`` says;
- ``weights.npz``, a portable policy with its card;
- ``model.zip``, a model that Stable-Baselines3 saved; loading one runs code, so it must be trusted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..envs.assembly import meant
from ..envs.references import resolved
from ..envs.task import BEST, factories, task
from .foreign import (
    ForeignError,
    digest_of_files,
    digest_of_module,
    guarded,
    made,
    module_named,
    module_of_file,
    named_in,
)
from .learning.portable import load_for, shipped
from .policies.base import GuestPolicy, Policy
from .policies.weights import LEARNED

REGISTERED, FILE, MODULE, PORTABLE, SAVED = "registered", "file", "module", "portable", "saved"
BY_ENDING = {".npz": PORTABLE, ".zip": SAVED}


class PolicySourceError(ValueError):
    """A policy cannot be found or made; the message is one line and says what to do."""


@dataclass(frozen=True)
class PolicySource:
    """Where a policy comes from; plain values, so that it travels to workers.

    Attributes:
        name: as it was asked for; tables and records have it.
        kind: ``"registered"``, ``"file"``, ``"module"``, ``"portable"`` or ``"saved"``.
        place: absolute path of the file, name of the module, or, of a registered policy, the task's id.
        target: what it is called in there.
        sha256: of its code or weights, 16 digits; empty for what is part of this package.
    """

    name: str
    kind: str
    place: str
    target: str = ""
    sha256: str = ""

    def make(self, env: Any, seed: int) -> Policy:
        """The policy for an environment.

        Raises:
            PolicySourceError: it is gone or another one by now, or its own code fails.
            PolicyFileError: its weights cannot be used.
        """
        factory = self.factory()
        guest = self.kind in (FILE, MODULE)
        try:
            policy = guarded(lambda: made(factory, env, seed)) if guest else made(factory, env, seed)
        except ForeignError as error:
            raise PolicySourceError(f"policy {self.name!r}: {error}") from error
        if not callable(getattr(policy, "act", None)):
            raise PolicySourceError(f"policy {self.name!r} is a {type(policy).__name__}: it needs act(observation)")
        if guest or not callable(getattr(policy, "reset", None)):
            return GuestPolicy(policy, self.name)
        if getattr(policy, "name", None) != self.name:
            try:
                policy.name = self.name
            except AttributeError:
                return GuestPolicy(policy, self.name)
        return policy

    def factory(self) -> Callable[..., Any]:
        """What makes it.

        Raises:
            PolicySourceError: it is gone or another one by now, or its own code fails.
        """
        if self.kind == REGISTERED and self.target == BEST:
            return make_best
        if self.kind == REGISTERED:
            return resolved(factories(self.place)[self.target])
        path = Path(self.place)
        try:
            if self.sha256 != (digest_of_module(self.place) if self.kind == MODULE else _digest(self.kind, path)):
                raise PolicySourceError(f"policy {self.name!r} has changed since it was named: begin again")
            if self.kind in (FILE, MODULE):
                module = module_of_file(path) if self.kind == FILE else module_named(self.place)
                return self._checked(named_in(module, self.target), tuple(vars(module)))
        except ForeignError as error:
            raise PolicySourceError(f"policy {self.name!r}: {error}") from error
        if self.kind == PORTABLE:
            return lambda env, seed: load_for(path, env, self.name)
        from .learning.saved_model import load_model

        return lambda env, seed: load_model(path, env)

    def _checked(self, found: Any, names: tuple[str, ...]) -> Callable[..., Any]:
        if found is None:
            public = [name for name in names if not name.startswith("_")]
            raise PolicySourceError(f"policy {self.name!r}: there is no {self.target!r}: {meant(self.target, public)}")
        if not callable(found):
            raise PolicySourceError(f"policy {self.name!r} is a {type(found).__name__}: name a class or a function")
        return found


def make_best(env: Any, seed: int) -> Policy:
    """The policy that is recommended for an environment's scenario, see ``TaskSpec.best``."""
    spec = task(env.unwrapped.spec.id)
    return policy_source(spec.id, spec.recommended(env.unwrapped.scenario)).make(env, seed)


def policy_names(env_id: str) -> tuple[str, ...]:
    """Policies that there are by name for an environment; ``best`` stands for one of them and is not among them.

    Raises:
        ValueError: unknown environment.
    """
    return tuple(name for name in factories(env_id) if name != LEARNED or shipped(task(env_id).id))


def policy_source(env_id: str, name: str, trust: bool = False) -> PolicySource:
    """Where the policy of this name comes from; of its code nothing runs yet, but for the packages around a module.

    Args:
        env_id: id of the task that it decides.
        name: see the module.
        trust: allow saved models.

    Raises:
        PolicySourceError: there is no such policy, or it may not be loaded.
    """
    known = policy_names(env_id)
    if name == BEST:
        return PolicySource(name, REGISTERED, env_id, BEST)
    if name in known:
        return PolicySource(name, REGISTERED, env_id, name, _foreign(factories(env_id)[name]))
    place, colon, target = name.rpartition(":")
    kind = BY_ENDING.get(Path(name).suffix, "")
    if kind:
        place, target = name, ""
    elif colon and place.endswith(".py") and target:
        kind = FILE
    elif colon and all(part.isidentifier() for part in (*place.split("."), *target.split("."))):
        kind = MODULE
    elif name.endswith(".py"):
        raise PolicySourceError(f"policy {name!r} is a whole file: say what in it, as in {name}:Mine")
    else:
        raise PolicySourceError(
            f"policy {name!r} is unknown for {env_id}: {meant(name, known)}, or give FILE.py:NAME, MODULE:NAME, "
            "FILE.npz or FILE.zip"
        )
    if kind == SAVED and not trust:
        raise PolicySourceError(
            f"policy {name!r}: loading a saved Stable-Baselines3 model runs code from it: say --trust (trust=True) if "
            "you trust where it comes from"
        )
    try:
        if kind == MODULE:
            return PolicySource(name, kind, place, target, digest_of_module(place))
        path = Path(place).expanduser().absolute()
        return PolicySource(name, kind, str(path), target, _digest(kind, path))
    except ForeignError as error:
        raise PolicySourceError(f"policy {name!r}: {error}") from error


def task_code(env_id: str) -> str:
    """Digest of the code of a task that is not part of this package, empty for one that is."""
    return _foreign(task(env_id).entry_point)


def _foreign(entry: Any) -> str:
    """Digest of the code in which an object, or what its text stands for, was written; empty for this package's own."""
    module = entry.partition(":")[0] if isinstance(entry, str) else getattr(entry, "__module__", "")
    if not module or module.partition(".")[0] == __name__.partition(".")[0]:
        return ""
    try:
        return digest_of_module(module)
    except ForeignError:  # made by hand in a running program: there is no file to tell its states apart
        return ""


def _digest(kind: str, path: Path) -> str:
    try:
        return digest_of_files(path, *([path.with_suffix(".json")] if kind == PORTABLE else []))
    except OSError as error:
        card = ": a policy is NAME.npz with NAME.json beside it" if kind == PORTABLE else ": name another file"
        raise ForeignError(f"cannot read {error.filename} ({error.strerror}){card}") from None
