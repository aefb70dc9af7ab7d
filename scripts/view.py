"""``fieldgym view``: watch a machine in the browser, live, and decide yourself."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fieldgym.scripts import common

if TYPE_CHECKING:
    from fieldgym.viewer.play import Play
    from fieldgym.viewer.seat import Seat

PORT = 8080
LOOPBACK = "127.0.0.1"


def main(
    env: Annotated[str, typer.Argument(metavar="ID", help="An environment; see fieldgym list.", show_default=False)],
    policy: Annotated[
        str | None, typer.Option(metavar="NAME|FILE", help="Who decides; by default the paper's own order.")
    ] = None,
    against: Annotated[
        str | None, typer.Option(metavar="NAME|FILE", help="Who decides beside it, on the same field.")
    ] = None,
    scenario: common.Scenario = None,
    seed: Annotated[int, typer.Option(help="Of the field and its luck.")] = 0,
    sets: common.Sets = None,
    field: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Play this field file instead of the seed's.")
    ] = None,
    backend: Annotated[
        str | None, typer.Option(help="pybullet moves the machine, analytic computes it; by default analytic.")
    ] = None,
    perception: Annotated[
        str | None, typer.Option(help="perfect, model or camera; by default what suits the backend.")
    ] = None,
    trust: common.Trust = False,
    host: Annotated[str, typer.Option(help="Who may connect: 0.0.0.0 lets in everybody who reaches the port.")] = (
        LOOPBACK
    ),
    port: Annotated[int, typer.Option(help="Of the page; another free one is taken where it is in use.")] = PORT,
    play: Annotated[bool, typer.Option("--play", help="Begin at once; else the page waits for its Play button.")] = (
        False
    ),
) -> None:
    """Serve a live view in the browser: scene, score, decisions, and buttons to play, pause, step and choose.

    It listens on this machine alone. From elsewhere forward the port: ssh -L 8080:localhost:8080 HOST.

    Try:

      fieldgym view LaserWeeding

      fieldgym view SafflowerPicking --policy grams-per-second --against fixed-order --seed 7
    """
    from fieldgym.agents import reference_policy

    env_id = common.environment_id(env)
    if seed < 0:
        raise common.CommandError(f"--seed {seed}: give 0 or more")
    if not 0 <= port < 65536:
        raise common.CommandError(f"--port {port}: give 0..65535, 0 for any free one")
    if field is not None and not field.is_file():
        raise common.CommandError(f"--field {field}: there is no such file")
    _check_viser()
    from fieldgym.viewer.play import Play
    from fieldgym.viewer.show import Viewer

    names = [policy or reference_policy(env_id), *([against] if against else [])]
    for name in names:
        common.policy_of(env_id, name, trust)
    condition = common.condition_of(env_id, scenario, backend or "analytic", perception, sets or (), None)
    settings: dict[str, Any] = {"backend": condition.backend, **condition.settings}
    shown = Play(env_id, names[0], against or "", seed, settings, None if field is None else str(field))
    with common.told_in_one_line():
        try:
            viewer = Viewer(shown, lambda play, name: seat_of(play, name, trust), host, port)
        except OSError as error:
            raise common.CommandError(
                f"cannot serve on {host}:{port} ({error.strerror}): give another --host or --port"
            ) from None
    typer.echo(f"{condition.title()}: {viewer.address} (Ctrl-C ends it)")
    try:
        if play:
            viewer.set_running(True)
        viewer.run()
    finally:
        viewer.close()


def seat_of(play: Play, name: str, trust: bool = False) -> Seat:
    """A policy at an environment of its own."""
    import gymnasium as gym

    from fieldgym.agents.sources import policy_source
    from fieldgym.benchmark.episode import POLICY_SEEDS
    from fieldgym.viewer.seat import Seat

    env = gym.make(play.env_id, disable_env_checker=True, render_mode="rgb_array", **play.settings)
    try:
        return Seat(env, policy_source(play.env_id, name, trust).make(env, POLICY_SEEDS + play.seed))
    except Exception:
        env.close()
        raise


def _check_viser() -> None:
    try:
        import viser  # noqa: F401
    except ImportError:
        raise common.CommandError('fieldgym view needs viser: pip install "fieldgym[view]"') from None
