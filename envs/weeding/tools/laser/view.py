"""The laser's strip as its cameras and people see it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....core import Array
from ....shaking import lands
from ...core import WeedingCore
from ...ridges import ridge_heights, risen
from ...state import WAIT, WeederPlan
from ...straying import NOWHERE_M
from ...timing import WORK, A, G, P, way_of
from ...view import FieldView, Show
from .aim import poses
from .config import WeedingConfig
from .machine import trajectory
from .process import B
from .scene import WeederScene


class WeederView(FieldView[WeederScene]):
    """The laser's strip, with the camera that corrects its aim."""

    def __init__(self, core: WeedingCore):
        """Build nothing yet: scenes come with the first look or picture."""
        super().__init__(core)
        self._config: WeedingConfig = core.config

    def make_scene(self) -> WeederScene:
        """A scene: one for the cameras, and one for people with the machine in it."""
        return WeederScene(self._config, self._config.parameters)

    def standing(self) -> Show[WeederScene]:
        """The machine as it stands now, its beam off."""
        state = self.core.state
        rise = ridge_heights(self.core.machine.ridges, state.place[:1, A.across])
        return self._show(float(state.cart[0]), state.place[0], float(rise[0]), False)

    def moving(self, plan: WeederPlan, phases_s: Array, time_s: Array) -> Iterator[Show[WeederScene]]:
        """The machine at times (n,) of a decision; the beam is on while it burns."""
        cart, beam = trajectory(self._config, plan, phases_s, time_s)
        burns = (plan.kind[0] < WAIT) & (time_s >= float(phases_s[0].sum() - phases_s[0, WORK + B.burn]))
        rise = risen(self.core.machine.ridges, plan, phases_s, time_s)
        for x, coordinates, higher, on in zip(cart.tolist(), beam, rise.tolist(), burns.tolist(), strict=True):
            yield self._show(x, coordinates, higher, on)

    def aim_at(self, index: int, action: int) -> None:
        """Have the tool camera look at the weed that an action fires at, and correct the rules' aim."""
        if self.core.tables.looks_after:
            self._look_after(index, action)
            return
        told = self.core.state.track_report[0, index]
        aim = self.tool_aim(told, self.off_m)
        if aim is not None:
            self.heed(index, told, aim)
            self.core.correct(0, index, aim)
            self.treat_near(aim)

    def tool_aim(self, told: Array, off_m: float) -> Array | None:
        """Where the tool camera sees the plant that it was sent to, (2,), or None; ``told`` is that far off."""
        reach = self._config.aim
        centre = np.array([told[0] - 0.02, 0.0, reach.target_height_m + reach.gap_m])
        return self.eyes.tool(self.camera_scene().look_tool(centre, told), told, off_m)

    def _look_after(self, index: int, action: int) -> None:
        """Look at where an action has brought the tool, from where the tool then is; the rules take what is seen.

        They want it as a place in the world: where the tool works without a correction, and from there the way that
        the camera, which shares the tool's error, sees to the plant.
        """
        core, state = self.core, self.core.state
        nowhere = np.array([state.track_report[0, index, G.along], NOWHERE_M])
        core.correct(0, index, nowhere)
        if not core.config.scenario.ground.tool_camera:
            return
        plan = core.plan(np.array([action]))
        time_s = float(plan.phases_s[0, P.move] + plan.phases_s[0, P.wait])
        before, after = plan.speed[0].tolist()
        way, _ = way_of(before, after, self._config.cart.acceleration_m_s2, time_s)
        cart, (carrier, lean, across) = float(plan.cart[0]) + way, plan.target[0].tolist()
        told, reach = np.array([carrier + lean, across]), self._config.aim
        eye = np.array([carrier, 0.0, reach.target_height_m + reach.gap_m])
        seen = self.eyes.tool(self.camera_scene().look_tool(eye, told, cart), told, self.off_m)
        if seen is not None:
            core.correct(
                0, index, lands(state.surface[0], core.tables.shape, cart, carrier, lean, across) + seen - told
            )
            self.treat_near(seen)

    def _show(self, cart_m: float, beam: Array, rise_m: float, on: bool) -> Show[WeederScene]:
        pose = poses(self._config.aim, beam[None], np.array([cart_m]), rise_m)[0]
        return lambda scene: scene.set_machine(cart_m, pose, on)
