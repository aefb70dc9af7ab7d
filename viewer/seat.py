"""One policy at one machine: it decides, its decisions are shown as they are carried out, and all of it is noted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import gymnasium as gym

from ..agents.policies.base import Policy, act_single
from ..agents.policies.layout import layout_of
from ..envs.belief import Belief
from .reel import Reel, Scene, Watching


class Entry(NamedTuple):
    """A decision that was carried out.

    Attributes:
        ended_s: when it was carried out, in simulated seconds.
        action: what was decided.
        by_hand: whether a person decided it.
        text: the environment's line about it.
        reward: the sum of ``rewards``.
        rewards: by term.
        phases_s: by phase.
        scorecard: after it.
    """

    ended_s: float
    action: int
    by_hand: bool
    text: str
    reward: float
    rewards: dict[str, float]
    phases_s: dict[str, float]
    scorecard: dict[str, float]

    @property
    def began_s(self) -> float:
        """When it began."""
        return self.ended_s - sum(self.phases_s.values())


class Seat:
    """An environment, who decides in it, and what has happened so far.

    Nothing but ``reset`` and ``step`` is done to the environment, in the order in which anybody would.

    Attributes:
        env: made by Gymnasium, with pictures.
        policy: who decides.
        watching: what was seen last.
        log: the decisions so far.
        scorecard: as it stands.
        over: whether the episode has ended.
        choice: what the policy would do next; None when the episode has ended.
        layout: how its actions divide.
        belief: what the machine believes now; None where the task does not say.
    """

    def __init__(self, env: gym.Env[Any, Any], policy: Policy):
        """Take the parts; ``begin`` comes next."""
        self.env, self.policy = env, policy
        self.watching = Watching()
        self.log: list[Entry] = []
        self.scorecard: dict[str, float] = {}
        self.observation: dict[str, Any] = {}
        self.over, self.choice = True, None
        self.layout = layout_of(env)
        self.belief: Belief | None = None
        self._inner: Any = env.unwrapped
        self._reel: Reel[Scene] | None = None
        self._rate, self._count = 30.0, 0
        self._began_s = 0.0
        self._action, self._by_hand = 0, False
        self._kept: Scene | None = None

    def begin(self, reset: Callable[[gym.Env[Any, Any]], tuple[Any, Any]]) -> Scene:
        """Start an episode and give the scene of its beginning.

        Args:
            reset: resets the environment.
        """
        import numpy as np

        self.rest()
        with self.watching.under():
            self.observation, info = reset(self.env)
            self._inner.view.frame()
        self.policy.reset(np.ones(1, bool))
        self.log, self.over = [], False
        self.scorecard = dict(info["scorecard"])
        self._began_s, self._kept = self.scorecard["duration_s"], None
        self._choose()
        assert self.watching.scene is not None, "the view of this task draws without a stage"
        return self.watching.scene

    @property
    def busy(self) -> bool:
        """Whether a decision is being carried out."""
        return self._reel is not None

    @property
    def now_s(self) -> float:
        """When the last finished decision ended."""
        return self._began_s

    def start(self, scenes_per_second: float, action: int | None = None) -> None:
        """Let the next decision be carried out; ``action`` is taken instead of the policy's choice."""
        if self.over or self.busy or self.choice is None:
            return
        self._by_hand = action is not None
        self._action = self.choice if action is None else action
        self._rate, self._count = scenes_per_second, 0
        self._reel = Reel(self._step)

    def until(self, now_s: float) -> tuple[Scene | None, bool]:
        """The newest scene up to a simulated time, None where there is no new one; and whether the decision is over."""
        newest = None
        while self._reel is not None:
            if self._kept is None:
                self._kept = self._reel.next()
                if self._kept is None:
                    break
            if self._began_s + self._count / self._rate > now_s:
                return newest, False
            newest, self._kept = self._kept, None
            self._count += 1
        return newest, True

    def finish(self) -> Scene | None:
        """Book the decision: what came of it, and what the policy would do next; its last scene."""
        assert self._reel is not None
        observation, reward, terminated, truncated, info = self._reel.result()
        self._reel = self._kept = None
        entry = Entry(
            float(info["scorecard"]["duration_s"]),
            self._action,
            self._by_hand,
            self._inner.describe_last_decision(),
            float(reward),
            dict(info["rewards"]),
            dict(info["phases_s"]),
            dict(info["scorecard"]),
        )
        self.observation, self.scorecard = observation, entry.scorecard
        self.log.append(entry)
        self._began_s = entry.ended_s
        self.over = bool(terminated or truncated)
        self._choose()
        return self.watching.scene

    def rest(self) -> None:
        """Carry out at once what is under way, unseen."""
        if self._reel is not None:
            self._reel.result()
            self._reel = self._kept = None

    def close(self) -> None:
        """Close the environment; idempotent."""
        self.rest()
        self.env.close()

    def _choose(self) -> None:
        """Note what is believed, and what the policy makes of it."""
        tell = self._inner.assembly.belief
        self.belief = None if tell is None else tell(self._inner.core)
        self.choice = None if self.over else act_single(self.policy, self.observation)

    def _step(self, hand: Callable[[Scene], None]) -> Any:
        """Carry the decision out, in the reel's thread."""

        def on_frame(_: Any) -> None:
            if self.watching.scene is not None:
                hand(self.watching.scene)

        self._inner.record(on_frame, self._rate)
        try:
            with self.watching.under():
                result = self.env.step(self._action)
                # What pictures show of a decision's end may be seen only in the next one.
                self._inner.view.frame()
        finally:
            self._inner.record(None)
        return result
