"""The Gymnasium environments of the safflower picker."""

from __future__ import annotations

from typing import Any

from ..assembly import Assembly
from ..references import later
from ..single import TaskEnv
from ..vector import TaskVectorEnv
from .config import PRESETS, SCENARIOS, PerceptionModel, SafflowerConfig
from .core import PickerOutcome, SafflowerCore
from .motors import within_motors
from .state import PickerPlan

DECISION_S = {"pots": 11.4, "row-sparse": 13, "row": 13.4, "row-dense": 13.7, "field": 13.7, "bag": 15}
"""Seconds that a decision takes on average, by scenario [30 episodes of the reference policy]."""
PICKER: Assembly[Any] = Assembly(
    config=SafflowerConfig,
    scenarios=SCENARIOS,
    core=SafflowerCore,
    perfect=lambda config: PerceptionModel.perfect(),
    measured=lambda config: PerceptionModel.measured(config.scenario.camera_fit),
    machine=later("fieldgym.envs.safflower.machine:PyBulletPicker"),
    view=later("fieldgym.envs.safflower.view:PickerView"),
    cameras=("machine", "overview", "tool", "front"),
    decision_s=DECISION_S,
    belief=later("fieldgym.envs.safflower.belief:belief"),
    within_motors=within_motors,
    rates=later("fieldgym.envs.safflower.rates:rates_of"),
    presets=PRESETS,
    settings={"slots": "slots"},
)


class SafflowerPickingEnv(TaskEnv[PickerPlan, PickerOutcome]):
    """Pick safflower filaments with a planar five-bar on a cart that stops (``fieldgym/SafflowerPicking-v0``).

    A cart carries a camera and, behind it, a two-degree-of-freedom five-bar that works in the vertical plane across
    the row. At every stop the camera reports heads; each decision sends the tool to one of them, or drives on. The
    tool shears the filaments with reciprocating strokes and sucks them into a box (Guo et al. 2022, Eng. Agric. 42(1)
    e20210129). The episode ends when the machine leaves the last stop; it is truncated at the scenario's time limit.

    **Action**, ``Discrete(3 K + 1)``: ``slot * 3 + effort`` with effort 0 quick (1 stroke, 1 s of suction), 1 normal
    (2, 2 s), 2 thorough (3, 3 s); ``3 K`` drives to the next stop, at the last one it ends the episode. Empty slots
    and heads out of reach are masked; an illegal action does nothing, costs one second and is counted.

    **Where the order matters** (``"bag"``): two rows are picked from the same stops, the bag fills up, and heads wilt:
    a pick that is not done before its head's window closes brings nothing. The fuller the bag, the more of what is cut
    drops beside it; a full one masks all picks. Action ``3 K + 1`` empties it (20 s) without a motion, so there are
    3 K + 2. ``machine`` shows a seventh number, ``bag`` filaments in it / what fills it; a candidate two more:
    ``closes`` reported time left until it wilts / 100 s (0 after it) and ``row``, 0 the right-most to 1 the left-most.
    ``perception="perfect"`` tells ``closes`` as it is, ``"model"`` with an error of 30 s, ``"camera"`` as the mean of
    the head's stage.

    **Observation**, a ``Dict`` of float32 boxes in [-10, 10]. Features are scaled to order one; what would be larger
    than 10 is shown as 10 (``time`` after the limit, ``remaining`` with few slots, places far away):

    - ``machine`` (6,): ``ahead`` arm plane minus the stop's centre along the row / 0.3 m, ``across`` / 0.15 m,
      ``height`` above the traverse level / 0.2 m (never positive), ``time`` / time limit, ``stops_left`` / stops,
      ``remaining`` reports at this stop / K.
    - ``candidates`` (K x 11,), a table in row order (``candidate_table`` gives it its two axes): the reports of this
      stop in the fixed order, empty rows zero: ``present``, ``along`` report
      minus arm plane / 0.3 m, ``across`` / 0.15 m, ``height`` / 0.2 m, ``travel`` time to get there / 4 s, one-hot
      reported stage (``bud``, ``fresh``, ``late``, ``dry``), ``size`` filament spread / 0.05 m, ``reachable``.
    - ``action_mask`` (3 K + 1,) int8; also in ``info["action_mask"]`` and ``env.unwrapped.action_masks()``.

    **Reward**: the sum of ``info["rewards"]``, in grams: ``collected`` filaments, ``lost`` ones that a pick left on
    the head or dropped (-0.25 a gram), ``time`` (-0.008 a second).

    **Score**: ``info["scorecard"]``: ``net_rate`` = collected / all filaments of open heads in the field (eq. 35),
    ``cycle_time_s`` = time until the last head was done / heads done (eq. 34), throughput, phases, grams.

    Args:
        scenario: ``"pots"`` (the paper's protocol), ``"row-sparse"``, ``"row"``, ``"row-dense"``,
            ``"field"`` (a worn machine on rough ground) or ``"bag"`` (a bag that fills up, heads that wilt).
        backend: ``"pybullet"`` drives the closed-loop machine, ``"analytic"`` computes the same motion.
        perception: ``"camera"`` renders and segments images, ``"model"`` draws from statistics measured on such
            images, ``"perfect"`` reports every open or faded head where it is. Default: camera with PyBullet, model
            with the analytic backend.
        slots: candidates K shown at once.
        config: every number of the task; ``scenario`` and ``slots`` replace its own.
        render_mode: ``"rgb_array"``, ``"human"`` or None.

    Raises:
        ValueError: an argument is unknown or out of range; the message says what is allowed.
    """

    assembly = PICKER


class SafflowerPickingVectorEnv(TaskVectorEnv[PickerPlan, PickerOutcome]):
    """``num_envs`` worlds of ``fieldgym/SafflowerPicking-v0`` in one batch, with the analytic backend."""

    assembly = PICKER
