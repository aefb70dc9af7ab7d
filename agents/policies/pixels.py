"""A policy that looks at pictures, in NumPy: what ``learning.pixel_policy`` computes, without PyTorch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...envs.pixels import OBSERVATIONS, Shown
from .base import Actions, Observation, StatelessPolicy
from .layout import Layout, layout_of
from .network import MOST_HIDDEN, NetworkPolicy, shapes
from .weights import LEARNED, PolicyFileError, Weights, check_weights, whole

FORMAT = "fieldgym-pixel-policy-1"
STRIDE, WIDE, NARROW = 3, 5, 3
"""Step of the first convolution, and widths of both: the second one steps by one, with a rim of zeros."""
_MOST_CHANNELS, _MOST_MARKS = 256, 8


def features_of(channels: int, marks: int) -> int:
    """Numbers of a candidate: whether it is shown, and for each of its marks what is seen there and where it is."""
    return 1 + marks * (channels + 2)


def eye_shapes(channels: int) -> dict[str, tuple[int, ...]]:
    """Names and shapes of the weights that look at pictures."""
    half = channels // 2
    return {
        "first.weight": (half, 3, WIDE, WIDE),
        "first.bias": (half,),
        "second.weight": (channels, half, NARROW, NARROW),
        "second.bias": (channels,),
    }


class PixelPolicy(StatelessPolicy):
    """A trained policy that sees candidates in pictures: the most probable possible action.

    Two convolutions look at the picture; what they see under a slot's marks, and where those are, are the numbers of
    its candidate for a set policy. Where observations hold no pictures of its size, it draws its own.

    Attributes:
        name: of the policy in tables.
        card: what is known of it.
        weights: plain arrays by name.
    """

    def __init__(
        self,
        layout: Layout,
        hidden: int,
        weights: Weights,
        card: Mapping[str, Any],
        name: str = LEARNED,
        *,
        channels: int,
        rows: int,
        relations: int = 0,
    ):
        """Take checked weights.

        Raises:
            PolicyFileError: a weight is missing, of the wrong shape or type, or not finite.
        """
        eyes = eye_shapes(channels)
        check_weights(weights, eyes | shapes(layout, hidden, relations))
        self.name, self.card, self.weights = name, dict(card), weights
        self.channels, self.rows = channels, rows
        rest = {key: values for key, values in weights.items() if key not in eyes}
        self._decides = NetworkPolicy(layout, hidden, rest, {}, relations=relations)
        self._draws: Any = None
        self._marks = np.zeros((0, 1), np.int64)

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        seen = self._draws.observe(dict(observation), None) if self._draws else observation
        table = self.table(seen["pixels"], seen["slots"][..., 0])
        known = {"machine": observation["machine"], "action_mask": observation["action_mask"], "candidates": table}
        return self._decides.act(known)

    def table(self, pixels: NDArray[np.uint8], slots: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Candidates' numbers (B, K F) of pictures (B, h, w, 3) and their marks (B, h, w)."""
        light: Any = pixels.astype(np.float32) / np.float32(127.5) - np.float32(1.0)
        code = self._convolved(light, "first", STRIDE)
        code = self._convolved(np.pad(code, ((0, 0), (1, 1), (1, 1), (0, 0))), "second", 1)
        b, down, across, channels = code.shape
        _, height, width = slots.shape
        most = int(self._marks.max())
        world, y, x = np.nonzero(slots)
        mark = world * most + slots[world, y, x] - 1
        cell = (world * down + np.minimum(y // STRIDE, down - 1)) * across + np.minimum(x // STRIDE, across - 1)
        each = np.bincount(mark, minlength=b * most).astype(np.float32)[:, None]
        seen: Any = np.zeros((b * most, channels + 2), np.float32)
        place = np.stack([2.0 * x / (width - 1.0) - 1.0, 2.0 * y / (height - 1.0) - 1.0], axis=-1)
        np.add.at(seen, mark, np.hstack([code.reshape(-1, channels)[cell], place.astype(np.float32)]))
        seen /= np.maximum(each, 1.0)
        there: Any = (each > 0.0).reshape(b, most)[:, self._marks - 1].any(axis=2).astype(np.float32)
        own: Any = seen.reshape(b, most, -1)[:, self._marks - 1].reshape(b, len(self._marks), -1)
        return np.concatenate([there[..., None], own], axis=2).reshape(b, -1)

    def _convolved(self, code: NDArray[np.float32], layer: str, stride: int) -> NDArray[np.float32]:
        weight: Any = self.weights[f"{layer}.weight"]
        out, into, width, _ = weight.shape
        windows = np.lib.stride_tricks.sliding_window_view(code, (width, width), (1, 2))[:, ::stride, ::stride]
        b, down, across = windows.shape[:3]
        product: Any = windows.reshape(b * down * across, into * width * width) @ weight.reshape(out, -1).T
        return np.maximum(product + self.weights[f"{layer}.bias"], np.float32(0.0)).reshape(b, down, across, out)

    @classmethod
    def of(cls, card: Mapping[str, Any], weights: Weights, name: str) -> PixelPolicy:
        """From what a file holds.

        Raises:
            PolicyFileError: the card's sizes or the weights cannot be used.
        """
        try:
            sizes = {key: whole(card.get(key, 0), key) for key in ("hidden", "relations", "channels", "rows")}
            layout = Layout(**{str(key): whole(value, key) for key, value in card["layout"].items()})
            Shown.checked("pixels", sizes["rows"], False, True)
        except (TypeError, AttributeError, ValueError, KeyError) as error:
            raise PolicyFileError(f"its card's layout cannot be used ({error})") from None
        fits = 1 <= sizes["hidden"] <= MOST_HIDDEN and 0 <= sizes["relations"] <= MOST_HIDDEN
        marks, rest = divmod(layout.features - 1, sizes["channels"] + 2)
        if not (fits and 2 <= sizes["channels"] <= _MOST_CHANNELS and 1 <= marks <= _MOST_MARKS) or rest:
            raise PolicyFileError(f"its card's sizes {sizes} or layout are out of range")
        hidden = sizes.pop("hidden")
        return cls(layout, hidden, weights, card, name, **sizes)

    @property
    def head(self) -> dict[str, Any]:
        """What a card has to say for the weights to be read."""
        decides = {name: value for name, value in self._decides.head.items() if name != "format"}
        return {"format": FORMAT, **decides, "channels": self.channels, "rows": self.rows}

    def fitted(self, env: Any) -> PixelPolicy:
        """The policy for an environment, whose pictures it draws itself where they are not observed.

        Raises:
            PolicyFileError: the environment's sizes are others.
        """
        native, mine = env.unwrapped, self._decides.layout
        layout = replace(layout_of(env), features=mine.features)
        if replace(mine, candidates=layout.candidates) != layout:
            raise PolicyFileError(f"it was made for {mine}, this environment has {layout}")
        one = PixelPolicy(
            layout,
            self._decides.hidden,
            self.weights,
            self.card,
            self.name,
            channels=self.channels,
            rows=self.rows,
            relations=self._decides.relations,
        )
        drawer = native.drawer(Shown(OBSERVATIONS[-1], self.rows))
        one._marks = drawer.marks
        if not native.shown.draws or native.shown.rows != self.rows:
            one._draws = drawer
        if one._marks.shape[0] != layout.candidates or features_of(self.channels, one._marks.shape[1]) != mine.features:
            raise PolicyFileError(f"it was made for other marks than this environment's {one._marks.shape}")
        return one
