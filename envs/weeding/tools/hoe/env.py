"""The Gymnasium environments of the hoe weeder."""

from __future__ import annotations

from typing import Any

from ....assembly import Assembly, choice
from ....references import later, resolved
from ....single import TaskEnv
from ....vector import TaskVectorEnv
from ...config import SCENARIOS
from ...core import WeederOutcome, WeedingCore
from ...perception import PerceptionModel, uncorrected
from ...ridges import Ridges
from ...state import WeederPlan
from .arm import HoeArm
from .config import PRESETS, HoeWeedingConfig
from .errors import HoeCore
from .motors import within_motors
from .process import HoeProcess


def hoe_core(config: HoeWeedingConfig, perception: PerceptionModel | None, worlds: int = 1) -> WeedingCore:
    """The weeding rules with the hoe as their tool."""
    arm = HoeArm.of(config.reach, config.cart.early_s, Ridges.of(config.scenario))
    return HoeCore(config, arm, HoeProcess(config.passing), perception, worlds)


DECISION_S = {
    "load-0.7": 0.22,
    "load-1.0": 0.28,
    "load-1.25": 0.34,
    "load-1.6": 0.4,
    "load-1.0-even": 0.5,
    "load-1.6-even": 0.7,
    "dense": 0.28,
    "field": 0.34,
}
"""Seconds that a decision takes on average, by scenario [30 episodes of the reference policy]."""
HOE: Assembly[Any] = Assembly(
    config=HoeWeedingConfig,
    scenarios=SCENARIOS,
    core=hoe_core,
    perfect=lambda config: PerceptionModel.perfect(),
    measured=lambda config: uncorrected(PerceptionModel.measured(config.eyes, config.pictures)),
    machine=later("fieldgym.envs.weeding.tools.hoe.machine:PyBulletHoe"),
    view=later("fieldgym.envs.weeding.tools.hoe.view:HoeView"),
    cameras=("machine", "overview", "tool", "front"),
    decision_s=DECISION_S,
    belief=later("fieldgym.envs.weeding.belief:belief"),
    within_motors=within_motors,
    rates=later("fieldgym.envs.weeding.tools.hoe.rates:rates_of"),
    presets=PRESETS,
    settings={"slots": "slots", "eyes": "eyes", "pictures": "pictures"},
    fixed={"speed_control": False},
)
TOOLS: dict[str, Any] = {"hoe": HOE, "laser": "fieldgym.envs.weeding.tools.laser.env:LASER"}
"""What the cart may carry: an ``Assembly``, or where it stands."""


class HoeWeedingEnv(TaskEnv[WeederPlan, WeederOutcome]):
    """Uproot weeds with a hoe from a cart that never stops (``fieldgym/HoeWeeding-v0``).

    The field of ``fieldgym/LaserWeeding-v0`` with another tool: under the cart hangs a 3-PRRS platform (Du, Guo, Niu)
    with a round hoe blade. It moves over the crop to a weed, plunges, is led once around it, and lifts, while the cart
    drives on: the platform follows the plant. What the blade sweeps is a disc; a weed is uprooted, or a crop plant
    lost, by the share of its root zone within the disc and the depth of the blade. There is no camera beside the tool:
    it works where the front camera's tracks and the odometry say. Equal seeds are equal fields, whichever the tool.

    **Action**, ``Discrete(3 K + 1)``: ``slot * 3 + intensity`` with intensity 0 gentle (12 mm deep, a disc of 19 mm
    radius), 1 normal (22 mm, 23 mm), 2 deep (35 mm, 27 mm) stirs at a candidate; ``3 K`` waits a moment (0.1 s). Slots
    are in the order in which their weeds leave the window. What cannot be followed for the whole stir is masked; a weed
    that is up to 0.4 s in front of the window may be chosen, the blade then waits over it. An illegal action does
    nothing, costs 0.25 s and is counted.

    **Observation**, a ``Dict`` of float32 boxes scaled to order one:

    - ``machine`` (7,): ``place`` of the blade before the cart's middle / 0.14 m, ``lean_along`` 0 (nothing leans),
      ``lean_across`` the blade's place across / 0.2 m, ``speed`` and ``set_speed`` of the cart / 0.1 m/s, ``progress``
      of the cart / strip, ``backlog`` candidates / K.
    - ``candidates`` (K x 13,), as in ``fieldgym/LaserWeeding-v0``.
    - ``action_mask`` (3 K + 1,) int8; also in ``info["action_mask"]`` and ``env.unwrapped.action_masks()``.

    **Reward**: the sum of ``info["rewards"]``, in weeds: ``killed``, ``crop`` (-5 a crop plant that is lost), ``time``
    (-0.05 a second), ``energy`` (-0.0005 a joule of work against the soil),
    ``leaves`` (0, in ``"field"`` -1 for all leaves of a crop plant that lives).

    **Score**: ``info["scorecard"]``: ``net_rate`` = uprooted / all true weeds of the band, ``cycle_time_s`` = time
    until the last weed was uprooted / weeds uprooted (eq. 34 of the safflower paper), ``shot_time_s`` the same for
    stirs, ``crop_loss_percent``, ``leaf_loss``, ``joules_per_weed``, ``ha_per_h``, phases (move, wait, plunge, stir,
    lift, pause).

    Args:
        scenario: tiers by offered load, as in ``fieldgym/LaserWeeding-v0``; the cart's speed follows from the load and
            from how long the tool takes.
        backend: ``"pybullet"`` drives the closed-loop machine, soil resisting its blade; ``"analytic"`` computes its
            motion.
        perception: ``"camera"`` renders and segments images of the front camera, ``"model"`` draws from statistics
            measured on such images, ``"perfect"`` reports every weed where it is. Default: camera with PyBullet, model
            with the analytic backend.
        slots: candidates K shown at once.
        pictures: ``"field"`` (as without a word) shows plants, light and soil that differ, ``"easy"`` plants of one
            shape and colour a kind on even ground.
        eyes: ``"learned"`` (as without a word) finds plants by a network for each camera, ``"classical"`` by colour and
            shape.
        config: every number of the task, a ``HoeWeedingConfig``; ``scenario`` and ``slots`` replace its own.
        tool: ``"hoe"``, or ``"laser"`` to meet the same fields with the laser.
        render_mode: ``"rgb_array"``, ``"human"`` or None.

    Raises:
        ValueError: an argument is unknown or out of range; the message says what is allowed.
    """

    assembly = HOE

    @classmethod
    def equipped(cls, settings: dict[str, Any]) -> tuple[Assembly[Any], dict[str, Any]]:
        """The parts of the tool that is asked for."""
        rest = dict(settings)
        return resolved(TOOLS[choice("tool", rest.pop("tool", "hoe"), tuple(TOOLS))]), rest


class HoeWeedingVectorEnv(TaskVectorEnv[WeederPlan, WeederOutcome]):
    """``num_envs`` worlds of ``fieldgym/HoeWeeding-v0`` in one batch, with the analytic backend."""

    assembly = HOE
    equipped = classmethod(HoeWeedingEnv.equipped.__func__)  # type: ignore[attr-defined]
