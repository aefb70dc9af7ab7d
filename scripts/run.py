"""``fieldgym run``: watch a policy decide, and see what it scored."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fieldgym.kernels.files import replaced
from fieldgym.scripts import common

if TYPE_CHECKING:
    import gymnasium as gym
    from rich.console import Console

    from fieldgym.agents import Policy

FRAMES_PER_SECOND = 30
MOST_SPEED = 1000.0
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
    speed: Annotated[float, typer.Option(help="Simulated seconds a second of video.")] = 8.0,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only the scorecard.")] = False,
) -> None:
    """Run episodes of one policy with a line for each decision and a scorecard at the end.

    A policy is a name, FILE.py:NAME, MODULE:NAME, a trained FILE.npz, or a saved FILE.zip (with --trust).

    Try:

      fieldgym run SafflowerPicking

      fieldgym run LaserWeeding --policy ./mine.py:Mine --set process.power_w=150 --backend analytic

      fieldgym run SafflowerPicking --perception perfect --video picking.mp4
    """
    from rich.console import Console

    from fieldgym.agents import reference_policy
    from fieldgym.benchmark.episode import POLICY_SEEDS

    env_id = common.environment_id(env)
    source = common.policy_of(env_id, policy or reference_policy(env_id), trust)
    seeds = common.seeds_of(seed, episodes, fields, 1)
    if not 0.0 < speed <= MOST_SPEED:
        raise common.CommandError(f"--speed {speed}: give a positive factor up to {MOST_SPEED:g}, 1 is real time")
    condition = common.condition_of(env_id, scenario, backend, perception, sets or (), fields)
    options: dict[str, Any] = {"backend": condition.backend, **condition.settings}
    files = common.fields_of(condition, seed)
    instances = [(seed, file) for file in files] or [(each, None) for each in seeds]
    if video is not None:
        _check_video(video)
        options["render_mode"] = "rgb_array"
    console = Console(highlight=False)
    environment = _make(env_id, options)
    title = f"{condition.title()}: {source.name}"
    scorecards = {}
    try:
        with common.told_in_one_line(), _filming(environment, video, speed):
            decider = source.make(environment, POLICY_SEEDS + seed)
            for number, file in instances:
                name = f"seed {number}" if file is None else file.name
                if not quiet:
                    console.print(f"\n{title}, {name}", style="bold", markup=False)
                    console.print("step  simulated   reward  decision", style="dim")
                path = None if file is None else file.path
                scorecards[name] = _episode(environment, decider, number, path, None if quiet else console)
    finally:
        environment.close()
    console.print(f"\n{title}", style="bold", markup=False)
    _print_scorecards(console, scorecards)
    if video is not None:
        console.print(f"Video: {video}")


def _make(env_id: str, options: dict[str, Any]) -> gym.Env[Any, Any]:
    import gymnasium as gym

    with common.told_in_one_line():
        return gym.make(env_id, disable_env_checker=True, **options)


def _episode(
    env: gym.Env[Any, Any], policy: Policy, seed: int, field: str | None, console: Console | None
) -> dict[str, float]:
    """Play one episode and return its scorecard."""
    from fieldgym.agents.rollout import begin, decisions

    observation, info = begin(env, seed, field)
    for number, decision in enumerate(decisions(env, policy, observation), start=1):
        info = decision.info
        if console is not None:
            now_s = float(info["scorecard"]["duration_s"])
            text = getattr(env.unwrapped, "describe_last_decision")()  # noqa: B009  not in gymnasium.Env
            console.print(
                f"{number:4d}  {now_s:7.1f} s  {decision.reward:+7.3f}  {text}",
                markup=False,
                overflow="ellipsis",
                no_wrap=True,
            )
    return {name: float(value) for name, value in info["scorecard"].items()}


def _check_video(path: Path) -> None:
    """Refuse at once what would only fail after the episode."""
    if path.suffix != ".mp4":
        raise common.CommandError(f"--video {path}: name a file that ends in .mp4")
    try:
        import imageio.v2  # noqa: F401
        import imageio_ffmpeg  # noqa: F401
    except ImportError:
        raise common.CommandError('--video needs imageio: pip install "fieldgym[bench]"') from None
    common.writable_folder(path.parent, "--video")


@contextmanager
def _filming(env: gym.Env[Any, Any], path: Path | None, speed: float) -> Iterator[None]:
    """Write what the camera sees while the block runs; the file appears when it is whole."""
    if path is None:
        yield
        return
    import imageio.v2

    record: Callable[..., None] = getattr(env.unwrapped, "record")  # noqa: B009
    with replaced(path) as temporary:
        writer = imageio.v2.get_writer(temporary, fps=FRAMES_PER_SECOND, macro_block_size=2)
        try:
            record(writer.append_data, FRAMES_PER_SECOND / speed)
            yield
        finally:
            writer.close()


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
