"""Make the documentation's moving pictures: ``python scripts/moving_pictures.py`` (or ``make media``).

One animated WebP an environment, and one of the four machines, into ``docs/media``; it takes a minute.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer

from fieldgym.wrappers import Filming, Picture

FRAMES_PER_SECOND, WIDE_PX, HIGH_PX = 12, 320, 240
SECONDS = 5.0
QUALITY = 58
"""Of the pictures' compression, 0 to 100."""


class Take(NamedTuple):
    """What is filmed of an environment.

    Attributes:
        label: in the picture.
        policy: decides.
        speed: simulated seconds a second.
        after: decisions that are taken before.
        camera: looks.
        seed: of the field.
    """

    label: str
    policy: str
    speed: float
    after: int
    camera: str = "machine"
    seed: int = 3


TAKES = {
    "SafflowerPicking-v0": Take("safflower picker", "grams-per-second", 12.0, 3),
    "TrayTransplanting-v0": Take("tray transplanter", "learned", 1.0, 6),
    "LaserWeeding-v0": Take("laser weeder", "learned", 1.0, 25),
    "LaserWeedingSpeed-v0": Take("laser weeder, speed chosen", "learned", 1.0, 25, "overview"),
    "HoeWeeding-v0": Take("hoe weeder", "learned", 1.0, 25),
    "ProduceSorting-v0": Take("produce sorter", "learned", 1.0, 6),
}
MACHINES = ("SafflowerPicking-v0", "TrayTransplanting-v0", "LaserWeeding-v0", "ProduceSorting-v0")
"""One environment for each of the four mechanisms."""


def main(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where the pictures go.")] = Path("docs/media"),
    only: Annotated[
        str | None, typer.Option(metavar="NAME", help="One environment, and not the four machines.")
    ] = None,
) -> None:
    """Film the machines at work and write the documentation's moving pictures."""
    out.mkdir(parents=True, exist_ok=True)
    films = {name: shot(name, take) for name, take in TAKES.items() if only in (None, name)}
    for name, frames in films.items():
        write(out / f"{slug(name)}.webp", frames)
    if only is None:
        write(out / "machines.webp", beside([films[name] for name in MACHINES]))


def slug(name: str) -> str:
    """The name of an environment's page, ``hoe-weeding`` of ``HoeWeeding-v0``."""
    return "-".join(re.findall("[A-Z][a-z]+", name)).lower()


def shot(name: str, take: Take, count: int = round(SECONDS * FRAMES_PER_SECOND)) -> list[Picture]:
    """Frames (240, 320, 3) of an environment: its machine in the middle of its work."""
    import gymnasium as gym

    from fieldgym.agents import make_policy
    from fieldgym.agents.policies.base import act_single

    options: dict[str, Any] = {"camera": take.camera, "width": 2 * WIDE_PX, "height": 2 * HIGH_PX}
    env = gym.make(f"fieldgym/{name}", backend="analytic", render_mode="rgb_array", **options)
    policy = make_policy(take.policy, env, 1)
    observation, info = env.reset(seed=take.seed)
    policy.reset(np.ones(1, bool))
    frames: list[Picture] = []
    filming: Filming | None = None
    decided = 0
    while len(frames) < count:
        if decided == take.after:
            filming = Filming(env, frames.append, FRAMES_PER_SECOND / take.speed, "", info["scorecard"])
        observation, _, terminated, truncated, info = env.step(act_single(policy, observation))
        decided += 1
        if filming is not None:
            filming.took(info)
        if terminated or truncated:
            raise RuntimeError(f"{name}: seed {take.seed} is over before {count} frames; film from earlier on")
    env.close()
    told = f"{take.label}, {take.speed:g} times as fast" if take.speed != 1.0 else take.label
    return [labelled(frame, told) for frame in frames[:count]]


def labelled(frame: Picture, label: str) -> Picture:
    """A frame at half its size with a name in its lower left corner."""
    import cv2

    small = np.asarray(cv2.resize(frame, (WIDE_PX, HIGH_PX), interpolation=cv2.INTER_AREA), np.uint8)
    (long, _), _ = cv2.getTextSize(label, cv2.FONT_HERSHEY_SIMPLEX, 0.42, 1)
    panel = small[HIGH_PX - 20 :, : long + 14]
    panel[:] = (0.35 * panel).astype(np.uint8)
    foot = (7, HIGH_PX - 6)
    cv2.putText(small, label, foot, cv2.FONT_HERSHEY_SIMPLEX, 0.42, (245, 245, 245), 1, cv2.LINE_AA)
    return small


def beside(films: list[list[Picture]]) -> list[Picture]:
    """Four films as one, two above two."""
    frames = []
    for a, b, c, d in zip(*films, strict=True):
        frames.append(np.concatenate([np.concatenate([a, b], axis=1), np.concatenate([c, d], axis=1)]))
    return frames


def write(path: Path, frames: list[Picture]) -> None:
    """An animated WebP that begins anew for ever."""
    from PIL import Image

    first, *others = [Image.fromarray(frame) for frame in frames]
    lasts_ms = round(1000 / FRAMES_PER_SECOND)
    first.save(path, save_all=True, append_images=others, quality=QUALITY, method=5, duration=lasts_ms, loop=0)
    typer.echo(f"Written: {path} ({path.stat().st_size / 1e6:.2f} MB, {len(frames)} frames)")


if __name__ == "__main__":
    typer.run(main)
