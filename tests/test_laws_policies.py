"""Policies that know no task, and what all of them share, against their formulas."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fieldgym.agents.foreign import ForeignError
from fieldgym.agents.policies.base import GuestPolicy, RandomPolicy, act_single
from fieldgym.agents.policies.layout import Layout
from fieldgym.agents.policies.network import NetworkPolicy, shapes
from fieldgym.agents.policies.weights import PolicyFileError


def test_chance_takes_every_legal_action_as_often_as_any_other():
    mask = np.zeros((4000, 5), np.int8)
    mask[:, [0, 2, 4]] = 1
    actions = RandomPolicy(3).act({"action_mask": mask})
    counts = np.bincount(actions, minlength=5)
    assert counts[1] == counts[3] == 0 and min(counts[[0, 2, 4]]) > 1200
    assert (RandomPolicy(3).act({"action_mask": mask}) == actions).all()
    assert (RandomPolicy(4).act({"action_mask": mask}) != actions).any()
    assert (RandomPolicy.make(None, 3).act({"action_mask": mask}) == actions).all()


@pytest.mark.parametrize("sizes", [(2, 4, 3, 3, 1, 1), (7, 3, 2, 2, 2, 3), (1, 1, 1, 1, 0, 1)])
def test_actions_are_numbered_by_block_slot_and_option(sizes):
    layout = Layout(*sizes)
    k, options, extras, blocks = layout.candidates, layout.options, layout.extras, layout.blocks
    slot = np.arange(k)[None, :, None] + np.zeros((2, 1, blocks * options))
    option = np.arange(blocks * options)[None, None] + np.zeros((2, k, 1))
    extra = np.arange(blocks * extras)[None] + 0.5 + np.zeros((2, 1))
    joined = layout.join(100.0 * slot + option, -extra, np.concatenate)
    order = np.random.default_rng(0).permutation(k)
    moved = layout.permute(order)
    assert joined.shape == (2, layout.actions) and moved.shape == (layout.actions,)
    base = k * options + extras
    for action in range(layout.actions):
        block, rest = divmod(action, base)
        if rest < k * options:
            place, which = divmod(rest, options)
            assert joined[1, action] == 100.0 * place + block * options + which
            assert moved[action] == block * base + order[place] * options + which
        else:
            assert joined[1, action] == -(block * extras + rest - k * options + 0.5)
            assert moved[action] == action
    for name, wrong in (("candidates", 0), ("blocks", 0), ("extras", -1)):
        with pytest.raises(ValueError, match=name):
            Layout(**{**vars(layout), name: wrong})


@pytest.mark.parametrize("relations", [0, 2])
def test_a_set_policy_is_its_formula(relations):
    layout, h, rng = Layout(2, 4, 3, 2, 1, 2), 5, np.random.default_rng(1)
    weights = {key: rng.normal(size=shape).astype(np.float32) for key, shape in shapes(layout, h, relations).items()}
    policy = NetworkPolicy(layout, h, weights, {}, relations=relations)
    machine = rng.normal(size=(6, 2)).astype(np.float32)
    candidates = rng.normal(size=(6, 4, 3)).astype(np.float32)
    candidates[..., 0] = rng.random((6, 4)) < 0.6
    candidates[0, :, 0], candidates[1, :, 0] = 0.0, 1.0
    w = {key: value.astype(float) for key, value in weights.items()}
    mask = (rng.random((6, layout.actions)) < 0.5).astype(np.int8)
    mask[:, -1] = 1
    observation = {"machine": machine, "candidates": candidates.reshape(6, -1), "action_mask": mask}
    logits, actions = policy.logits(observation), policy.act(observation)

    def line(name: str, values: Any) -> Any:
        return w[f"{name}.weight"] @ values + w.get(f"{name}.bias", 0.0)

    def bent(values: Any) -> Any:
        return np.maximum(values, 0.0)

    for b in range(6):
        m, there = machine[b].astype(float), candidates[b, :, 0] > 0.0
        code = [
            bent(line("encoder.second", bent(line("encoder.candidate", row) + line("encoder.machine", m))))
            for row in candidates[b].astype(float)
        ]
        some = [code[i] if there[i] else np.zeros(h) for i in range(4)]
        mean = sum(some) / max(there.sum(), 1)
        context = bent(line("encoder.context", np.concatenate([mean, np.max(some, axis=0), m, [there.sum() / 4.0]])))
        slots = []
        for i in range(4):
            own = code[i]
            if relations:
                heard = [bent(line("from_one", code[i]) + line("to_other", code[j])) * there[j] for j in range(4)]
                own = np.concatenate([own, sum(heard) / max(there.sum(), 1), np.max(heard, axis=0)])
            slots.append(line("options", bent(line("own", own) + line("shared", context))) * there[i])
        extras = line("extras", context)
        joined = [
            value
            for block in range(2)
            for value in [*np.concatenate([slot[2 * block : 2 * block + 2] for slot in slots]), extras[block]]
        ]
        assert logits[b] == pytest.approx(np.array(joined), rel=2e-5, abs=2e-5)
        assert actions[b] == max(np.flatnonzero(mask[b]), key=lambda a: joined[a])


def right_sized(layout: Layout) -> NetworkPolicy:
    weights = {key: np.zeros(shape, np.float32) for key, shape in shapes(layout, 3).items()}
    return NetworkPolicy(layout, 3, weights, {})


def test_a_set_policy_s_card_says_how_large_it_is():
    layout = Layout(2, 4, 3, 2, 1, 2)
    for hidden, relations, right in ((1, 0, True), (512, 512, True), (0, 0, False), (513, 0, False), (8, 513, False)):
        sizes = shapes(layout, max(hidden, 1), relations)
        weights = {key: np.zeros(shape, np.float32) for key, shape in sizes.items()}
        card = {"layout": vars(layout), "hidden": hidden, "relations": relations}
        if right:
            made = NetworkPolicy.of(card, weights, "mine")
            assert (made.hidden, made.relations, made.layout, made.name) == (hidden, relations, layout, "mine")
            assert made.head["hidden"] == hidden and made.head["layout"] == vars(layout)
        else:
            with pytest.raises(PolicyFileError, match="out of range"):
                NetworkPolicy.of(card, weights, "mine")
    many = {"layout": {**vars(layout), "candidates": 4097}, "hidden": 8}
    with pytest.raises(PolicyFileError, match="out of range"):
        NetworkPolicy.of(many, {}, "mine")
    with pytest.raises(ValueError, match="do not fit"):
        right_sized(layout).logits(
            {"machine": np.zeros((1, 2)), "candidates": np.zeros((1, 13)), "action_mask": np.zeros((1, 18))}
        )


def test_a_guest_is_asked_and_told_as_it_is():
    class Guest:
        def __init__(self, answer: Any):
            self.answer, self.told = answer, []

        def act(self, observation: Any) -> Any:
            return self.answer

        def reset(self, rows: Any) -> None:
            self.told.append(rows.tolist())

    seen, both = {"action_mask": np.ones((2, 3))}, np.array([True, False])
    guest = Guest([1, 2])
    policy = GuestPolicy(guest, "g")
    policy.reset(both)
    assert guest.told == [[True, False]] and policy.act(seen).tolist() == [1, 2] and policy.act(seen).dtype == np.int64
    for answer in ([1], [1.0, 2.0], [[1, 2]]):
        with pytest.raises(ForeignError, match=r"shape \(2,\)"):
            GuestPolicy(Guest(answer), "g").act(seen)
    silent = GuestPolicy(SimpleNamespace(act=lambda observation: np.array([0, 1], np.uint8)), "s")
    silent.reset(both)
    assert silent.act(seen).tolist() == [0, 1]
    assert act_single(GuestPolicy(Guest([2]), "g"), {"action_mask": np.ones(3)}) == 2
