"""The machine in PyBullet that carries a weeding plan out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .....motion import QUINTIC
from .....simulation.weeder import LEVEL_WAY, WeederMachine, WeederResult
from ....core import Array
from ....driven import Driven
from ....shaking import heights_at, lands, ways_at
from ...core import WeederOutcome, WeedingCore
from ...ridges import ridge_heights, risen
from ...state import FAR_M as NOTHING_M
from ...state import WAIT, V, WeederPlan
from ...timing import WORK, A, P, ways_of, whole_steps
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
        rise = ridge_heights(self._core.machine.ridges, state.place[:1, A.across])
        pose = poses(self._config.aim, state.place[:1], cart, rise)[0]
        way = self._ways(cart)[0].tolist() if self._uneven else LEVEL_WAY
        self._machine.reset(float(cart[0]), pose, float(state.speed[0]), way)

    @property
    def _uneven(self) -> bool:
        return self._core.state.surface.shape[1] > 0

    def _ways(self, cart: Array) -> Array:
        return ways_at(self._core.state.surface[0], self._core.tables.shape, np.ascontiguousarray(cart))

    def drive(self, plan: WeederPlan) -> WeederOutcome:
        """Drive the motion, follow for the time of the work, and say where the beam was while it burned."""
        config, dt = self._config, self._dt
        works = bool(plan.kind[0] < WAIT)
        phases, steps = whole_steps(plan.phases_s, works, dt)
        time = dt * np.arange(steps + 1, dtype=np.float64)
        cart, beam = trajectory(config, plan, phases, time)
        rise = risen(self._core.machine.ridges, plan, phases, time)
        burning = np.zeros(steps + 1, bool)
        if works:
            first = round((steps * dt - float(phases[0, WORK + B.burn])) / dt) + 1
            burning[first::_LOOK_EVERY] = True
        aim = config.aim
        pose = poses(aim, beam, cart, rise)
        if self._core.errs:
            share = QUINTIC.sample(time, 1.0, float(phases[0, P.move] + phases[0, P.wait])).position
            pose = self.erring(pose, share, self._core.tool_error(plan)[0])
        if self._uneven:
            report = self._shaken(plan, phases, cart, beam, pose, burning, float(rise[-1]))
        else:
            report = self._machine.run(cart, pose, aim.target_height_m + float(rise[-1]), burning)
        hit = plan.aim
        if works:
            seen = report.beam[burning[-len(report.beam) :]]
            hit = (seen if len(seen) else report.beam[-1:]).mean(axis=0, keepdims=True)
        if not self.arrived(report.final_error_m, report.saturated):
            hit = np.where(np.isfinite(hit), hit, plan.aim + FAR_M)
        return WeederOutcome(phases, hit)

    def _shaken(
        self,
        plan: WeederPlan,
        phases: Array,
        cart: Array,
        beam: Array,
        pose: Array,
        burning: NDArray[np.bool_],
        rise_m: float,
    ) -> WeederResult:
        """Drive poses (n, 4) over uneven ground; the target stands ``rise_m`` high on its ridge.

        What the tool camera sees is seen from where the tool really is: what the drives have left undone of the move is
        a part of the correction.
        """
        reach, shape, surface = self._config.aim, self._core.tables.shape, self._core.state.surface[0]
        aim = np.where(plan.aim < NOTHING_M, plan.aim, 0.0)
        plane_m = reach.target_height_m + rise_m + float(heights_at(surface, shape, aim)[0])
        ways, looked = self._ways(cart), 0
        if plan.correction.any():
            looked = round(float(phases[0, : WORK + B.correct].sum()) / self._dt)
            first = slice(0, looked + 1)
            self._machine.run(cart[first], pose[first], plane_m, ways=ways[first])
            told = lands(surface, shape, float(cart[looked]), *beam[looked].tolist())
            left = self._machine.beam_world(plane_m) - told
            done = correcting(self._config, phases, self._dt * np.arange(len(cart), dtype=np.float64))
            mended = beam.copy()
            mended[:, [A.carrier, A.across]] -= done[:, None] * left
            shift = poses(reach, mended, cart) - poses(reach, beam, cart)
            pose = pose + shift
            if self._core.errs:
                self._off = self._off + shift[-1]
        rest = slice(looked, None)
        return self._machine.run(cart[rest], pose[rest], plane_m, burning[rest], ways=ways[rest])

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
    if not plan.correction.any():
        return plan.cart[0] + way, start + share[:, None] * (target - start)
    correction = np.zeros(len(A))
    correction[[A.carrier, A.across]] = plan.correction[0]
    beam = start + share[:, None] * (target - correction - start)
    return plan.cart[0] + way, beam + correcting(config, phases_s, time_s)[:, None] * correction


def correcting(config: WeedingConfig, phases_s: Array, time_s: Array) -> Array:
    """Share (n,) of the tool camera's correction that is done at times (n,): after its picture, a motion of its own."""
    begin_s = float(phases_s[0, : WORK + B.correct].sum()) + config.process.correct_s
    motion_s = float(phases_s[0, WORK + B.correct]) - config.process.correct_s
    return QUINTIC.sample(time_s - begin_s, 1.0, max(motion_s, 1e-9)).position
