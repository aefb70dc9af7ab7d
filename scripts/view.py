"""``fieldgym view``: watch a machine in the browser, live, and decide yourself."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
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
    record: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Serve nothing: write the replay as one page.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Of the replay, simulated; by default the whole episode.")
    ] = None,
    play: Annotated[bool, typer.Option("--play", help="Begin at once; else the page waits for its Play button.")] = (
        False
    ),
) -> None:
    """Serve a live view in the browser: scene, score, decisions, and buttons to play, pause, step and choose.

    It listens on this machine alone. From elsewhere forward the port: ssh -L 8080:localhost:8080 HOST.

    Try:

      fieldgym view LaserWeeding

      fieldgym view ProduceSorting --record sorting.html --seconds 60

      fieldgym view SafflowerPicking --policy grams-per-second --against fixed-order --seed 7
    """
    from fieldgym.agents import reference_policy

    env_id = common.environment_id(env)
    common.seeds_of(seed, None, None, 1)
    if not 0 <= port < 65536:
        raise common.CommandError(f"--port {port}: give 0..65535, 0 for any free one")
    if field is not None and not field.is_file():
        raise common.CommandError(f"--field {field}: there is no such file")
    if record is not None and record.suffix != ".html":
        raise common.CommandError(f"--record {record}: name a file that ends in .html")
    if seconds is not None and (record is None or not seconds > 0.0):
        raise common.CommandError(f"--seconds {seconds:g}: give --record and seconds above 0")
    check_viser()
    from fieldgym.viewer.play import Play
    from fieldgym.viewer.show import Viewer

    names = [policy or reference_policy(env_id), *([against] if against else [])]
    for name in names:
        common.policy_of(env_id, name, trust)
    condition = common.condition_of(env_id, scenario, backend or "analytic", perception, sets or (), None)
    settings: dict[str, Any] = {"backend": condition.backend, **condition.settings}
    make = partial(seat_of, trust=trust)
    shown = Play(env_id, names[0], against or "", seed, settings, None if field is None else str(field))
    if record is not None:
        _record(record, shown, make, float("inf") if seconds is None else seconds)
        return
    with common.told_in_one_line():
        try:
            viewer = Viewer(shown, make, host, port)
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


def _record(path: Path, play: Play, make: Callable[[Play, str], Seat], until_s: float) -> None:
    """Write a replay, and say what came of it."""
    from rich.console import Console

    from fieldgym.viewer.record import record

    common.writable_folder(path.parent, "--record")
    console = Console(highlight=False)
    with common.told_in_one_line(), console.status("recording") as status:
        cards = record(path, play, make, until_s, lambda now_s: status.update(f"recording: {now_s:.0f} s"))
    names = filter(None, [play.policy, play.against])
    for name, card in zip(names, cards, strict=True):
        told = f"{name}: net rate {100.0 * card['net_rate']:.1f} %, cycle time {card['cycle_time_s']:.2f} s"
        console.print(f"{told} after {card['duration_s']:.1f} s", markup=False)
    console.print(f"Replay: {path} ({path.stat().st_size / 1e6:.2f} MB)", markup=False)


def seat_of(play: Play, name: str, trust: bool = False) -> Seat:
    """A policy at an environment of its own."""
    import gymnasium as gym

    from fieldgym.agents.sources import policy_source
    from fieldgym.kernels.seeds import POLICY_SEEDS
    from fieldgym.viewer.seat import Seat

    env = gym.make(play.env_id, disable_env_checker=True, render_mode="rgb_array", **play.settings)
    try:
        return Seat(env, policy_source(play.env_id, name, trust).make(env, POLICY_SEEDS + play.seed))
    except Exception:
        env.close()
        raise


def check_viser() -> None:
    """Refuse at once what needs viser where it is not installed."""
    try:
        import viser  # noqa: F401
    except ImportError:
        raise common.CommandError('fieldgym view needs viser: pip install "fieldgym[view]"') from None
