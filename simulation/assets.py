"""Finding the files that ship inside the package."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import resources
from pathlib import Path


@contextmanager
def asset_path(name: str) -> Iterator[Path]:
    """A real file for an asset, valid inside the ``with`` block.

    Works from a source tree, an installed wheel and a zip archive (which is unpacked to a temporary file).

    Args:
        name: path below ``assets/``, with forward slashes, such as ``urdf/picker/picker.urdf``.

    Raises:
        FileNotFoundError: the package has no such asset.
    """
    folder = resources.files(__name__.rsplit(".", 2)[0]).joinpath("assets")
    entry = folder.joinpath(*name.split("/"))
    if not entry.is_file():
        raise FileNotFoundError(
            f"asset {name!r} is missing from {folder}: reinstall fieldgym, or in a source tree run "
            "python scripts/generate_assets.py"
        )
    with resources.as_file(entry) as path:
        yield path


def asset_text(name: str) -> str:
    """The UTF-8 text of an asset; name and errors as for ``asset_path``."""
    with asset_path(name) as path:
        return path.read_text("utf-8")
