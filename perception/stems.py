"""Stems by a small learned network: where leaves leave a stem, whose plant it is, and how sure that is.

A fully convolutional network looks at a picture in three sizes and says of every place of the half-sized one how likely
a weed's or a crop plant's stem lies there, how far beside its middle, and of which kind the weed is. Its weights are
plain arrays, trained by ``scripts/train_weed_eyes.py`` on rendered pictures; here they are only used.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled
from .convolutions import Planes, add_cut, apart, colours_apart, concluded, each, halving, mixed
from .frames import Frame
from .weeds import MIDDLE_ROW, Array, Rows, Seedlings, WeedSettings, on_plane

Weights = Mapping[str, NDArray[np.float32]]

REACHES = (1, 2, 4, 8, 4, 2, 1)
"""Of the taps of the blocks that see a plant as a whole, at a quarter of the picture's size."""
MIDDLE, SPREAD = 76.5, 51.0
"""Of a byte of a picture, as the network takes it."""
WEED, CROP, OFFSET_X, OFFSET_Y, FIRST_KIND = 0, 1, 2, 3, 4
"""What the planes of the network's answer say: odds of a stem as logarithms, where beside the middle, and kinds."""
STAGES = 3
KINDS = 6
"""Of weeds: ``3 species + stage``."""
ANSWERS = FIRST_KIND + KINDS


@dataclass(frozen=True)
class StemSettings:
    """How stems are picked from what the network says.

    Attributes:
        likely: from this probability on a place is told of as a weed's stem.
        crop_likely: the same for crop plants.
        apart_cells: of two stems of weeds that are nearer, in places of the half-sized picture, the likelier one stays.
        crop_apart_cells: the same for crop plants.
        row_half_m: crop plants stand within this distance of a row's middle.
        crop_m: height at which a crop plant's leaves leave its stem.
    """

    likely: float = 0.15
    crop_likely: float = 0.3
    apart_cells: float = 1.6
    crop_apart_cells: float = 8.0
    row_half_m: float = 0.05
    crop_m: float = 0.02


class Stems(NamedTuple):
    """Stems of one picture, n of them, the likeliest first.

    Attributes:
        pixel: (n, 2), column and row.
        kind: (n,), ``3 species + stage``; of crop plants without meaning.
        score: (n,), probability.
    """

    pixel: Array
    kind: NDArray[np.int64]
    score: Array


class StemNet:
    """The network with its weights.

    Attributes:
        weights: plain arrays by name.
    """

    def __init__(self, weights: Weights):
        """Take weights.

        Raises:
            ValueError: one is missing, unknown, of another shape, or not finite.
        """
        self.weights = {name: np.ascontiguousarray(values, np.float32) for name, values in weights.items()}
        widths = [len(self.weights.get(f"{name}.bias", ())) for name in ("first", "second", "up", "head")]
        wanted = shapes(*widths)
        if set(wanted) != set(self.weights):
            odd = sorted(set(wanted) ^ set(self.weights))
            raise ValueError(f"the weights {', '.join(map(repr, odd[:4]))} are missing or unknown: fetch it again")
        for name, shape in wanted.items():
            values = self.weights[name]
            if values.shape != shape or not np.isfinite(values).all():
                raise ValueError(f"weight {name!r} is {values.shape}, wanted finite {shape}: fetch the file again")

    def answers(self, rgb: NDArray[np.uint8]) -> Planes:
        """What the network says of a picture (h, w, 3) whose sides are multiples of four: (10, h / 2, w / 2)."""
        w = self.weights
        fine = halving(*colours_apart(rgb, MIDDLE, SPREAD), w["first.weight"], w["first.bias"])
        coarse = halving(*apart(fine), w["second.weight"], w["second.bias"])
        size, places = coarse.shape, (len(coarse), -1)
        sums = coarse.reshape(places)
        for k, reach in enumerate(REACHES):
            seen = each(sums.reshape(size), w[f"look{k}.weight"], reach)
            add_cut(sums, mixed(seen.reshape(places), w[f"mix{k}.weight"], w[f"mix{k}.bias"]))
        told = mixed(sums, w["up.weight"], w["up.bias"])
        last = (w[name] for name in ("near.weight", "head.weight", "head.bias", "answer.weight", "answer.bias"))
        return concluded(told.reshape(-1, *size[1:]), fine, *last)


def shapes(first: int, second: int, up: int, head: int) -> dict[str, tuple[int, ...]]:
    """Names and shapes of a network's weights, from the widths of its layers."""
    wanted: dict[str, tuple[int, ...]] = {
        "first.weight": (first, 3, 3, 3),
        "first.bias": (first,),
        "second.weight": (second, first, 3, 3),
        "second.bias": (second,),
        "up.weight": (up, second),
        "up.bias": (up,),
        "near.weight": (up + first, 3, 3),
        "head.weight": (head, up + first),
        "head.bias": (head,),
        "answer.weight": (ANSWERS, head),
        "answer.bias": (ANSWERS,),
    }
    for k in range(len(REACHES)):
        wanted |= {f"look{k}.weight": (second, 3, 3), f"mix{k}.weight": (second, second), f"mix{k}.bias": (second,)}
    return wanted


def stems_in(answers: Planes, plane: int, likely: float, apart_cells: float) -> Stems:
    """Stems that a plane of a network's answer tells of.

    Args:
        answers: (10, h, w).
        plane: ``WEED`` or ``CROP``.
        likely: smallest probability.
        apart_cells: of two that are nearer the likelier one stays.
    """
    found = _peaks(answers, plane, math.log(likely / (1.0 - likely)))
    found = found[np.argsort(-found[:, 2], kind="stable")]
    found = found[_alone(found, apart_cells)]
    # The middle of a place of the half-sized picture lies between two pixels.
    return Stems(2.0 * found[:, :2] + 0.5, found[:, 3].astype(np.int64), 1.0 / (1.0 + np.exp(-found[:, 2])))


@compiled
def _peaks(answers: Planes, plane: int, least: float) -> Array:
    """Places (n, 4) whose odds no neighbour's exceed: column and row with their offset, logarithm of odds, kind."""
    odds = answers[plane]
    height, width = odds.shape
    room = 0
    for y in range(height):
        for x in range(width):
            room += odds[y, x] > least
    found = np.empty((room, 4))
    count = 0
    for y in range(height):
        for x in range(width):
            value = odds[y, x]
            if not value > least:
                continue
            highest = True
            for v in range(max(y - 1, 0), min(y + 2, height)):
                for u in range(max(x - 1, 0), min(x + 2, width)):
                    # Of equals the first one.
                    if odds[v, u] > value or (odds[v, u] == value and (v < y or (v == y and u < x))):
                        highest = False
            if not highest:
                continue
            kind = 0
            for k in range(1, KINDS):
                if answers[FIRST_KIND + k, y, x] > answers[FIRST_KIND + kind, y, x]:
                    kind = k
            found[count, 0] = x + min(max(answers[OFFSET_X, y, x], -2.0), 2.0)
            found[count, 1] = y + min(max(answers[OFFSET_Y, y, x], -2.0), 2.0)
            found[count, 2], found[count, 3] = value, kind
            count += 1
    return found[:count]


@compiled
def _alone(found: Array, apart_cells: float) -> NDArray[np.bool_]:
    """Which of the places (n, 4), the likeliest first, are not too near to a likelier one that stays."""
    stays = np.ones(len(found), np.bool_)
    for i in range(len(found)):
        for j in range(i):
            if stays[j] and np.hypot(found[i, 0] - found[j, 0], found[i, 1] - found[j, 1]) < apart_cells:
                stays[i] = False
    return stays


def detect(net: StemNet, frame: Frame, context: Rows = MIDDLE_ROW, settings: StemSettings | None = None) -> Seedlings:
    """Stems of weeds and crop plants in a picture from above.

    Args:
        net: trained for this camera.
        frame: a picture whose sides are multiples of four; its depth is not looked at, the ground is a plane.
        context: the crop rows under it.
        settings: thresholds.
    """
    rgb, _, (intrinsics, world_from_camera) = frame
    chosen = settings or StemSettings()
    answers = net.answers(rgb)
    weed = stems_in(answers, WEED, chosen.likely, chosen.apart_cells)
    crop = stems_in(answers, CROP, chosen.crop_likely, chosen.crop_apart_cells)
    pixel = np.concatenate([weed.pixel, crop.pixel])
    species, stage = np.divmod(np.concatenate([weed.kind, np.zeros_like(crop.kind)]), STAGES)
    is_crop = np.arange(len(pixel)) >= len(weed.pixel)
    height = np.where(is_crop, chosen.crop_m, np.array(WeedSettings.stem_m)[species, stage])
    position = on_plane(pixel, intrinsics, world_from_camera, height)
    beside = np.abs(position[:, 1:] - np.array(context.across_m)).min(axis=1)
    kept = ~is_crop | (beside <= chosen.row_half_m)
    score = np.concatenate([weed.score, crop.score])
    half = np.where(is_crop, 20, np.array([[6, 10, 16], [8, 12, 18]])[species, stage])
    box = np.column_stack([np.rint(pixel).astype(np.int64) - half[:, None], 2 * half, 2 * half])
    return Seedlings(position[kept], species[kept], stage[kept], is_crop[kept], box[kept], score[kept])
