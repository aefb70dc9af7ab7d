"""A policy network for which candidates are a set: slot order changes nothing but the order of the logits.

One encoder sees every candidate together with the machine; what it makes of the present ones is pooled (mean, maximum)
into a context; each candidate's logits come from its own code and the context, the actions that belong to no candidate
and the value from the context alone (Zaheer et al. 2017, Deep Sets). PyTorch is imported only here.
"""

from __future__ import annotations

from typing import Any

import torch
from sb3_contrib.common.maskable.policies import MaskableMultiInputActorCriticPolicy
from stable_baselines3.common.policies import MultiInputActorCriticPolicy
from torch import Tensor, nn

from ..policies.layout import Layout

MASKED = -1e8
"""Logit of what is not possible, as sb3-contrib writes it."""


class SetEncoder(nn.Module):
    """Codes of the candidates that are there (N, H), and a context (B, H).

    Most slots of most observations are empty; only the taken ones are computed.
    """

    def __init__(self, layout: Layout, hidden: int):
        """Make the layers."""
        super().__init__()
        self.layout, self.hidden = layout, hidden
        self.candidate = nn.Linear(layout.features, hidden)
        self.machine = nn.Linear(layout.machine, hidden, bias=False)
        self.second = nn.Linear(hidden, hidden)
        self.context = nn.Linear(2 * hidden + layout.machine + 1, hidden)

    def forward(self, machine: Tensor, candidates: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Encode machine (B, m) and candidates (B, K, F).

        Returns:
            Codes (N, H), the world of each (N,), its place among the B K slots (N,), and the context (B, H).
        """
        slots = self.layout.candidates
        flat = candidates.reshape(-1, self.layout.features)
        place = (flat[:, 0] > 0.0).nonzero()[:, 0]
        world = torch.div(place, slots, rounding_mode="floor")
        code = torch.relu(self.candidate(flat.index_select(0, place)) + self.machine(machine).index_select(0, world))
        code = torch.relu(self.second(code))
        nothing = code.new_zeros(len(machine), self.hidden)
        count = code.new_zeros(len(machine)).index_add(0, world, code.new_ones(len(place)))[:, None]
        mean = nothing.index_add(0, world, code) / count.clamp(min=1.0)
        # Codes are not negative, so a maximum that begins at zero is that of the codes.
        most = nothing.scatter_reduce(0, world[:, None].expand(-1, self.hidden), code, "amax")
        pooled = torch.cat([mean, most, machine, count / slots], dim=1)
        return code, world, place, torch.relu(self.context(pooled))


class SetActor(nn.Module):
    """Logits (B, actions); those of empty slots are zero.

    With ``relations`` every candidate also hears of each of the others how the two are to each other (mean and maximum
    of as many numbers; Santoro et al. 2017, relation networks), which pooled codes cannot say.
    """

    def __init__(self, layout: Layout, hidden: int, relations: int = 0):
        """Make the layers."""
        super().__init__()
        self.layout, self.relations = layout, relations
        self.encoder = SetEncoder(layout, hidden)
        if relations:
            self.from_one = nn.Linear(hidden, relations)
            self.to_other = nn.Linear(hidden, relations, bias=False)
        self.own = nn.Linear(hidden + 2 * relations, hidden)
        self.shared = nn.Linear(hidden, hidden, bias=False)
        self.options = nn.Linear(hidden, layout.blocks * layout.options)
        self.extras = nn.Linear(hidden, layout.blocks * layout.extras)

    def forward(self, machine: Tensor, candidates: Tensor) -> Tensor:
        """Logits of machine (B, m) and candidates (B, K, F)."""
        b, slots = len(machine), self.layout.candidates
        code, world, place, context = self.encoder(machine, candidates)
        if self.relations:
            code = torch.cat([code, self._heard(code, place, b)], dim=1)
        options = self.options(torch.relu(self.own(code) + self.shared(context).index_select(0, world)))
        spread = options.new_zeros(b * slots, options.shape[1]).index_copy(0, place, options)
        return self.layout.join(spread.view(b, slots, -1), self.extras(context), torch.cat)

    def _heard(self, code: Tensor, place: Tensor, worlds: int) -> Tensor:
        """Mean and maximum (N, 2 R) over a world's candidates of what each is to the candidates (N, H) in turn."""
        slots, r = self.layout.candidates, self.relations
        there = code.new_zeros(worlds * slots).index_fill(0, place, 1.0).view(worlds, 1, slots, 1)
        one, other = (
            code.new_zeros(worlds * slots, r).index_copy(0, place, of(code)).view(worlds, slots, r)
            for of in (self.from_one, self.to_other)
        )
        pairs = torch.relu(one[:, :, None] + other[:, None]) * there
        mean = pairs.sum(dim=2) / there.sum(dim=2).clamp(min=1.0)
        return torch.cat([mean, pairs.amax(dim=2)], dim=2).view(worlds * slots, 2 * r).index_select(0, place)


class SetCritic(nn.Module):
    """Value (B, 1)."""

    def __init__(self, layout: Layout, hidden: int):
        """Make the layers."""
        super().__init__()
        self.encoder = SetEncoder(layout, hidden)
        self.second = nn.Linear(hidden, hidden)
        self.value = nn.Linear(hidden, 1)

    def forward(self, machine: Tensor, candidates: Tensor) -> Tensor:
        """Value of machine (B, m) and candidates (B, K, F)."""
        *_, context = self.encoder(machine, candidates)
        return self.value(torch.relu(self.second(context)))


class SetNetwork(nn.Module):
    """Actor and critic over the concatenated observation, in the place where SB3 has its ``mlp_extractor``."""

    def __init__(self, layout: Layout, hidden: int, critic_hidden: int, relations: int):
        """Make the layers."""
        super().__init__()
        self.layout = layout
        self.latent_dim_pi, self.latent_dim_vf = layout.actions, 1
        self.actor = SetActor(layout, hidden, relations)
        self.critic = SetCritic(layout, critic_hidden)

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Logits and value of features (B, .) in the order of the observation's keys."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: Tensor) -> Tensor:
        """Logits; what the observation's mask forbids gets ``MASKED``."""
        mask, machine, candidates = self._split(features)
        return torch.where(mask > 0.0, self.actor(machine, candidates), MASKED)

    def forward_critic(self, features: Tensor) -> Tensor:
        """Value (B, 1)."""
        _, machine, candidates = self._split(features)
        return self.critic(machine, candidates)

    def _split(self, features: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        # Gymnasium's Dict sorts its keys: action_mask, candidates, machine.
        layout = self.layout
        flat = layout.candidates * layout.features
        mask, candidates, machine = torch.split(features, [layout.actions, flat, layout.machine], dim=1)
        return mask, machine, candidates.reshape(-1, layout.candidates, layout.features)


class SetPolicyBase:
    """What the policies of both algorithms share."""

    layout: Layout
    hidden: int
    critic_hidden: int
    relations: int
    mlp_extractor: Any

    def __init__(
        self,
        *args: Any,
        layout: dict[str, int] | Layout,
        hidden: int = 64,
        critic_hidden: int = 64,
        relations: int = 0,
        **kwargs: Any,
    ):
        """See the policies below."""
        self.layout = layout if isinstance(layout, Layout) else Layout(**layout)
        self.hidden, self.critic_hidden, self.relations = hidden, critic_hidden, relations
        super().__init__(*args, net_arch=[], **kwargs)  # type: ignore[call-arg]

    def learned(self) -> dict[str, Any]:
        """The actor's weights by name, for ``NetworkPolicy``."""
        actor = self.mlp_extractor.actor.state_dict()
        return {name: values.detach().numpy().copy() for name, values in actor.items()}

    def _build(self, lr_schedule: Any) -> None:
        self.mlp_extractor = SetNetwork(self.layout, self.hidden, self.critic_hidden, self.relations)
        network = self.mlp_extractor
        for module in network.modules():
            if isinstance(module, nn.Linear):
                nn.init.orthogonal_(module.weight, gain=2.0**0.5)
                if module.bias is not None:
                    nn.init.zeros_(module.bias)
        # A policy that begins nearly uniform, a value that begins near zero.
        for head, gain in ((network.actor.options, 0.01), (network.actor.extras, 0.01), (network.critic.value, 1.0)):
            nn.init.orthogonal_(head.weight, gain=gain)
        self.action_net, self.value_net = nn.Identity(), nn.Identity()
        self.optimizer = self.optimizer_class(self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs)  # type: ignore[attr-defined]

    def _get_constructor_parameters(self) -> dict[str, Any]:
        data = super()._get_constructor_parameters()  # type: ignore[misc]
        data.pop("net_arch", None)
        sizes = {"hidden": self.hidden, "critic_hidden": self.critic_hidden, "relations": self.relations}
        return {**data, "layout": self.layout, **sizes}


class MaskableSetPolicy(SetPolicyBase, MaskableMultiInputActorCriticPolicy):
    """Set policy for ``MaskablePPO``.

    Args:
        *args: as SB3 passes them.
        layout: of the task, see ``layout_of``.
        hidden: width of the actor.
        critic_hidden: width of the critic.
        relations: numbers that candidates hear of each other, see ``SetActor``.
        **kwargs: as SB3 passes them.
    """


class SetPolicy(SetPolicyBase, MultiInputActorCriticPolicy):
    """Set policy for ``PPO``: it takes the mask from the observation. Args as in ``MaskableSetPolicy``."""
