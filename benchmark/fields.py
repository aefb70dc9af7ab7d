"""Field files as instances: a folder of them stands where seeds stand else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

ENDINGS = (".csv", ".geojson", ".json", ".txt")


class FieldsError(ValueError):
    """A folder of fields cannot be used; the message is one line and says what to do."""


@dataclass(frozen=True, order=True)
class FieldFile:
    """One field that lies in a file.

    Attributes:
        name: of the file in its folder; tables and records have it.
        path: absolute.
        digest: of the field as the file gives it; results of two states of a file are told apart by it.
    """

    name: str
    path: str
    digest: str


def field_files(
    env_id: str, folder: str | PathLike[str], settings: Mapping[str, Any], seed: int = 0
) -> tuple[FieldFile, ...]:
    """The fields of a folder, each tried in the environment that it is meant for; by name.

    Args:
        env_id: registered id.
        folder: every file in it with one of ``ENDINGS`` is a field.
        settings: of the environment.
        seed: draws what a file leaves open.

    Raises:
        FieldsError: there are none, or one of them is no field of this environment.
    """
    import gymnasium as gym

    from ..envs.field_files import read_field

    home = Path(folder).expanduser().absolute()
    try:
        paths = sorted(path for path in home.iterdir() if path.suffix.lower() in ENDINGS and path.is_file())
    except OSError as error:
        raise FieldsError(f"cannot read the folder of fields {folder} ({error.strerror}): name another") from None
    if not paths:
        raise FieldsError(f"{folder} holds no fields: put files in it that end in {', '.join(ENDINGS)}")
    env: Any = gym.make(env_id, backend="analytic", disable_env_checker=True, **settings)
    try:
        found = []
        for path in paths:
            try:
                env.reset(seed=seed, options={"field": path})
                field = read_field(path, env.unwrapped.core.field_type)
            except ValueError as error:
                told = " ".join(str(error).split())
                raise FieldsError(told if str(path) in told else f"{path}: {told}") from error
            found.append(FieldFile(path.name, str(path), field.digest()))
        return tuple(found)
    finally:
        env.close()
