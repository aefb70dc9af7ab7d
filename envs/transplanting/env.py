"""The Gymnasium environments of the tray transplanter."""

from __future__ import annotations

from typing import Any

from ...kernels.config import override
from ..assembly import Assembly
from ..references import later
from ..single import TaskEnv
from ..vector import TaskVectorEnv
from .config import ORDERS, PRESETS, SCENARIOS, SOURCE_TRAYS, TARGET_TRAYS, PerceptionModel, TransplantingConfig, tray
from .core import TransplantingCore, TransplantOutcome
from .motors import within_motors
from .rules import TransplantPlan


def _with_source(config: TransplantingConfig, cells: int) -> TransplantingConfig:
    return override(config, {"scenario.source": tray(cells, SOURCE_TRAYS, "source_tray")})


def _with_target(config: TransplantingConfig, cells: int) -> TransplantingConfig:
    return override(config, {"scenario.target": tray(cells, TARGET_TRAYS, "target_tray")})


DECISION_S = {
    "fill-low": 1.03,
    "fill": 1.02,
    "fill-high": 1.01,
    "replug-low": 0.76,
    "replug": 0.87,
    "replug-high": 0.95,
    "field": 0.95,
    "orders": 1.0,
}
"""Seconds that a decision takes on average, by scenario [30 episodes of the reference policy]."""
TRANSPLANTER: Assembly[Any] = Assembly(
    config=TransplantingConfig,
    scenarios={**SCENARIOS, **ORDERS},
    core=TransplantingCore,
    perfect=lambda config: PerceptionModel.perfect(),
    measured=lambda config: PerceptionModel.measured(config.scenario.source, config.scenario.target),
    machine=later("fieldgym.envs.transplanting.machine:PyBulletTransplanter"),
    view=later("fieldgym.envs.transplanting.view:TransplantView"),
    cameras=("machine", "overview", "tool"),
    decision_s=DECISION_S,
    belief=later("fieldgym.envs.transplanting.belief:belief"),
    within_motors=within_motors,
    rates=later("fieldgym.envs.transplanting.rates:rates_of"),
    presets=PRESETS,
    settings={"motion": "machine.motion", "source_tray": _with_source, "target_tray": _with_target},
)


class TrayTransplantingEnv(TaskEnv[TransplantPlan, TransplantOutcome]):
    """Move plug seedlings between trays with a planar parallel arm (``fieldgym/TrayTransplanting-v0``).

    A two-degree-of-freedom translational five-bar (Qi et al., CCTA 2011) works over two conveyors side by side. The
    left one presents a supply tray, the right one a target tray, each with one of its short rows under the arm. A
    pneumatic gripper pulls a plug out of a source cell, carries it over a gate path and sets it into a target cell; a
    conveyor moves its tray on by a row, or to the next tray. In the ``fill`` scenarios the target trays come empty, in
    the ``replug`` ones planted, with gaps and with poor seedlings that must be taken out first. The episode ends when
    the last target row leaves; it is truncated at the scenario's time limit.

    In ``orders`` each target tray is ordered: it wants one grade, healthy seedlings or poor ones (the second grade), by
    the time at which its lorry leaves. Three source trays with both grades stand on a carousel, the ordered trays on
    another. A row that a source tray moves on from is lost; a tray that is turned away waits with the row that it
    presented. An ordered tray leaves when it is moved on from its last row, or with its lorry; the episode ends when
    all have left.

    **Action**, ``Discrete(3 K + 2)``: ``pair * 3 + speed`` with ``pair = source column * target columns + target
    column`` and speed 0 gentle, 1 normal, 2 fast: the acceleration limit with a plug in the gripper, against the chance
    to lose or damage it. ``3 K`` moves the source conveyor on, ``3 K + 1`` the target conveyor. K is the number of
    pairs of the presented rows: the arm's window of 600 mm holds two trays of 540 x 280 mm only with their short sides
    across, so rows have 5 to 12 cells and every pair is an action. Pairs whose source cell is reported empty or whose
    target cell is reported healthy are masked; a target cell reported poor is cleared into the chute between the trays
    first. An illegal action does nothing, costs one second and is counted. In ``orders`` there are ``3 K + 4``: ``3 K``
    brings the next source tray, ``3 K + 1`` the next order that is open, ``3 K + 2`` and ``3 K + 3`` move the conveyors
    on within their trays, the last one sends the tray away from its last row and brings the next open order. A target
    cell is masked when it is reported to hold the ordered grade, cleared first when it holds the other one.

    **Observation**, a ``Dict`` of float32 boxes scaled to order one; what has no end of its own (seconds of a slow
    machine, the time behind a short limit) is held to 10:

    - ``machine`` (7,): ``place`` of the tool across / 0.3 m, ``down`` whether it is in a cell, ``time`` / time limit,
      ``source_rows`` left in the supply / all, ``target_rows`` left / all, ``ready`` source cells reported planted /
      columns, ``gaps`` target cells reported empty or poor / columns. In ``orders`` (43,), both carousels follow, each
      from the presented tray on: of three source trays ``rows`` behind the presented one / rows, ``first`` and
      ``second`` grade reported in that row / columns (0 before the tray was presented), ``share`` of the second grade
      in its sowing; of six orders ``open``, whether it wants the ``second`` grade, seconds ``left`` until its lorry
      leaves / 60, at most 10, ``cells`` still to be filled / cells; a place without a tray is zero.
    - ``candidates`` (K x 7,), a table in pair order (``candidate_table`` gives it its two axes), rows of impossible
      pairs zero: ``present``, ``source`` and ``target`` place across / 0.3 m, ``carry`` seconds at normal speed,
      ``approach`` seconds until the tool is at the source cell (with the clearing, without gripping), ``source_poor``
      and ``clear`` whether the cells are reported poor.
    - ``action_mask`` (3 K + 2,) int8; also in ``info["action_mask"]`` and ``env.unwrapped.action_masks()``.

    **Reward**: the sum of ``info["rewards"]``, in cells: ``planted`` healthy target cells gained or destroyed,
    ``spoiled`` healthy seedlings torn, lost, damaged or sent away with their row (-0.2 each), ``time`` (-0.2 a second).
    In ``orders`` a cell is gained with the ordered grade before the lorry leaves, and both grades can be spoiled.

    **Score**: ``info["scorecard"]``: ``net_rate`` = target cells that hold a healthy seedling / all target cells,
    ``cycle_time_s`` = time until the last success / seedlings planted, ``throughput_per_min``, phases, ``filled`` =
    share of the gaps that were closed, ``travel_m``, and what was damaged (torn, hurt or crushed), lost, wasted.

    Args:
        scenario: ``"fill-low"``, ``"fill"``, ``"fill-high"``, ``"replug-low"``, ``"replug"``, ``"replug-high"`` or
            ``"field"`` (a worn machine), ``"orders"`` (trays of two grades with due times, on carousels).
        backend: ``"pybullet"`` drives the closed-loop machine, ``"analytic"`` computes the same motion.
        perception: ``"camera"`` renders and classifies images, ``"model"`` draws from confusion matrices measured on
            such images, ``"perfect"`` reports every cell as it is. Default: camera with PyBullet, model with the
            analytic backend.
        motion: how gates are carried out: ``"stop-quintic"``, ``"stop-septic"``, ``"stop-fastest"``, ``"blended"`` or
            ``"time-optimal"``.
        source_tray: cells of the supply trays: 72, 128, 200 or 288.
        target_tray: cells of the target trays: 50 or 72.
        config: every number of the task; the arguments above replace its own.
        render_mode: ``"rgb_array"``, ``"human"`` or None.

    Raises:
        ValueError: an argument is unknown or out of range; the message says what is allowed.
    """

    assembly = TRANSPLANTER


class TrayTransplantingVectorEnv(TaskVectorEnv[TransplantPlan, TransplantOutcome]):
    """``num_envs`` worlds of ``fieldgym/TrayTransplanting-v0`` in one batch, with the analytic backend."""

    assembly = TRANSPLANTER
