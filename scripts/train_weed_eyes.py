"""Train the networks behind ``eyes="learned"`` on rendered pictures: ten minutes each on one core.

    python scripts/train_weed_eyes.py front --out assets/perception
    python scripts/train_weed_eyes.py tool --out assets/perception

PyTorch (the extra ``rl``) is needed here alone; the package computes with the written arrays. While a network learns,
its layers are normalised over each batch (without that the blocks of one channel each hardly learn at all); what the
normalisation has become goes into the written weights, so that nothing of it is left to compute. The pictures are those
of strips that nothing else uses (``weed_lessons.py``). They are taken as they are, neither mirrored nor turned: the sun
stands where it stands, and which side of a blade is bright says which way it rises. The colours of every plant are
changed by some percent, so that a network does not come to rely on what a renderer's palette happens to be.
"""

from __future__ import annotations

import io
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple, cast

import numpy as np
import torch
import torch.nn.functional as F
import typer
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from fieldgym.kernels import compiled
from fieldgym.kernels.files import replace_file
from fieldgym.perception.stems import (
    ANSWERS,
    CROP,
    FIRST_KIND,
    KINDS,
    MIDDLE,
    OFFSET_X,
    REACHES,
    SPREAD,
    WEED,
    StemNet,
    StemSettings,
    stems_in,
)
from fieldgym.scripts.weed_lessons import CHOICE_SEED, FIRST_SEED, Lesson, lessons, one_of

SIZE_PX = {"front": 128, "tool": 96}
"""Sides of what is cut out of a picture."""
BATCH = {"front": 8, "tool": 12}
COLOUR, SOIL_COLOUR = 0.12, 0.05
"""Deviation of the factors (as logarithms) on the three colours of a plant and of the ground, in half of the cuts."""
_SIGMA_CELLS = (1.0, 1.5)
_WINDOW = 5
_WARM = 200
KIND_SHARE = (1.2, 1.0, 0.7, 1.6, 2.5, 1.0)
"""How often a cut is about a weed of each kind, of those in a picture: what is lost most often, more often."""
_AVERAGED_EVERY, _KEPT_SHARE = 10, 0.99
"""What is written is an average: every so many steps this share of the old one is kept, which spans 1,000 steps."""
_HIT_CELLS = 2.4
"""A stem counts as found within this distance, places of the half-sized picture (6 and 4 mm)."""


class Net(nn.Module):
    """What ``perception.stems.StemNet`` computes, for training; names and widths of the layers are the same."""

    def __init__(self, first: int = 12, second: int = 40, up: int = 16, head: int = 24):
        """Make the layers."""
        super().__init__()
        self.first = nn.Conv2d(3, first, 3, 2, 1, bias=False)
        self.second = nn.Conv2d(first, second, 3, 2, 1, bias=False)
        for k, reach in enumerate(REACHES):
            self.add_module(f"look{k}", nn.Conv2d(second, second, 3, 1, reach, reach, second, bias=False))
            self.add_module(f"mix{k}", nn.Conv2d(second, second, 1, bias=False))
        self.up = nn.Conv2d(second, up, 1)
        self.near = nn.Conv2d(up + first, up + first, 3, 1, 1, 1, up + first, bias=False)
        self.head, self.answer = nn.Conv2d(up + first, head, 1, bias=False), nn.Conv2d(head, ANSWERS, 1)
        widths = {"first": first, "second": second, "head": head} | {f"mix{k}": second for k in range(len(REACHES))}
        self.norm = nn.ModuleDict({name: nn.BatchNorm2d(width) for name, width in widths.items()})
        nn.init.constant_(self.answer.bias[:2], -4.0)  # type: ignore[index]

    def _cut(self, name: str, x: Tensor) -> Tensor:
        """A layer of this name with its norm, negative values cut."""
        return F.relu(self.norm[name](self.get_submodule(name)(x)), inplace=True)

    def forward(self, x: Tensor) -> Tensor:
        """Answers (b, 10, h / 2, w / 2) on pictures (b, 3, h, w)."""
        fine = self._cut("first", x)
        sums = self._cut("second", fine)
        for k in range(len(REACHES)):
            sums = sums + self._cut(f"mix{k}", self.get_submodule(f"look{k}")(sums))
        told = F.interpolate(self.up(sums), scale_factor=2, mode="bilinear", align_corners=False)
        return self.answer(self._cut("head", self.near(torch.cat([told, fine], 1))))

    def weights(self) -> dict[str, NDArray[np.float32]]:
        """Plain arrays, as ``StemNet`` takes them, with what the norms do on average put into the layers before."""
        state = {name: values.detach().numpy().astype(float) for name, values in self.state_dict().items()}
        plain = {name: values for name, values in state.items() if not name.startswith("norm.")}
        for name, norm in self.norm.items():
            mean, variance, scale, shift = (
                state[f"norm.{name}.{part}"] for part in ("running_mean", "running_var", "weight", "bias")
            )
            factor = scale / np.sqrt(variance + norm.eps)  # type: ignore[operator]
            plain[f"{name}.weight"] = plain[f"{name}.weight"] * factor[:, None, None, None]
            plain[f"{name}.bias"] = shift - mean * factor
        for name, values in plain.items():
            if values.shape[2:] == (1, 1):
                plain[name] = values[:, :, 0, 0]
            elif values.ndim == 4 and values.shape[1] == 1:
                plain[name] = values[:, 0]
        return {name: values.astype(np.float32) for name, values in plain.items()}


class Sheet(NamedTuple):
    """What is wanted of a cut of a picture, on its half-sized grid.

    Attributes:
        odds: (2, h, w), one where a stem lies, falling off around it.
        here: (2, h, w) bool, the places nearest to stems.
        offset: (2, h, w), from a place to the weed's stem that it belongs to, in places.
        kind: (h, w), of that weed; -1 where none is near.
    """

    odds: NDArray[np.float32]
    here: NDArray[np.bool_]
    offset: NDArray[np.float32]
    kind: NDArray[np.int64]


@compiled
def sheet_of(high: int, wide: int, stem: NDArray[np.float64], kind: NDArray[np.int64]) -> Sheet:
    """Draw stems (n, 2), in pixels of the cut."""
    odds, here = np.zeros((2, high, wide), np.float32), np.zeros((2, high, wide), np.bool_)
    offset, kinds = np.zeros((2, high, wide), np.float32), np.full((high, wide), -1)
    gap = np.full((high, wide), np.inf)
    for i in range(len(stem)):
        plane, sigma = (CROP, _SIGMA_CELLS[CROP]) if kind[i] == KINDS else (WEED, _SIGMA_CELLS[WEED])
        u, v = (stem[i, 0] - 0.5) / 2.0, (stem[i, 1] - 0.5) / 2.0
        column, row = int(np.rint(u)), int(np.rint(v))
        for y in range(max(row - _WINDOW, 0), min(row + _WINDOW + 1, high)):
            for x in range(max(column - _WINDOW, 0), min(column + _WINDOW + 1, wide)):
                square = (x - u) ** 2 + (y - v) ** 2
                odds[plane, y, x] = max(odds[plane, y, x], np.exp(-square / (2.0 * sigma**2)))
                # Every place belongs to the stem that is nearest to it.
                if plane == WEED and square < gap[y, x] and max(abs(x - u), abs(y - v)) <= 1.5:
                    gap[y, x], kinds[y, x] = square, kind[i]
                    offset[0, y, x], offset[1, y, x] = u - x, v - y
        if 0 <= row < high and 0 <= column < wide:
            here[plane, row, column] = True
    for plane in range(2):
        for y in range(high):
            for x in range(wide):
                if here[plane, y, x]:
                    odds[plane, y, x] = 1.0
    return Sheet(odds, here, offset, kinds)


def coloured(lesson: Lesson, rng: np.random.Generator) -> NDArray[np.float32]:
    """A picture in which every plant has colours of its own, (h, w, 3)."""
    factor = np.exp(rng.normal(0.0, COLOUR, (256, 3))).astype(np.float32)
    factor[0] = np.exp(rng.normal(0.0, SOIL_COLOUR, 3))
    return np.clip(lesson.rgb * factor[lesson.owner], 0.0, 255.0)


def cut(lesson: Lesson, size: int, rng: np.random.Generator) -> tuple[NDArray[np.float32], Sheet]:
    """A part of a picture, (3, size, size) as the network takes it, with a weed in it where there is one."""
    high, wide, _ = lesson.rgb.shape
    inside = (lesson.kind < KINDS) & np.all((lesson.stem >= 0.0) & (lesson.stem < [wide, high]), axis=1)
    about = one_of(lesson.kind, inside, rng, KIND_SHARE) if inside.any() else None
    u, v = rng.uniform([0, 0], [wide, high]) if about is None else lesson.stem[about]
    x, y = (int(np.clip(at - rng.integers(size), 0, most - size)) for at, most in ((u, wide), (v, high)))
    window = np.s_[y : y + size, x : x + size]
    part = lesson._replace(rgb=lesson.rgb[window], owner=lesson.owner[window])
    picture = coloured(part, rng) if rng.random() < 0.5 else part.rgb.astype(np.float32)
    sheet = sheet_of(size // 2, size // 2, lesson.stem - [x, y], lesson.kind)
    return np.ascontiguousarray((picture.transpose(2, 0, 1) - MIDDLE) / SPREAD, np.float32), sheet


def loss_of(answers: Tensor, sheets: Sequence[Sheet]) -> Tensor:
    """Focal loss of the stems (Law and Deng 2018, CornerNet), with offsets and kinds of weeds about them."""

    def stacked(name: str) -> Tensor:
        return torch.from_numpy(np.stack([getattr(sheet, name) for sheet in sheets]))

    odds, here, wanted = answers[:, :2], stacked("here"), stacked("odds")
    log, log_not = F.logsigmoid(odds), F.logsigmoid(-odds)
    chance = torch.exp(log)
    focal = torch.where(here, (1.0 - chance) ** 2 * log, (1.0 - wanted) ** 4 * chance**2 * log_not)
    loss = -focal.sum() / here.sum().clamp(min=1)
    kind = stacked("kind")
    image, row, column = torch.nonzero(kind >= 0, as_tuple=True)
    if len(image):
        there = answers[image, :, row, column]
        off = there[:, OFFSET_X : OFFSET_X + 2] - stacked("offset")[image, :, row, column]
        loss = loss + 0.5 * off.abs().mean() + 0.3 * F.cross_entropy(there[:, FIRST_KIND:], kind[image, row, column])
    return loss


def train(data: Sequence[Lesson], camera: str, steps: int, rate: float, net: Net, seed: int, keep: Path) -> list[float]:
    """So many steps; gives the mean loss of every tenth of them, after which the weights are kept each time."""
    size, batch, rng = SIZE_PX[camera], BATCH[camera], np.random.default_rng(seed)
    optimiser = torch.optim.AdamW(net.parameters(), rate, weight_decay=1e-3)
    average = AveragedModel(net, multi_avg_fn=get_ema_multi_avg_fn(_KEPT_SHARE), use_buffers=True)
    kept = cast(Net, average.module)
    losses, began = [], time.thread_time()
    net.train()
    for step in range(steps):
        for group in optimiser.param_groups:
            group["lr"] = rate * min(1.0, (step + 1) / _WARM) * 0.5 * (1.0 + np.cos(np.pi * step / steps))
        cuts = [cut(data[int(rng.integers(len(data)))], size, rng) for _ in range(batch)]
        pictures = torch.from_numpy(np.stack([picture for picture, _ in cuts]))
        loss = loss_of(net(pictures.contiguous(memory_format=torch.channels_last)), [sheet for _, sheet in cuts])
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 5.0)
        optimiser.step()
        losses.append(loss.item())
        if step % _AVERAGED_EVERY == 0:
            average.update_parameters(net)
        if (step + 1) % max(steps // 10, 1) == 0:
            spent = time.thread_time() - began
            print(f"{step + 1:6d} {spent:6.0f} s  loss {np.mean(losses[-max(steps // 10, 1) :]):.3f}", flush=True)
            write(keep, kept.weights())
            torch.save(kept.state_dict(), keep.with_suffix(".pt"))
    net.load_state_dict(kept.state_dict())
    return [float(np.mean(part)) for part in np.array_split(losses, 10) if len(part)]


def write(path: Path, weights: dict[str, NDArray[np.float32]]) -> None:
    """Keep plain arrays in a file, ``.npz``."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **weights)  # type: ignore[arg-type]
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, buffer.getvalue())


def looked_at(net: StemNet, data: Sequence[Lesson]) -> dict[str, Any]:
    """Weeds of pictures that a network has not seen: found, rightly told of, how far off in half-sized places."""
    settings = StemSettings()
    truth, found, told, true, right, off = 0, 0, 0, 0, 0, []
    for lesson in data:
        high, wide, _ = lesson.rgb.shape

        def inside(places: NDArray[np.float64], by: float, size: tuple[int, int] = (wide, high)) -> NDArray[np.bool_]:
            return np.all((places >= by) & (places < np.array(size) - by), axis=1)

        weed = lesson.kind < KINDS
        stems = stems_in(net.answers(lesson.rgb), WEED, 0.3, settings.apart_cells)
        gap = np.hypot(*(stems.pixel[:, None] - lesson.stem[weed][None]).transpose(2, 0, 1)) / 2.0
        gap = np.vstack([gap, np.full((1, gap.shape[1]), np.inf)])
        asked, counted = inside(lesson.stem[weed], 4.0), inside(stems.pixel, 4.0)
        hit = asked & (gap.min(axis=0) < _HIT_CELLS)
        truth, told, found = truth + int(asked.sum()), told + int(counted.sum()), found + int(hit.sum())
        true += int((counted & (gap[:-1].min(axis=1, initial=np.inf) < _HIT_CELLS)).sum())
        right += int((stems.kind[gap.argmin(axis=0)[hit]] == lesson.kind[weed][hit]).sum())
        off += gap.min(axis=0)[hit].tolist()
    return {
        "pictures": len(data),
        "weeds": truth,
        "recall": round(found / max(truth, 1), 3),
        "precision": round(true / max(told, 1), 3),
        "kind_right": round(right / max(found, 1), 3),
        "off_cells_50_90": [round(float(v), 3) for v in np.percentile(off or [0.0], [50, 90])],
    }


def main(
    camera: Annotated[str, typer.Argument(help="front or tool.")],
    out: Annotated[Path, typer.Option(help="Folder of weed-eyes.CAMERA.npz and its card.")] = Path("results"),
    steps: int = 6000,
    rate: Annotated[float, typer.Option(help="Of learning, at its highest.")] = 6e-3,
    strips: int = 120,
    pictures: Annotated[int, typer.Option(help="Of each strip.")] = 30,
    seed: Annotated[int, typer.Option(help="Of weights and cuts.")] = 0,
    kinds: Annotated[str, typer.Option(help="Pictures: easy, field, or easy,field for both in turn.")] = "easy,field",
    begin: Annotated[Path | None, typer.Option(help="Begin with what a run has left, a file .pt.")] = None,
) -> None:
    """Render, train, look, write."""
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    began = time.thread_time()
    data = list(lessons(camera, strips, pictures, FIRST_SEED, kinds.split(",")))
    rendered_s = time.thread_time() - began
    print(f"{len(data)} pictures in {rendered_s:.0f} s", flush=True)
    # With the channels last a step takes two thirds of the time.
    net = Net()
    net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    if begin is not None:
        net.load_state_dict(torch.load(begin, weights_only=True))
    target = out / f"weed-eyes.{camera}.npz"
    curve = train(data, camera, steps, rate, net, seed, target)
    weights = net.weights()
    held_out = {
        kind: looked_at(StemNet(weights), list(lessons(camera, 8, 15, CHOICE_SEED, kind))) for kind in ("easy", "field")
    }
    card = {
        "made_by": f"scripts/train_weed_eyes.py {camera} --steps {steps} --rate {rate} --seed {seed} "
        f"--strips {strips} --pictures {pictures} --kinds {kinds}"
        + ("" if begin is None else f" --begin {begin.name}"),
        "numbers": int(sum(values.size for values in weights.values())),
        "training_strips": [FIRST_SEED, FIRST_SEED + strips - 1],
        "pictures": len(data),
        "steps": steps,
        "cpu_s": round(time.thread_time() - began),
        "loss": [round(value, 3) for value in curve],
        "held_out_strips": [CHOICE_SEED, CHOICE_SEED + 7],
        "held_out": held_out,
    }
    replace_file(target.with_suffix(".json"), json.dumps(card, indent=1) + "\n")
    print(json.dumps(held_out))


if __name__ == "__main__":
    typer.run(main)
