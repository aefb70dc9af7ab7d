"""The machine in PyBullet that carries a weeding plan out."""

from __future__ import annotations

import numpy as np

from .....motion import QUINTIC
from .....simulation.weeder import WeederMachine
from ....core import Array
from ....driven import Driven
from ...core import WeederOutcome, WeedingCore
from ...state import WAIT, V, WeederPlan
from ...timing import WORK, P, ways_of, whole_steps
from ..stayed import FAR_M, stayed
from .aim import poses
from .config import WeedingConfig
from .process import B

_LOOK_EVERY = 6
"""Steps between two looks at the beam while it burns: forty a second."""


class PyBulletWeeder(Driven[WeederPlan, WeederOutcome]):
    """Executor that drives the closed-loop machine of one world; the cart moves in every step.

    Phases are cut to whole steps: a decision takes up to one step longer than its plan.
    """

    def __init__(self, core: WeedingCore):
        """Build the machine for the rules' single world."""
        super().__init__(core.worlds)
        self._core = core
        self._config: WeedingConfig = core.config
        self._machine = WeederMachine(self._config.parameters)
        self._dt = 1.0 / self._machine.parameters.physics_hz

    def place(self) -> None:
        """Put the machine where the rules say it stands, its cart driving already."""
        state = self._core.state
        cart = state.cart[:1]
        pose = poses(self._config.reach, state.place[:1], cart)[0]
        self._machine.reset(float(cart[0]), pose, float(state.speed[0]))

    def drive(self, plan: WeederPlan) -> WeederOutcome:
        """Drive the motion, follow for the time of the work, and say where the beam was while it burned."""
        config, dt = self._config, self._dt
        works = bool(plan.kind[0] < WAIT)
        phases, steps = whole_steps(plan.phases_s, works, dt)
        time = dt * np.arange(steps + 1, dtype=np.float64)
        cart, beam = trajectory(config, plan, phases, time)
        burning = np.zeros(steps + 1, bool)
        if works:
            first = round((steps * dt - float(phases[0, WORK + B.burn])) / dt) + 1
            burning[first::_LOOK_EVERY] = True
        reach = config.reach
        pose = poses(reach, beam, cart)
        if self._core.errs:
            share = QUINTIC.sample(time, 1.0, float(phases[0, P.move] + phases[0, P.wait])).position
            pose = self.erring(pose, share, self._core.tool_error(plan)[0])
        report = self._machine.run(cart, pose, reach.target_height_m, burning)
        hit = plan.aim
        if works:
            seen = report.beam[burning]
            hit = (seen if len(seen) else report.beam[-1:]).mean(axis=0, keepdims=True)
        if not self.arrived(report.final_error_m, report.saturated):
            hit = np.where(np.isfinite(hit), hit, plan.aim + FAR_M)
        return WeederOutcome(phases, hit)

    def missed(self, plan: WeederPlan) -> WeederOutcome:
        """The beam stayed where it was."""
        return stayed(plan)


def trajectory(config: WeedingConfig, plan: WeederPlan, phases_s: Array, time_s: Array) -> tuple[Array, Array]:
    """Cart positions (n,) and beam coordinates (n, 3) of one world's decision at times (n,) from its beginning.

    The move is stretched over the wait for the weed's entering the window, so the machine arrives with it.
    """
    move_s = float(phases_s[0, P.move] + phases_s[0, P.wait])
    before, after = plan.speed[0, V.before], plan.speed[0, V.after]
    way = ways_of(float(before), float(after), config.cart.acceleration_m_s2, time_s)
    share = QUINTIC.sample(time_s, 1.0, move_s).position
    start, target = plan.start[0], plan.target[0]
    return plan.cart[0] + way, start + share[:, None] * (target - start)
