"""The hoe in PyBullet: one world's decisions driven by the 3-PRRS under its cart."""

from __future__ import annotations

import numpy as np

from .....motion import QUINTIC
from .....motion.orientation import axes
from .....simulation.hoe import HoeMachine
from .....simulation.hoe_model import HoeParameters
from .....simulation.prrs import PrrsResult
from ....core import Array
from ....driven import Driven
from ....shaking import sinks_m
from ...core import WeederOutcome, WeedingCore
from ...ridges import FLAT, Ridges, ridge_height, ridge_heights, risen
from ...state import WAIT, V, WeederPlan
from ...timing import WORK, A, P, whole_steps
from ..stayed import FAR_M, stayed
from .process import B, HoeProcessConfig

_LOOK_EVERY = 6
"""Steps between two looks at the blade while it stirs: forty a second."""


class PyBulletHoe(Driven[WeederPlan, WeederOutcome]):
    """Executor that drives the closed-loop machine of one world, soil resisting the blade.

    The cart keeps its speed, so its frame is as good as the ground's: the machine is driven in it. Phases are cut to
    whole steps: a decision takes up to one step longer than its plan.
    """

    def __init__(self, core: WeedingCore):
        """Build the machine for the rules' single world."""
        super().__init__(core.worlds)
        self._core = core
        self._hoe: HoeProcessConfig = core.config.passing
        self._machine = HoeMachine(core.config.parameters)
        self._dt = 1.0 / self._machine.parameters.physics_hz
        self.last_result: PrrsResult | None = None

    def place(self) -> None:
        """Put the machine where the rules say it stands, its blade up."""
        state = self._core.state
        along, _, across = state.place[0]
        rise = ridge_height(self._core.machine.ridges, float(across))
        tip = np.array([[along, across, self._hoe.clearance_m + rise]])
        self._machine.reset(poses(self._machine.parameters, tip, state.cart[:1])[0])

    def drive(self, plan: WeederPlan) -> WeederOutcome:
        """Drive the motion and say where the blade's circle really was, on average, while it stirred."""
        works = bool(plan.kind[0] < WAIT)
        phases, steps = whole_steps(plan.phases_s, works, self._dt)
        time = self._dt * np.arange(steps + 1, dtype=np.float64)
        ridges = self._core.machine.ridges
        tip = tip_way(self._hoe, plan, phases, time, ridges)
        speed = float(plan.speed[0, V.before])
        cart = float(plan.cart[0]) + speed * time
        pose = poses(self._machine.parameters, tip, cart)
        stirring = np.zeros(steps + 1, bool)
        if works:
            first, last = (float(phases[0, : WORK + part].sum()) for part in (B.stir, B.lift))
            stirring[int(np.ceil(first / self._dt)) : int(last / self._dt) + 1 : _LOOK_EVERY] = True
        errors: list[Array] = []
        core, way, below_m = self._core, pose, 0.0
        if core.errs:
            share = QUINTIC.sample(time, 1.0, float(phases[0, P.move] + phases[0, P.wait])).position
            # A platform that tilts has its blade elsewhere.
            way, below_m = self.erring(pose, share, core.tool_error(plan)[0]), self._machine.parameters.tool_m

        def look(row: int) -> None:
            if stirring[row]:
                at, turned = self._machine.platform()
                errors.append((at - below_m * axes(turned)[:, 2])[:2] - pose[row, :2])

        ground = ridge_heights(ridges, tip[:, 1])
        if self._core.state.surface.shape[1]:
            ground += self._ground_m(tip, cart)
        report = self.last_result = self._machine.hoe(way, speed, look, ground_m=ground)
        hit = plan.aim + np.mean(errors, axis=0) if errors else plan.aim
        if not self.arrived(report.final_error_m, report.saturated):
            hit = np.where(np.isfinite(hit), hit, plan.aim + FAR_M)
        return WeederOutcome(phases, hit)

    def _ground_m(self, tip: Array, cart: Array) -> Array:
        """Height (n,) of the ground under the blade over the level of the frame, in which the machine is driven."""
        surface, shape = self._core.state.surface[0], self._core.tables.shape
        places = zip(cart.tolist(), tip[:, :2].tolist(), strict=True)
        return np.array([sinks_m(surface, shape, x, along, across) for x, (along, across) in places])

    def missed(self, plan: WeederPlan) -> WeederOutcome:
        """The blade stayed where it was."""
        return stayed(plan)


def poses(parameters: HoeParameters, tip: Array, cart_m: Array) -> Array:
    """Level poses (n, 6) of the mechanism for world places (n, 3) of the blade's underside, carts at (n,)."""
    pose = np.zeros((len(tip), 6))
    pose[:, 0] = tip[:, 0] - cart_m
    pose[:, 1] = tip[:, 1]
    pose[:, 2] = tip[:, 2] - parameters.lowest_tip_m
    return pose


def tip_way(hoe: HoeProcessConfig, plan: WeederPlan, phases_s: Array, time_s: Array, ridges: Ridges = FLAT) -> Array:
    """World places (n, 3) of the blade's underside in one world's decision at times (n,) from its beginning.

    The move, stretched over the wait for the weed's entering the window, is a straight line over ground at the
    clearance, from the height of the ground at the one place to that at the other. The plunge ends on the circle, the
    lift begins there and ends over its middle.
    """
    move_s = float(phases_s[0, P.move] + phases_s[0, P.wait])
    start, target = plan.start[0, [A.carrier, A.across]], plan.target[0, [A.carrier, A.across]]
    tip = np.empty((len(time_s), 3))
    tip[:, :2] = start + QUINTIC.sample(time_s, 1.0, move_s).position[:, None] * (target - start)
    tip[:, 2] = hoe.clearance_m + risen(ridges, plan, phases_s, time_s)
    mode = int(plan.kind[0])
    if mode < WAIT:
        plunge_s, stir_s, lift_s = (float(phases_s[0, WORK + part]) for part in (B.plunge, B.stir, B.lift))
        down = QUINTIC.sample(time_s - move_s, 1.0, plunge_s).position
        up = QUINTIC.sample(time_s - move_s - plunge_s - stir_s, 1.0, lift_s).position
        angle = 2.0 * np.pi * QUINTIC.sample(time_s - move_s - plunge_s, 1.0, stir_s).position
        radius = hoe.stir_radius_m[mode] * (down - up)
        tip[:, 0] += radius * np.cos(angle)
        tip[:, 1] += radius * np.sin(angle)
        tip[:, 2] -= (hoe.clearance_m + hoe.depth_m[mode]) * (down - up)
    return tip
