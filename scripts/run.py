"""``fieldgym run``: watch a policy decide, and see what it scored."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fieldgym.scripts.common import CommandError, at_least_one, chosen, environment_id, execute, writable_folder

if TYPE_CHECKING:
    import gymnasium as gym
    from rich.console import Console

    from fieldgym.agents import Policy

FRAMES_PER_SECOND = 30
MOST_COLUMNS = 4


def main(
    env: Annotated[str, typer.Argument(metavar="ID", help="An environment; see fieldgym list.", show_default=False)],
    policy: Annotated[str | None, typer.Option(help="Who decides; by default the paper's own order.")] = None,
    episodes: Annotated[int, typer.Option(help="How many, with seeds SEED, SEED + 1, ...")] = 1,
    seed: Annotated[int, typer.Option(help="Seed of the first episode: the field and its luck.")] = 0,
    scenario: Annotated[str | None, typer.Option(help="By default the paper's protocol.")] = None,
    backend: Annotated[str, typer.Option(help="pybullet moves the machine, analytic computes it.")] = "pybullet",
    perception: Annotated[
        str | None, typer.Option(help="perfect, model or camera; by default what suits the backend.")
    ] = None,
    video: Annotated[
        Path | None, typer.Option(metavar="FILE.mp4", help="Film the episodes; a frame takes about 0.1 s.")
    ] = None,
    speed: Annotated[float, typer.Option(help="Simulated seconds a second of video.")] = 8.0,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only the scorecard.")] = False,
) -> None:
    """Run episodes of one policy with a line for each decision and a scorecard at the end.

    Try:

      fieldgym run SafflowerPicking

      fieldgym run fieldgym/SafflowerPicking-v0 --policy grams-per-second --scenario row --backend analytic

      fieldgym run SafflowerPicking --perception perfect --video picking.mp4
    """
    from rich.console import Console

    from fieldgym.agents import make_policy, policy_names, reference_policy
    from fieldgym.benchmark.episode import POLICY_SEEDS
    from fieldgym.envs import task

    env_id = environment_id(env)
    spec = task(env_id)
    name = chosen(policy or reference_policy(env_id), policy_names(env_id), f"policy for {env_id}")
    at_least_one(episodes, "--episodes")
    if seed < 0:
        raise CommandError(f"--seed {seed}: give 0 or more")
    if not speed > 0.0:
        raise CommandError(f"--speed {speed}: give a positive factor, 1 is real time")
    options: dict[str, Any] = {
        "scenario": chosen(scenario or spec.headline, spec.scenarios, f"scenario of {env_id}"),
        "backend": chosen(backend, spec.backends, "backend"),
        "perception": None if perception is None else chosen(perception, spec.perceptions, "perception"),
    }
    if video is not None:
        _check_video(video)
        options["render_mode"] = "rgb_array"
    console = Console(highlight=False)
    environment = _make(env_id, options)
    title = f"{env_id}, {options['scenario']}, {backend}: {name}"
    scorecards = []
    try:
        decider = make_policy(name, environment, seed=POLICY_SEEDS + seed)
        with _filming(environment, video, speed):
            for number in range(episodes):
                if not quiet:
                    console.print(f"\n{title}, seed {seed + number}", style="bold")
                    console.print("step  simulated   reward  decision", style="dim")
                scorecards.append(_episode(environment, decider, seed + number, None if quiet else console))
    finally:
        environment.close()
    console.print(f"\n{title}", style="bold")
    _print_scorecards(console, scorecards, seed)
    if video is not None:
        console.print(f"Video: {video}")


def _make(env_id: str, options: dict[str, Any]) -> gym.Env[Any, Any]:
    import gymnasium as gym

    try:
        return gym.make(env_id, disable_env_checker=True, **options)
    except ValueError as error:
        raise CommandError(str(error)) from None


def _episode(env: gym.Env[Any, Any], policy: Policy, seed: int, console: Console | None) -> dict[str, float]:
    """Play one episode and return its scorecard."""
    import numpy as np

    from fieldgym.agents import act_single

    observation, info = env.reset(seed=seed)
    policy.reset(np.ones(1, dtype=bool))
    over, steps = False, 0
    while not over:
        observation, reward, terminated, truncated, info = env.step(act_single(policy, observation))
        over, steps = terminated or truncated, steps + 1
        if console is not None:
            now_s = float(info["scorecard"]["duration_s"])
            text = getattr(env.unwrapped, "describe_last_decision")()  # noqa: B009  not in gymnasium.Env
            console.print(
                f"{steps:4d}  {now_s:7.1f} s  {float(reward):+7.3f}  {text}",
                markup=False,
                overflow="ellipsis",
                no_wrap=True,
            )
    return {name: float(value) for name, value in info["scorecard"].items()}


def _check_video(path: Path) -> None:
    """Refuse at once what would only fail after the episode."""
    if path.suffix != ".mp4":
        raise CommandError(f"--video {path}: name a file that ends in .mp4")
    try:
        import imageio.v2  # noqa: F401
        import imageio_ffmpeg  # noqa: F401
    except ImportError:
        raise CommandError('--video needs imageio: pip install "fieldgym[bench]"') from None
    writable_folder(path.parent, "--video")


@contextmanager
def _filming(env: gym.Env[Any, Any], path: Path | None, speed: float) -> Iterator[None]:
    """Write what the camera sees while the block runs; the file appears when it is whole."""
    if path is None:
        yield
        return
    import imageio.v2

    temporary = path.with_name(f".{path.stem}.{os.getpid()}.mp4")
    writer = imageio.v2.get_writer(temporary, fps=FRAMES_PER_SECOND, macro_block_size=2)
    record: Callable[..., None] = getattr(env.unwrapped, "record")  # noqa: B009
    try:
        record(writer.append_data, FRAMES_PER_SECOND / speed)
        yield
        writer.close()
        os.replace(temporary, path)
    finally:
        writer.close()
        temporary.unlink(missing_ok=True)


def _print_scorecards(console: Console, scorecards: list[dict[str, float]], seed: int) -> None:
    """A column an episode, or where they are many their mean, spread and extremes."""
    import numpy as np
    from rich import box
    from rich.table import Table

    few = len(scorecards) <= MOST_COLUMNS
    titles = [f"seed {seed + number}" for number in range(len(scorecards))] if few else []
    summaries = {"mean": np.mean, "SD": np.std, "least": np.min, "most": np.max}
    summaries = {} if len(scorecards) == 1 else {"mean": np.mean} if few else summaries
    table = Table(box=box.SIMPLE_HEAD)
    for number, title in enumerate(["scorecard", *titles, *summaries]):
        table.add_column(title, justify="right" if number else "left", no_wrap=True)
    for name in scorecards[0]:
        values = np.array([scorecard[name] for scorecard in scorecards])
        finite = values[np.isfinite(values)]
        cells = list(values[: len(titles)])
        cells += [float(summary(finite)) if len(finite) else np.nan for summary in summaries.values()]
        table.add_row(name, *(f"{value:.4g}" if np.isfinite(value) else "-" for value in cells))
    console.print(table)


if __name__ == "__main__":
    app = typer.Typer(add_completion=False)
    app.command()(main)
    execute(app, "python scripts/run.py")
