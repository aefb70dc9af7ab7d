"""``fieldgym run``: watch a policy decide, and see what it scored."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fieldgym.scripts import common
from fieldgym.wrappers import FRAMES_PER_SECOND, MOST_SPEED, Filming, machine_of, require_writer, video_file

if TYPE_CHECKING:
    import gymnasium as gym
    from rich.console import Console

    from fieldgym.agents import Policy
    from fieldgym.scripts.film import Hand

MOST_COLUMNS = 4


def main(
    env: Annotated[str, typer.Argument(metavar="ID", help="An environment; see fieldgym list.", show_default=False)],
    policy: Annotated[
        str | None, typer.Option(metavar="NAME|FILE", help="Who decides; by default the paper's own order.")
    ] = None,
    episodes: Annotated[
        int | None, typer.Option(help="How many, with seeds SEED, SEED + 1, ...; by default 1.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the first episode: the field and its luck.")] = 0,
    scenario: common.Scenario = None,
    sets: common.Sets = None,
    fields: common.Fields = None,
    backend: Annotated[
        str | None, typer.Option(help="pybullet moves the machine, analytic computes it; by default the first it has.")
    ] = None,
    perception: Annotated[
        str | None, typer.Option(help="perfect, model or camera; by default what suits the backend.")
    ] = None,
    trust: common.Trust = False,
    video: Annotated[
        Path | None, typer.Option(metavar="FILE.mp4", help="Film the episodes; a frame takes about 0.1 s.")
    ] = None,
    against: Annotated[
        str | None, typer.Option(metavar="NAME|FILE", help="Film this policy beside it, on the same field.")
    ] = None,
    speed: Annotated[float, typer.Option(help="Simulated seconds a second of video.")] = 8.0,
    camera: Annotated[
        str | None, typer.Option(help="Of the video: machine, overview, tool, and front where there is one.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only the scorecard.")] = False,
) -> None:
    """Run episodes of one policy with a line for each decision and a scorecard at the end.

    A policy is a name, FILE.py:NAME, MODULE:NAME, a trained FILE.npz, or a saved FILE.zip (with --trust).

    Try:

      fieldgym run SafflowerPicking

      fieldgym run LaserWeeding --policy ./mine.py:Mine --set process.power_w=150 --backend analytic

      fieldgym run SafflowerPicking --perception perfect --video picking.mp4

      fieldgym run HoeWeeding --policy nearest --against learned --backend analytic --video hoes.mp4 --speed 1
    """
    from rich.console import Console

    from fieldgym.agents import reference_policy
    from fieldgym.kernels.seeds import POLICY_SEEDS
    from fieldgym.scripts.film import film

    env_id = common.environment_id(env)
    names = [policy or reference_policy(env_id), *([against] if against else [])]
    sources = [common.policy_of(env_id, name, trust) for name in names]
    seeds = common.seeds_of(seed, episodes, fields, 1)
    if not 0.0 < speed <= MOST_SPEED:
        raise common.CommandError(f"--speed {speed}: give a positive factor up to {MOST_SPEED:g}, 1 is real time")
    if video is None and (against or camera):
        raise common.CommandError(
            "--against and --camera are of films: give --video FILE.mp4, or see fieldgym evaluate"
        )
    condition = common.condition_of(env_id, scenario, backend, perception, sets or (), fields)
    options: dict[str, Any] = {"backend": condition.backend, **condition.settings}
    files = common.fields_of(condition, seed)
    instances = [(seed, file) for file in files] or [(each, None) for each in seeds]
    if video is not None:
        _check_video(video)
        options |= {"render_mode": "rgb_array"} | ({"camera": camera} if camera else {})
    console = Console(highlight=False)
    environments: list[gym.Env[Any, Any]] = []
    title = f"{condition.title()}: {' and '.join(source.name for source in sources)}"
    scorecards = {}
    try:
        with common.told_in_one_line(), _filming(video) as write:
            environments += [_make(env_id, options) for _ in sources]
            deciders = [
                source.make(one, POLICY_SEEDS + seed) for source, one in zip(sources, environments, strict=True)
            ]
            tellers = [None if quiet else partial(_tell, console, each if against else "") for each in names]
            for number, file in instances:
                instance = f"seed {number}" if file is None else file.name
                if not quiet:
                    console.print(f"\n{title}, {instance}", style="bold", markup=False)
                    console.print("step  simulated   reward  decision", style="dim")
                path = None if file is None else file.path
                plays = [
                    partial(_episode, one, decider, number, path, told, FRAMES_PER_SECOND / speed)
                    for one, decider, told in zip(environments, deciders, tellers, strict=True)
                ]
                cards = [plays[0](None)] if write is None else film(write, plays)
                for source, card in zip(sources, cards, strict=True):
                    scorecards[f"{source.name}, {instance}" if against else instance] = card
    finally:
        for one in environments:
            one.close()
    console.print(f"\n{title}", style="bold", markup=False)
    _print_scorecards(console, scorecards)
    if video is not None:
        console.print(f"Video: {video}")


def _make(env_id: str, options: dict[str, Any]) -> gym.Env[Any, Any]:
    import gymnasium as gym

    with common.told_in_one_line():
        return gym.make(env_id, disable_env_checker=True, **options)


def _episode(
    env: gym.Env[Any, Any],
    policy: Policy,
    seed: int,
    field: str | None,
    tell: Callable[[str], None] | None,
    frames_per_second: float,
    hand: Hand | None,
) -> dict[str, float]:
    """Play one episode, hand its frames over where somebody takes them, and return its scorecard."""
    from fieldgym.agents.rollout import begin, decisions

    observation, info = begin(env, seed, field)
    filming = None
    if hand is not None:
        title = f"{machine_of(env)} | {policy.name}"
        filming = Filming(env, hand, frames_per_second, title, info["scorecard"])
    for number, decision in enumerate(decisions(env, policy, observation), start=1):
        info = decision.info
        if filming is not None:
            filming.took(info)
        if tell is not None:
            now_s = float(info["scorecard"]["duration_s"])
            text = getattr(env.unwrapped, "describe_last_decision")()  # noqa: B009  not in gymnasium.Env
            tell(f"{number:4d}  {now_s:7.1f} s  {decision.reward:+7.3f}  {text}")
    if filming is not None:
        filming.end()
    return {name: float(value) for name, value in info["scorecard"].items()}


def _tell(console: Console, who: str, line: str) -> None:
    """A line about a decision, and whose it was where two decide."""
    line = f"{who:<20}  {line}" if who else line
    console.print(line, markup=False, overflow="ellipsis", no_wrap=True)


def _check_video(path: Path) -> None:
    """Refuse at once what would only fail after the episode."""
    if path.suffix != ".mp4":
        raise common.CommandError(f"--video {path}: name a file that ends in .mp4")
    try:
        require_writer()
    except ImportError as error:
        raise common.CommandError(str(error)) from None
    common.writable_folder(path.parent, "--video")


def _filming(path: Path | None) -> AbstractContextManager[Hand | None]:
    """What takes the frames of a film, None where none is asked for."""
    return nullcontext() if path is None else video_file(path, FRAMES_PER_SECOND)


def _print_scorecards(console: Console, scorecards: dict[str, dict[str, float]]) -> None:
    """A column an episode, or where they are many their mean, spread and extremes."""
    import numpy as np
    from rich import box
    from rich.table import Table

    few = len(scorecards) <= MOST_COLUMNS
    titles = list(scorecards) if few else []
    summaries = {"mean": np.mean, "SD": np.std, "least": np.min, "most": np.max}
    summaries = {} if len(scorecards) == 1 else {"mean": np.mean} if few else summaries
    table = Table(box=box.SIMPLE_HEAD)
    for number, title in enumerate(["scorecard", *titles, *summaries]):
        table.add_column(title, justify="right" if number else "left", no_wrap=True)
    for name in next(iter(scorecards.values())):
        values = np.array([scorecard[name] for scorecard in scorecards.values()])
        finite = values[np.isfinite(values)]
        cells = list(values[: len(titles)])
        cells += [float(summary(finite)) if len(finite) else np.nan for summary in summaries.values()]
        table.add_row(name, *(f"{value:.4g}" if np.isfinite(value) else "-" for value in cells))
    console.print(table)
