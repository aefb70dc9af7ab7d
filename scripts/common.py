"""What the commands share: errors of one line, and choices that know what was meant."""

from __future__ import annotations

import difflib
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import typer

USAGE_ERROR = 2
INTERRUPTED = 130


class CommandError(Exception):
    """What was asked cannot be done; the message is one line and says what to do instead."""


def chosen(value: str, choices: Sequence[str], what: str) -> str:
    """``value`` when it is one of ``choices``.

    Raises:
        CommandError: it is not; the message lists the choices and names the nearest.
    """
    if value in choices:
        return value
    near = difflib.get_close_matches(value, choices, n=1, cutoff=0.5)
    hint = f" Did you mean {near[0]}?" if near else ""
    raise CommandError(f"no {what} is called {value!r}.{hint} Choose one of: {', '.join(choices)}")


def at_least_one(value: int, option: str) -> int:
    """``value`` when it is positive.

    Raises:
        CommandError: it is not.
    """
    if value < 1:
        raise CommandError(f"{option} {value}: give at least 1")
    return value


def environment_id(name: str) -> str:
    """The registered id that ``name`` means; the namespace and the version may be left out.

    Raises:
        CommandError: there is no such environment.
    """
    from fieldgym.envs import env_ids

    short = {env_id.removeprefix("fieldgym/").split("-v")[0].lower(): env_id for env_id in env_ids()}
    bare = name.removeprefix("fieldgym/")
    if f"fieldgym/{bare}" in env_ids():
        return f"fieldgym/{bare}"
    if bare.lower() in short:
        return short[bare.lower()]
    return chosen(name, env_ids(), "environment")


def writable_folder(folder: Path, option: str) -> Path:
    """``folder``, made if need be.

    Raises:
        CommandError: it cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandError(
            f"cannot make the folder {folder} ({error.strerror}): choose another with {option}"
        ) from None
    if not os.access(folder, os.W_OK):
        raise CommandError(f"the folder {folder} is read-only: choose another with {option}")
    return folder


def execute(app: typer.Typer, name: str) -> NoReturn:
    """Run ``app`` on this process's arguments and leave with its exit code.

    What a user did wrong is told in one line, without a traceback.

    Args:
        app: the commands.
        name: what the help and the errors call the program.
    """
    try:
        code = app(prog_name=name, standalone_mode=False)
    except CommandError as error:
        sys.exit(_told(str(error), USAGE_ERROR))
    except (KeyboardInterrupt, typer.Abort):
        sys.exit(_told("stopped", INTERRUPTED))
    except Exception as error:
        # Typer's usage errors share no public base class; they all can format themselves.
        describe = getattr(error, "format_message", None)
        if describe is None:
            raise
        context = getattr(error, "ctx", None)
        path = context.command_path if context is not None else name
        sys.exit(_told(f"{' '.join(describe().split())} See: {path} --help", USAGE_ERROR))
    sys.exit(code if isinstance(code, int) else 0)


def _told(message: str, code: int) -> int:
    print(f"fieldgym: {message}", file=sys.stderr)
    return code
