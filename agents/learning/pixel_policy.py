"""A policy network that looks at pictures: two convolutions see the candidates, a set policy chooses among them.

What the convolutions see under a slot's marks is averaged; with where the marks are it is the candidate's numbers for
``set_policy``. No number of the candidates' own reaches the network. PyTorch is imported only here and there.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from sb3_contrib.common.maskable.policies import MaskableMultiInputActorCriticPolicy
from stable_baselines3.common.policies import MultiInputActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

from ..policies.layout import Layout
from ..policies.pixels import NARROW, STRIDE, WIDE, features_of
from .set_policy import SetPolicyBase


class Eyes(nn.Module):
    """Candidates' numbers (B, K F) of pictures; ``policies.pixels.PixelPolicy.table`` computes the same."""

    def __init__(self, marks: NDArray[np.int64], channels: int):
        """Make the layers.

        Args:
            marks: (K, j), of the slots, see ``View.slot_marks``.
            channels: of what is seen at a place.
        """
        super().__init__()
        self.channels, self.most = channels, int(marks.max())
        self.first = nn.Conv2d(3, channels // 2, WIDE, STRIDE)
        self.second = nn.Conv2d(channels // 2, channels, NARROW, 1, 1)
        self.marks: Tensor
        self.register_buffer("marks", torch.from_numpy(marks - 1), persistent=False)

    def forward(self, pixels: Tensor, slots: Tensor) -> Tensor:
        """Look at pictures (B, 3, h, w) of 0..255, whose marks are (B, h, w)."""
        code = torch.relu(self.second(torch.relu(self.first(pixels / 127.5 - 1.0))))
        b, channels, down, across = code.shape
        height, width = slots.shape[1:]
        world, y, x = slots.nonzero(as_tuple=True)
        mark = world * self.most + slots[world, y, x].long() - 1
        cell = (world * down + (y // STRIDE).clamp(max=down - 1)) * across + (x // STRIDE).clamp(max=across - 1)
        each = torch.bincount(mark, minlength=b * self.most).to(code.dtype)[:, None]
        place = torch.stack([2.0 * x / (width - 1.0) - 1.0, 2.0 * y / (height - 1.0) - 1.0], dim=-1)
        here = code.permute(0, 2, 3, 1).reshape(-1, channels).index_select(0, cell)
        seen = code.new_zeros(b * self.most, channels + 2).index_add(0, mark, torch.cat([here, place], dim=1))
        seen = (seen / each.clamp(min=1.0)).view(b, self.most, -1)
        there = (each > 0.0).view(b, self.most)[:, self.marks].any(dim=2).to(code.dtype)
        own = seen[:, self.marks].reshape(b, len(self.marks), -1)
        return torch.cat([there[..., None], own], dim=2).reshape(b, -1)


class EyesExtractor(BaseFeaturesExtractor):
    """Mask, candidates as they are seen, and machine, in one row: what ``set_policy.SetNetwork`` takes apart."""

    def __init__(self, observation_space: Any, eyes: Eyes, features: int):
        """Take what looks."""
        super().__init__(observation_space, features)
        self.eyes = eyes

    def forward(self, observations: dict[str, Tensor]) -> Tensor:
        """Features (B, .) of observations; SB3 puts the channels of pictures first, its environments last."""
        pixels, slots = observations["pixels"], observations["slots"]
        if pixels.shape[-1] == 3 and pixels.shape[1] != 3:
            pixels, slots = pixels.permute(0, 3, 1, 2), slots.permute(0, 3, 1, 2)
        candidates = self.eyes(pixels, slots[:, 0])
        return torch.cat([observations["action_mask"], candidates, observations["machine"]], dim=1)


class SeeingPolicyBase(SetPolicyBase):
    """What the two policies below share."""

    def __init__(
        self,
        observation_space: Any,
        *args: Any,
        layout: dict[str, int] | Layout,
        marks: NDArray[np.int64],
        channels: int = 32,
        **kwargs: Any,
    ):
        """See the policies below."""
        known = layout if isinstance(layout, Layout) else Layout(**layout)
        known = Layout(**{**vars(known), "features": features_of(channels, marks.shape[1])})
        self.marks, self.channels = marks, channels
        flat = known.actions + known.candidates * known.features + known.machine
        super().__init__(
            observation_space,
            *args,
            layout=known,
            normalize_images=False,
            features_extractor_class=EyesExtractor,
            features_extractor_kwargs={"eyes": Eyes(marks, channels), "features": flat},
            **kwargs,
        )

    def learned(self) -> dict[str, NDArray[np.float32]]:
        """Weights of eyes and actor by name, for ``PixelPolicy``."""
        eyes: Any = self.features_extractor  # type: ignore[attr-defined]
        named = {**eyes.eyes.state_dict(), **self.mlp_extractor.actor.state_dict()}
        return {name: values.detach().numpy().copy() for name, values in named.items()}

    def _get_constructor_parameters(self) -> dict[str, Any]:
        data = super()._get_constructor_parameters()
        for name in ("features_extractor_class", "features_extractor_kwargs", "normalize_images"):
            data.pop(name, None)
        return {**data, "marks": self.marks, "channels": self.channels}


class MaskableSeeingPolicy(SeeingPolicyBase, MaskableMultiInputActorCriticPolicy):
    """Policy that looks at pictures for ``MaskablePPO``.

    Args:
        observation_space: with pictures.
        *args: as SB3 passes them.
        layout: of the task, see ``layout_of``.
        marks: (K, j), see ``View.slot_marks``.
        channels: see ``Eyes``.
        **kwargs: as for ``set_policy.MaskableSetPolicy``.
    """


class SeeingPolicy(SeeingPolicyBase, MultiInputActorCriticPolicy):
    """Policy that looks at pictures for ``PPO``; args as in ``MaskableSeeingPolicy``."""
