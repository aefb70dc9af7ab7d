"""The Gymnasium environments of the produce sorter."""

from __future__ import annotations

from typing import Any

from ..assembly import Assembly
from ..references import later
from ..single import TaskEnv
from ..vector import TaskVectorEnv
from .config import PRESETS, SCENARIOS, PerceptionModel, SortingConfig
from .core import SorterOutcome, SortingCore
from .motors import within_motors
from .state import SorterPlan

DECISION_S = {
    "load-0.7": 1.64,
    "load-1.0": 1.68,
    "load-1.25": 1.62,
    "load-1.6": 1.58,
    "clumped-1.25": 1.4,
    "field": 1.4,
    "orders": 1.64,
}
"""Seconds that a decision takes on average, by scenario [30 episodes of the reference policy]."""
SORTER: Assembly[Any] = Assembly(
    config=SortingConfig,
    scenarios=SCENARIOS,
    core=SortingCore,
    perfect=lambda config: PerceptionModel.perfect(),
    measured=lambda config: PerceptionModel.measured(),
    machine=later("fieldgym.envs.sorting.machine:PyBulletSorter"),
    view=later("fieldgym.envs.sorting.view:SorterView"),
    cameras=("machine", "overview", "tool"),
    decision_s=DECISION_S,
    belief=later("fieldgym.envs.sorting.belief:belief"),
    within_motors=within_motors,
    rates=later("fieldgym.envs.sorting.rates:rates_of"),
    presets=PRESETS,
    settings={"slots": "slots"},
)


class ProduceSortingEnv(TaskEnv[SorterPlan, SorterOutcome]):
    """Sort produce from a moving belt with the six-degree-of-freedom 3-PRRS (``fieldgym/ProduceSorting-v0``).

    Tubers and fruits of four grades come down a belt that never stops, at random places, yaws and tilts. An RGB-D
    camera upstream reports them. The machine over the belt (Du, Guo, Niu 2015, J. Shandong Univ. Technol. 29(5),
    which names sorting as a use) turns its two fingers to the item, follows the belt while it goes down, grips and
    lifts, and lets go over the bin of the reported grade beside the belt. Arrivals are Poisson, or come in clumps; at
    loads above 1 the machine cannot serve every item, and the question is which. The episode ends when the last item
    has passed.

    **Motion**: every leg is a quintic law under linear and angular speed and acceleration limits; the orientation
    turns on SO(3) about one axis. Following adds a smooth ramp to the belt's speed. Where an item can be gripped
    follows from the mechanism's limits at its yaw and tilt; waiting for it to come within reach is part of the pick.

    **Action**, ``Discrete(K + 1)``: k grips the item in slot k, K waits half a second. Empty slots and items that
    lean too far, or cannot be reached before they leave, are masked; an illegal action does nothing, costs 0.25 s of
    the belt's travel and is counted.

    **Observation**, a ``Dict`` of float32 boxes scaled to order one and cut off at +-10 (a wait has no bound itself):

    - ``machine`` (5,): ``x``, ``y`` of the platform / 0.2 m, ``turned`` sine of half its rotation, ``time`` / time
      limit, ``in_view`` reports shown / K.
    - ``candidates`` (K x 19,), a table in row order (``candidate_table`` gives it its two axes): the reports in the
      order in which they leave the reach, empty rows zero: ``present``, ``along`` and ``across`` of the platform over
      the item / 0.2 m, ``cos_2yaw``, ``sin_2yaw``, ``tilt`` / 0.35 rad, ``turn`` of the tool from level / 1 rad,
      ``length`` / 0.06 m, one-hot reported grade (ware, seed, ripe, green), ``value`` of the grade, ``quality``
      expected share of grips that hold, ``approach`` seconds until the tool is over it,
      ``wait`` before that / 4 s, ``cycle`` until the item is in its bin / 2 s, ``slack`` until it is too late / 4 s,
      ``possible``.
    - ``action_mask`` (K + 1,) int8; also in ``info["action_mask"]`` and ``env.unwrapped.action_masks()``.

    **Reward**: the sum of ``info["rewards"]``: ``placed`` (value of the grade), ``misplaced`` (-0.5 for a wrong bin),
    ``dropped`` (-0.5 on the way), ``wasted`` (-0.05 for a grip that held nothing).

    **Field**: a stream of produce (``ProduceField``): when each item passes, where it lies across the belt, its grade,
    how it lies and its luck, and what the camera says of it. A file needs ``passing_s``, ``across_m`` and ``grade``;
    rows of the kind ``orders`` (``grade``, ``count``, ``due_s``) are its order book, which is drawn where it has none.

    **Orders** (scenario ``"orders"``, or ``scenario.orders`` of any): lorries leave at cut-offs, each with lines that
    want a count of one grade. An item in the bin of its grade fills the open line of that grade that is due first, if
    it is let go by then; one that no line waits for brings ``surplus`` of its value. A bin that is full is swapped;
    whoever comes with an item before an empty one stands there waits over it (in the phase ``release``). ``net_rate``
    counts items that fill a line / items ordered, ``missed`` what was ordered and did not come in time; ``surplus``,
    ``swaps`` and ``lines_full`` stand behind the other scores. ``machine`` then has 32 more numbers, eight a grade: the
    bin's ``fill`` / what it holds, seconds until it is ``ready`` / 4 s, and of the three open lines that are due first
    what is ``left`` / 6 and until when they are ``due`` / 20 s. ``cycle`` holds the wait for a bin, and ``value`` is
    what the item would bring now.

    **Score**: ``info["scorecard"]``: ``net_rate`` = items in the right bin / all items of the stream, ``value_rate``
    the same by value, ``cycle_time_s`` = time until the last item was put into the right bin / items in the right bin
    (eq. 34), ``pick_cycle_s`` the same for items put down in whichever bin, ``picks_per_min``, ``misplaced``,
    ``damaged`` (slipped out of the fingers on the way), ``wasted``, ``missed``, phases.

    Args:
        scenario: ``"load-0.7"``, ``"load-1.0"``, ``"load-1.25"``, ``"load-1.6"``, ``"clumped-1.25"``, ``"field"``
            (a worn machine) or ``"orders"`` (``"load-1.6"`` packed to order: four lorries, two lines each).
        backend: ``"pybullet"`` drives the closed-loop machine, ``"analytic"`` computes the same motion.
        perception: ``"camera"`` renders images of the belt and finds the items in them, ``"model"`` draws from
            statistics measured on such images, ``"perfect"`` reports every item as it is. Default: camera with
            PyBullet, model with the analytic backend.
        slots: candidates K shown at once.
        config: every number of the task; ``scenario`` and ``slots`` replace its own.
        render_mode: ``"rgb_array"``, ``"human"`` or None.

    Raises:
        ValueError: an argument is unknown or out of range; the message says what is allowed.
    """

    assembly = SORTER


class ProduceSortingVectorEnv(TaskVectorEnv[SorterPlan, SorterOutcome]):
    """``num_envs`` worlds of ``fieldgym/ProduceSorting-v0`` in one batch, with the analytic backend."""

    assembly = SORTER
