"""The Gymnasium environments of weeding: what all tools share, and the laser's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

from gymnasium.vector import AutoresetMode

from ..core import Executor, choice, configured
from ..single import TaskEnv, single_perception
from ..vector import TaskVectorEnv, batched_perception
from .config import SCENARIOS, FieldTask, PerceptionModel, WeedingConfig
from .core import WeederOutcome, WeedingCore
from .rules import WeederPlan
from .tools.hoe.config import HoeWeedingConfig
from .tools.hoe.machine import PyBulletHoe
from .tools.hoe.process import HoeArm, HoeProcess
from .tools.laser.aim import LaserArm
from .tools.laser.machine import AnalyticWeeder, PyBulletWeeder
from .tools.laser.process import LaserProcess

if TYPE_CHECKING:
    from .view import FieldView


class Tool(NamedTuple):
    """What makes a weeding environment of the rules.

    Attributes:
        config: type of its configuration.
        core: makes the rules of a configuration, a perception and a number of worlds.
        executor: makes the machine in PyBullet.
        view: makes the rendered world; its last argument asks for a window.
        corrects: whether a camera beside the tool corrects its aim.
    """

    config: type[FieldTask]
    core: Callable[[Any, PerceptionModel | None, int], WeedingCore]
    executor: Callable[[WeedingCore, Any], Executor[WeederPlan, WeederOutcome]]
    view: Callable[[WeedingCore, Any, bool], FieldView[Any]]
    corrects: bool


def laser_core(config: WeedingConfig, perception: PerceptionModel | None, worlds: int = 1) -> WeedingCore:
    """The weeding rules with the laser as their tool."""
    arm = LaserArm.of(config.reach, config.cart.early_s)
    return WeedingCore(config, arm, LaserProcess(config.process), perception, worlds)


def hoe_core(config: HoeWeedingConfig, perception: PerceptionModel | None, worlds: int = 1) -> WeedingCore:
    """The weeding rules with the hoe as their tool."""
    arm = HoeArm.of(config.reach, config.cart.early_s)
    return WeedingCore(config, arm, HoeProcess(config.process), perception, worlds)


# Rendering and OpenCV load only where something is seen.


def _laser_view(core: WeedingCore, config: WeedingConfig, window: bool) -> FieldView[Any]:
    from .view import WeederView

    return WeederView(core, config, window)


def _hoe_view(core: WeedingCore, config: HoeWeedingConfig, window: bool) -> FieldView[Any]:
    from .tools.hoe.view import HoeView

    return HoeView(core, config, window)


TOOLS = {
    "laser": Tool(WeedingConfig, laser_core, PyBulletWeeder, _laser_view, True),
    "hoe": Tool(HoeWeedingConfig, hoe_core, PyBulletHoe, _hoe_view, False),
}


class WeedingEnv(TaskEnv[WeederPlan, WeederOutcome]):
    """One strip of field under one of the ``TOOLS``; the environments of the tools say what can be passed."""

    speed_control = False

    def __init__(
        self,
        tool: str,
        scenario: str | None,
        backend: str,
        perception: str | None,
        slots: int | None,
        config: FieldTask | None,
        render_mode: str | None,
    ):
        """Build the rules, the executor and, where asked for, the scene."""
        parts = TOOLS[choice("tool", tool, tuple(TOOLS))]
        chosen = field_task(parts, config, scenario, slots, self.speed_control)
        perception = single_perception(backend, perception)
        core = parts.core(chosen, perception_model(parts, perception), 1)
        executor = AnalyticWeeder() if backend == "analytic" else parts.executor(core, chosen)
        super().__init__(core, executor, partial(parts.view, core, chosen), perception == "camera", render_mode)

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Carry out one decision; with a camera, the plant that is worked on is marked, its aim perhaps corrected.

        Raises:
            ValueError: the action is no integer of the action space.
        """
        if self._sensing:
            view = self.view
            assert hasattr(view, "attend")
            view.attend(self._checked(action))  # type: ignore[attr-defined]
        return super().step(action)


class WeedingVectorEnv(TaskVectorEnv[WeederPlan, WeederOutcome]):
    """``num_envs`` strips under one of the ``TOOLS`` in one batch, with the analytic backend."""

    speed_control = False

    def __init__(
        self,
        tool: str,
        num_envs: int,
        scenario: str | None,
        backend: str,
        perception: str | None,
        slots: int | None,
        config: FieldTask | None,
        autoreset_mode: str | AutoresetMode,
        render_mode: str | None,
    ):
        """Build the rules for all worlds."""
        parts = TOOLS[choice("tool", tool, tuple(TOOLS))]
        perception = batched_perception(backend, perception, render_mode)
        chosen = field_task(parts, config, scenario, slots, self.speed_control)
        core = parts.core(chosen, perception_model(parts, perception), num_envs)
        super().__init__(core, AnalyticWeeder(), autoreset_mode)


class LaserWeedingEnv(WeedingEnv):
    """Burn weeds from a cart that never stops (``fieldgym/LaserWeeding-v0``).

    A cart drives along a crop row at a constant speed. A front camera finds plants, tracks carry them to the tool; a
    3UPS-RPU platform (Wang et al.) under the cart aims a laser, follows the weed while the beam burns, and a camera
    beside the laser corrects the aim before every shot. Time passes with every decision: weeds come into the window
    at its front edge and leave it at the rear. The episode is a strip of field; it ends when the strip has passed.

    **Action**, ``Discrete(3 K + 1)``: ``slot * 3 + dose`` with dose 0 low (30 J), 1 normal (75 J), 2 high (200 J) fires
    at a candidate; ``3 K`` waits a moment (0.1 s). Slots are in the order in which their weeds leave the window. What
    cannot be followed for the whole burn is masked; a weed that is up to 0.4 s in front of the window may be chosen,
    the beam then waits for it. An illegal action does nothing, costs 0.25 s and is counted.

    **Observation**, a ``Dict`` of float32 boxes scaled to order one:

    - ``machine`` (7,): ``place`` of the platform before the cart's middle / 0.15 m, ``lean_along`` and ``lean_across``
      of the beam / 0.2 m, ``speed`` and ``set_speed`` of the cart / 0.1 m/s, ``progress`` of the cart / strip,
      ``backlog`` candidates / K.
    - ``candidates`` (K x 11,), a table (``candidate_table`` gives it its two axes), empty rows zero: ``present``,
      ``along`` report minus cart / 0.3 m, ``across`` / 0.2 m, ``leaves`` seconds until it leaves the window / 4 s,
      ``move`` seconds to get there / 0.5 s, ``wait`` seconds until it is within the window then / 0.5 s (normal dose),
      ``grass`` reported species, one-hot reported stage (cotyledon, two-leaf, four-leaf), ``crop_gap`` reported
      distance to the nearest crop plant / 0.05 m, at most 4.
    - ``action_mask`` (3 K + 1,) int8; also in ``info["action_mask"]`` and ``env.action_masks()``.

    **Reward**: the sum of ``info["rewards"]``, in weeds: ``killed``, ``crop`` (-5 a crop plant that dies), ``time``
    (-0.05 a second), ``energy`` (-0.0005 a joule).

    **Score**: ``info["scorecard"]``: ``net_rate`` = killed / all true weeds of the band, ``cycle_time_s`` = time until
    the last shot / shots, ``crop_loss_percent``, ``weeds_per_s``, ``joules_per_weed``, ``ha_per_h``, phases.

    Args:
        scenario: tiers by offered load: ``"load-0.7"``, ``"load-1.0"``, ``"load-1.25"``, ``"load-1.6"`` (40 weeds per
            m2, clumped), ``"load-1.0-even"``, ``"load-1.6-even"``, ``"dense"`` (100 per m2 at load 1).
        backend: ``"pybullet"`` drives the closed-loop machine on a moving cart, ``"analytic"`` computes its motion.
        perception: ``"camera"`` renders and segments images of both cameras, ``"model"`` draws from statistics measured
            on such images, ``"perfect"`` reports every weed where it is. Default: camera with PyBullet, model with the
            analytic backend.
        slots: candidates K shown at once.
        config: every number of the task; ``scenario`` and ``slots`` replace its own.
        render_mode: ``"rgb_array"``, ``"human"`` or None.

    Raises:
        ValueError: an argument is unknown or out of range; the message says what is allowed.
    """

    def __init__(
        self,
        scenario: str | None = None,
        backend: str = "pybullet",
        perception: str | None = None,
        slots: int | None = None,
        config: WeedingConfig | None = None,
        render_mode: str | None = None,
    ):
        """Build the environment; see the class."""
        super().__init__("laser", scenario, backend, perception, slots, config, render_mode)


class LaserWeedingSpeedEnv(LaserWeedingEnv):
    """``fieldgym/LaserWeeding-v0`` with the cart's speed in the action (``fieldgym/LaserWeedingSpeed-v0``).

    **Action**, ``Discrete(3 (3 K + 1))``: three blocks of the actions of ``fieldgym/LaserWeeding-v0``: the first holds
    the commanded speed, the second lowers it by a notch of 0.02 m/s while acting, the third raises it. Speeds stay
    within 0.03 ... 0.27 m/s; the cart takes 0.3 m/s2. The strip begins at the scenario's constant speed. A change of
    speed may carry a follow beyond the range that the mask has checked by up to the platform's reserve.

    Everything else is as there; the strip takes as long as the cart needs, at most ``time_factor`` times the driving
    time at the scenario's speed.
    """

    speed_control = True


class LaserWeedingVectorEnv(WeedingVectorEnv):
    """``num_envs`` worlds of ``fieldgym/LaserWeeding-v0`` in one batch, with the analytic backend.

    Args as in ``LaserWeedingEnv`` and ``TaskVectorEnv``. PyBullet machines run one a process: use
    ``vectorization_mode="async"`` for those.
    """

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str | None = None,
        backend: str = "analytic",
        perception: str | None = None,
        slots: int | None = None,
        config: WeedingConfig | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
    ):
        """Build the environment; see the class."""
        super().__init__("laser", num_envs, scenario, backend, perception, slots, config, autoreset_mode, render_mode)


class LaserWeedingSpeedVectorEnv(LaserWeedingVectorEnv):
    """``num_envs`` worlds of ``fieldgym/LaserWeedingSpeed-v0`` in one batch, with the analytic backend."""

    speed_control = True


def field_task(
    tool: Tool, config: FieldTask | None, scenario: str | None, slots: int | None, speed_control: bool
) -> FieldTask:
    """The configuration with a named scenario, a number of slots and the kind of action put in.

    Raises:
        ValueError: the configuration is another tool's, or a name is unknown.
    """
    if config is not None and not isinstance(config, tool.config):
        raise ValueError(f"config is a {type(config).__name__}: give a {tool.config.__name__}, or another tool")
    return configured(config or tool.config(), SCENARIOS, scenario, slots=slots, speed_control=speed_control)


def perception_model(tool: Tool, perception: str) -> PerceptionModel | None:
    """Statistics behind a perception level; None when tracks come from a camera."""
    if perception == "camera":
        return None
    if perception == "perfect":
        return PerceptionModel.perfect()
    return PerceptionModel.measured() if tool.corrects else uncorrected(PerceptionModel.measured())


@lru_cache(maxsize=1)
def uncorrected(model: PerceptionModel) -> PerceptionModel:
    """The model of the same cameras where none looks from beside the tool: it works where the tracks say."""

    def blind(classes: tuple[tuple[tuple[float, ...], ...], ...]) -> tuple[tuple[tuple[float, ...], ...], ...]:
        return tuple(tuple((*row[:4], 0.0, *row[5:]) for row in rows) for rows in classes)

    return replace(model, sightings=blind(model.sightings), false_sightings=blind(model.false_sightings))
