"""What the weeders' pictures are like: a sheet of frames with truth and detections, and figures beside real data sets.

python scripts/weed_pictures.py sheet [--pictures field] [--eyes learned] [--out docs/weed-pictures.jpg]
python scripts/weed_pictures.py figures [--strips 24]
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from fieldgym.envs.weeding.eyes import Eyes, eyes_of, net_of
from fieldgym.perception.frames import Frame
from fieldgym.perception.stems import KINDS, StemSettings, detect
from fieldgym.perception.weeds import Rows, Seedlings
from fieldgym.scripts.weed_lessons import CHOICE_SEED, Lesson, lessons, projected

ACROSS, DOWN = 8, 6
"""Frames of the sheet; the lowest row shows the tool camera's, always with the network's stems."""
ANYWHERE = StemSettings(row_half_m=np.inf)
_TILE_PX = 240, 192
_TRUTH = {"weed": (255, 255, 255), "crop": (60, 220, 255)}
_FOUND = {"weed": (255, 40, 40), "crop": (255, 200, 40)}

app = typer.Typer(add_completion=False)


def marked(lesson: Lesson, found: Seedlings) -> NDArray[np.uint8]:
    """A picture with rings about true stems and crosses on those that were found."""
    high, wide, _ = lesson.rgb.shape
    scale = min(_TILE_PX[0] / wide, _TILE_PX[1] / high)
    size = round(wide * scale), round(high * scale)
    shown = cv2.resize(lesson.rgb, size, interpolation=cv2.INTER_AREA)
    tile = np.zeros((_TILE_PX[1], _TILE_PX[0], 3), np.uint8)
    for (x, y), kind in zip(lesson.stem, lesson.kind.tolist(), strict=True):
        colour = _TRUTH["crop" if kind == KINDS else "weed"]
        cv2.circle(shown, (round(x * scale), round(y * scale)), 6, colour, 1, cv2.LINE_AA)
    for position, crop in zip(found.position, found.crop.tolist(), strict=True):
        x, y = (round(float(v) * scale) for v in position)
        cv2.drawMarker(shown, (x, y), _FOUND["crop" if crop else "weed"], cv2.MARKER_TILTED_CROSS, 6, 1)
    left, top = (_TILE_PX[0] - size[0]) // 2, (_TILE_PX[1] - size[1]) // 2
    tile[top : top + size[1], left : left + size[0]] = shown
    return tile


def in_pixels(found: Seedlings, frame: Frame) -> Seedlings:
    """Places on the ground as columns and rows of the frame."""
    places = np.column_stack([found.position, np.full(len(found.position), 0.008)])
    return found._replace(position=projected(places, frame.camera))


def _frames(camera: str, strips: int, pictures: int, kind: str, eyes: Eyes) -> Iterator[NDArray[np.uint8]]:
    for lesson in lessons(camera, strips, pictures, CHOICE_SEED, kind):
        frame = lesson.frame
        found = eyes.front(frame, Rows()) if camera == "front" else detect(net_of("tool"), frame, settings=ANYWHERE)
        yield marked(lesson, in_pixels(found, frame))


@app.command()
def sheet(
    pictures: str = "field",
    eyes: str = "learned",
    out: Annotated[Path, typer.Option(help="A picture's file.")] = Path("docs/weed-pictures.jpg"),
) -> None:
    """48 frames, each of another strip where there are enough, truth as rings and detections as crosses."""
    seen = eyes_of(eyes)
    tiles = [*_frames("front", ACROSS * (DOWN - 1), 1, pictures, seen), *_frames("tool", ACROSS, 1, pictures, seen)]
    rows = [np.concatenate(tiles[i : i + ACROSS], axis=1) for i in range(0, ACROSS * DOWN, ACROSS)]
    cv2.imwrite(str(out), cv2.cvtColor(np.concatenate(rows), cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 80])


def _hue(rgb: NDArray[Any], chosen: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Hues of the chosen pixels, degrees."""
    return 2.0 * cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV)[..., 0][chosen].astype(float)


@app.command()
def figures(strips: int = 24, pictures: Annotated[int, typer.Option(help="Of each strip.")] = 4) -> None:
    """Vegetation, sizes, hues and neighbours, for both kinds of pictures."""
    table = Table("figure", "easy", "field")
    columns = [_figures(list(lessons("front", strips, pictures, CHOICE_SEED, kind))) for kind in ("easy", "field")]
    for name in columns[0]:
        table.add_row(name, *(column[name] for column in columns))
    Console(width=110).print(table)


def _figures(data: list[Lesson]) -> dict[str, str]:
    """Figures of pictures, as they are printed."""

    def spread(values: Any, form: str = ".1f") -> str:
        return " / ".join(f"{value:{form}}" for value in np.percentile(np.asarray(values, float), [10, 50, 90]))

    share, weeds, gaps, hue_plant, hue_soil, green_plant, green_soil, light = [], [], [], [], [], [], [], []
    sizes: dict[int, list[int]] = {kind: [] for kind in range(KINDS + 1)}
    for one in data:
        plant = one.owner > 0
        share.append(100.0 * plant.mean())
        weeds.append(int((one.kind < KINDS).sum()))
        hue_plant.append(_hue(one.rgb, plant))
        hue_soil.append(_hue(one.rgb, ~plant))
        colours = one.rgb.astype(float)
        index = (2.0 * colours[..., 1] - colours[..., 0] - colours[..., 2]) / np.maximum(colours.sum(axis=-1), 30.0)
        green_plant.append(100.0 * (index[plant] > 0.14).mean() if plant.any() else 0.0)
        green_soil.append(100.0 * (index[~plant] > 0.14).mean())
        light.append(colours[~plant].mean())
        weed = one.stem[one.kind < KINDS]
        if len(weed) > 1:
            apart = np.hypot(*(weed[:, None] - weed[None]).transpose(2, 0, 1)) + np.diag(np.full(len(weed), np.inf))
            gaps += apart.min(axis=1).tolist()
        for kind, size in zip(one.kind.tolist(), one.size_px.tolist(), strict=True):
            if size:
                sizes[kind].append(size)
    names = [f"{s} {g}" for s in ("broadleaf", "grass") for g in ("cotyledon", "two-leaf", "four-leaf")]
    told = {
        "vegetation, % of the picture": spread(share),
        "weeds a picture": spread(weeds, ".0f"),
        "to the nearest weed in the picture, pixels": spread(gaps, ".0f"),
        "hue of plants, degrees": spread(np.concatenate(hue_plant), ".0f"),
        "hue of soil, degrees": spread(np.concatenate(hue_soil), ".0f"),
        "plant pixels that excess green takes for plants, % a picture": spread(green_plant),
        "soil pixels that it takes for plants, % a picture": spread(green_soil),
        "brightness of soil, of 255": spread(light, ".0f"),
    }
    for kind, name in enumerate([*names, "crop plant"]):
        told[f"pixels of a {name}"] = spread(sizes[kind] or [np.nan], ".0f")
    every = {"weeds": [size for kind in range(KINDS) for size in sizes[kind]], "crop plants": sizes[KINDS]}
    whole_px = sum(one.owner.size for one in data)
    for name, some in every.items():
        told[f"{name} a picture, mean"] = f"{len(some) / len(data):.1f}"
        told[f"share of the pictures that {name} cover, %"] = f"{100.0 * sum(some) / whole_px:.2f}"
        told[f"of a picture that one of the {name} covers, mean, %"] = (
            f"{100.0 * np.mean(some) * len(data) / whole_px:.3f}"
        )
    return told


if __name__ == "__main__":
    app()
