"""The Gymnasium environments of the laser weeder."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ....assembly import Assembly
from ....references import later
from ....single import TaskEnv
from ....vector import TaskVectorEnv
from ...config import BATTERY, DEMANDS, SCENARIOS, WORTH
from ...core import WeederOutcome, WeedingCore
from ...perception import PerceptionModel
from ...ridges import Ridges
from ...state import WeederPlan
from .aim import LaserArm
from .config import PRESETS, WeedingConfig
from .errors import LaserCore
from .motors import within_motors
from .process import LaserProcess


def laser_core(config: WeedingConfig, perception: PerceptionModel | None, worlds: int = 1) -> WeedingCore:
    """The weeding rules with the laser as their tool."""
    arm = LaserArm.of(config.aim, config.cart.early_s, Ridges.of(config.scenario))
    return LaserCore(config, arm, LaserProcess(config.process), perception, worlds)


DECISION_S = {
    "load-0.7": 0.22,
    "load-1.0": 0.32,
    "load-1.25": 0.42,
    "load-1.6": 0.49,
    "load-1.0-even": 0.5,
    "load-1.6-even": 0.59,
    "dense": 0.31,
    "field": 0.42,
}
"""Seconds that a decision takes on average, by scenario [30 episodes of the reference policy]."""
LASER: Assembly[Any] = Assembly(
    config=WeedingConfig,
    scenarios={**SCENARIOS, **BATTERY, **WORTH},
    core=laser_core,
    perfect=lambda config: PerceptionModel.perfect(),
    measured=lambda config: PerceptionModel.measured(config.eyes, config.pictures),
    machine=later("fieldgym.envs.weeding.tools.laser.machine:PyBulletWeeder"),
    view=later("fieldgym.envs.weeding.tools.laser.view:WeederView"),
    cameras=("machine", "overview", "tool", "front"),
    decision_s=DECISION_S,
    belief=later("fieldgym.envs.weeding.belief:belief"),
    within_motors=within_motors,
    rates=later("fieldgym.envs.weeding.tools.laser.rates:rates_of"),
    presets=PRESETS,
    settings={"slots": "slots", "eyes": "eyes", "pictures": "pictures"},
    fixed={"speed_control": False},
)


class LaserWeedingEnv(TaskEnv[WeederPlan, WeederOutcome]):
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
    - ``candidates`` (K x 13,), a table (``candidate_table`` gives it its two axes), empty rows zero: ``present``,
      ``along`` report minus cart / 0.3 m, ``across`` / 0.2 m, ``leaves`` seconds until it leaves the window / 4 s,
      ``move`` seconds to get there / 0.5 s, ``wait`` seconds until it is within the window then / 0.5 s (normal dose),
      ``grass`` reported species, one-hot reported stage (cotyledon, two-leaf, four-leaf), ``crop_gap`` reported
      distance to the nearest crop plant / 0.05 m, at most 4, ``confidence`` how sure the cameras are that it is a weed
      (1 where everything is seen as it is), ``done`` dose that own shots so far have put on the reported place / the
      one that kills half of its kind, at most 10, as aimed, whichever candidate they were aimed at.
    - ``action_mask`` (3 K + 1,) int8; also in ``info["action_mask"]`` and ``env.unwrapped.action_masks()``.

    **Reward**: the sum of ``info["rewards"]``, in weeds: ``killed`` (in ``"worth"`` what they count), ``crop`` (-5 a
    crop plant that dies), ``time`` (-0.05 a second), ``energy`` (-0.0005 a joule), ``leaves`` (0, in ``"field"`` -1 for
    all leaves of a crop plant that lives).

    **Score**: ``info["scorecard"]``: ``net_rate`` = killed / all true weeds of the band, ``cycle_time_s`` = time until
    the last weed died / weeds killed (eq. 34 of the safflower paper), ``shot_time_s`` the same for shots,
    ``crop_loss_percent``, ``leaf_loss``, ``joules_per_weed``, ``ha_per_h``, phases.

    Args:
        scenario: tiers by offered load: ``"load-0.7"``, ``"load-1.0"``, ``"load-1.25"``, ``"load-1.6"`` (40 weeds per
            m2, clumped), ``"load-1.0-even"``, ``"load-1.6-even"``, ``"dense"`` (100 per m2 at load 1), ``"field"`` (a
            worn machine on ground that shakes, at load 1.25), ``"ridged"`` (twin rows on ridges, at load 1.25),
            ``"battery"`` (4 kJ of light a strip, at load 1.25; ``machine`` shows an eighth number, what is left of it),
            ``"worth"`` (a weed counts by its stage: 0.3, 1 or 3, in reward and net rate; at load 1.25).
        backend: ``"pybullet"`` drives the closed-loop machine on a moving cart, ``"analytic"`` computes its motion.
        perception: ``"camera"`` renders and segments images of both cameras, ``"model"`` draws from statistics measured
            on such images, ``"perfect"`` reports every weed where it is. Default: camera with PyBullet, model with the
            analytic backend.
        slots: candidates K shown at once.
        pictures: ``"field"`` (as without a word) shows plants, light and soil that differ, ``"easy"`` plants of one
            shape and colour a kind on even ground.
        eyes: ``"learned"`` (as without a word) finds plants by a network for each camera, ``"classical"`` by colour and
            shape.
        config: every number of the task; ``scenario`` and ``slots`` replace its own.
        render_mode: ``"rgb_array"``, ``"human"`` or None.

    Raises:
        ValueError: an argument is unknown or out of range; the message says what is allowed.
    """

    assembly = LASER


class LaserWeedingSpeedEnv(LaserWeedingEnv):
    """``fieldgym/LaserWeeding-v0`` with the cart's speed in the action (``fieldgym/LaserWeedingSpeed-v0``).

    **Action**, ``Discrete(3 (3 K + 1))``: three blocks of the actions of ``fieldgym/LaserWeeding-v0``: the first holds
    the commanded speed, the second lowers it by a notch of 0.02 m/s while acting, the third raises it. Speeds stay
    within 0.03 ... 0.27 m/s; the cart takes 0.3 m/s2. The strip begins at the scenario's constant speed. A change of
    speed may carry a follow beyond the range that the mask has checked by up to the platform's reserve.

    **Demands**: ``"demand-0.90"`` and ``"demand-0.60"`` are as fast as you like down to a demanded share of the weeds:
    kills beyond it are worth nothing, every second costs.

    Everything else is as there; the strip takes as long as the cart needs, at most ``time_factor`` times the driving
    time at the scenario's speed.
    """

    assembly = replace(LASER, scenarios={**SCENARIOS, **DEMANDS}, fixed={"speed_control": True})


class LaserWeedingVectorEnv(TaskVectorEnv[WeederPlan, WeederOutcome]):
    """``num_envs`` worlds of ``fieldgym/LaserWeeding-v0`` in one batch, with the analytic backend."""

    assembly = LASER


class LaserWeedingSpeedVectorEnv(LaserWeedingVectorEnv):
    """``num_envs`` worlds of ``fieldgym/LaserWeedingSpeed-v0`` in one batch, with the analytic backend."""

    assembly = LaserWeedingSpeedEnv.assembly
