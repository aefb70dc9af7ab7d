"""What the picking rules work on: their tables, the state of the worlds, plans, and names for every column."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import allocated, shaped
from ..columns import Says, numbered
from ..core import Array
from .batch import stop_centres
from .config import SafflowerConfig
from .features import Candidate
from .process import Shears, dropped_share
from .timing import Rates, standing_s


class Rewards(NamedTuple):
    """Terms of the reward."""

    collected: Annotated[int, Says("g", "filaments in the box")]
    lost: Annotated[int, Says("g", "filaments that a pick left on the head or dropped")]
    time: Annotated[int, Says("s", "seconds")]


class Effort(NamedTuple):
    """What an effort does to a head."""

    strokes: Annotated[int, Says("", "shear strokes")]
    dropped: Annotated[int, Says("", "share of the cut filaments that drops on average")]


class Totals(NamedTuple):
    """What is added up in the course of an episode; one column a phase, in the order of ``Phases``."""

    time: Annotated[int, Says("s", "simulated time since the episode began")]
    done: Annotated[int, Says("", "open heads that were picked")]
    missed: Annotated[int, Says("", "open heads that were not picked")]
    damaged: Annotated[int, Says("", "buds that were cut")]
    illegal: Annotated[int, Says("", "actions that were not possible")]
    recognise: Annotated[int, Says("s", "time of this phase, as all that follow up to ``suck``")]
    drive: Annotated[int, Says("s", "see ``recognise``")]
    travel: Annotated[int, Says("s", "see ``recognise``")]
    settle: Annotated[int, Says("s", "see ``recognise``")]
    shear: Annotated[int, Says("s", "see ``recognise``")]
    suck: Annotated[int, Says("s", "see ``recognise``")]
    gained: Annotated[int, Says("g", "filaments in the box")]
    dropped: Annotated[int, Says("g", "filaments that were cut and fell beside it")]
    total: Annotated[int, Says("g", "filaments of all open heads before the first pick")]
    wasted: Annotated[int, Says("", "picks that finished no open head")]
    last: Annotated[int, Says("s", "when the last open head was picked")]
    bag: Annotated[int, Says("g", "filaments in the bag")]


class Told(NamedTuple):
    """What is reported of a head beside what is always shown."""

    closes: Annotated[int, Says("s", "when it wilts, since the episode began")]
    row: Annotated[int, Says("", "row that it stands in, 0 to 1")]


class Scores(NamedTuple):
    """The scorecard."""

    net_rate: Annotated[int, Says("", "collected / all filaments of open heads in the field (eq. 35)")]
    cycle_time_s: Annotated[int, Says("s", "time until the last open head was picked / open heads picked (eq. 34)")]
    throughput_per_min: Annotated[int, Says("1/min", "open heads picked a minute")]
    duration_s: Annotated[int, Says("s", "simulated time since the episode began")]
    done: Annotated[int, Says("", "open heads that were picked")]
    missed: Annotated[int, Says("", "open heads that were not picked")]
    damaged: Annotated[int, Says("", "buds that were cut")]
    illegal: Annotated[int, Says("", "actions that were not possible")]
    phase_recognise_s: Annotated[int, Says("s", "time of this phase, as all that follow up to ``phase_suck_s``")]
    phase_drive_s: Annotated[int, Says("s", "see ``phase_recognise_s``")]
    phase_travel_s: Annotated[int, Says("s", "see ``phase_recognise_s``")]
    phase_settle_s: Annotated[int, Says("s", "see ``phase_recognise_s``")]
    phase_shear_s: Annotated[int, Says("s", "see ``phase_recognise_s``")]
    phase_suck_s: Annotated[int, Says("s", "see ``phase_recognise_s``")]
    collected_g: Annotated[int, Says("g", "filaments in the box")]
    dropped_g: Annotated[int, Says("g", "filaments that were cut and fell beside it")]
    total_g: Annotated[int, Says("g", "filaments of all open heads before the first pick")]
    wasted: Annotated[int, Says("", "picks that finished no open head")]
    grams_per_min: Annotated[int, Says("g/min", "filaments in the box a minute")]
    stop: Annotated[int, Says("", "number of the present stop, from 0")]


R, E, T, S, D = numbered(Rewards), numbered(Effort), numbered(Totals), numbered(Scores), numbered(Told)


class Tables(NamedTuple):
    """What the rules look up; the same in every world.

    Attributes:
        standing_s: (kinds, phases), see ``timing.standing_s``.
        efforts: (3, 2), what each effort does, as ``Effort``.
        shears: numbers of the cut.
        rates: numbers of the motions.
        stop_pose: (S, 3), parked pose at each stop.
        look_pose: (S, 3), pose from which the camera sees each stop.
        weights: of the reward's terms, as ``Rewards``.
        time_limit_s: when the episode is cut off.
        from_outside: whether reports come from a camera, after each drive.
        bag_g: what fills the bag, infinite where nothing does.
        clog: share of the cut filaments that a full bag lets drop in addition.
    """

    standing_s: Array
    efforts: Array
    shears: Shears
    rates: Rates
    stop_pose: Array
    look_pose: Array
    weights: Array
    time_limit_s: float
    from_outside: bool
    bag_g: float
    clog: float


class Worlds(NamedTuple):
    """State of the worlds, each array's first axis; positions are (cart, u, v) metres as in ``PickerPlan``."""

    head_position: Annotated[Array, shaped("heads", 3)]
    """Places of heads; the last one stands for none."""
    head_stage: Annotated[NDArray[np.int64], shaped("heads")]
    """Index into ``STAGES``."""
    head_mass_g: Annotated[Array, shaped("heads")]
    """What is left on the head."""
    head_visited: Annotated[NDArray[np.bool_], shaped("heads")]
    """Whether the tool has been there."""
    head_odds: Annotated[Array, shaped("heads", 2, empty=1)]
    """What a head's luck multiplies the odds of its cut and of its collection with."""
    track_target: Annotated[Array, shaped("tracks", 3)]
    """Places of reports; the last one stands for none."""
    track_feature: Annotated[NDArray[np.float32], shaped("tracks", Candidate)]
    """What does not depend on where the arm is."""
    track_descent_s: Annotated[Array, shaped("tracks")]
    """Seconds down to it."""
    track_legal: Annotated[NDArray[np.bool_], shaped("tracks")]
    """Whether the tool reaches it."""
    track_head: Annotated[NDArray[np.int64], shaped("tracks", empty="heads")]
    """The head behind it, for scoring alone."""
    first: Annotated[NDArray[np.int64], shaped("stops")]
    """First report of each stop."""
    slot_report: Annotated[NDArray[np.int64], shaped("slots", empty="tracks")]
    """Report in each slot; the last slot is the empty one that driving on points at."""
    cursor: Annotated[NDArray[np.int64], shaped()]
    """Next report of this stop that has no slot yet."""
    stop_end: Annotated[NDArray[np.int64], shaped()]
    """End of this stop's reports."""
    remaining: Annotated[NDArray[np.int64], shaped()]
    """Reports of this stop that were not picked."""
    stop: Annotated[NDArray[np.int64], shaped()]
    """Number of the present one."""
    look_due: Annotated[NDArray[np.bool_], shaped()]
    """Whether a camera has to report."""
    pose: Annotated[Array, shaped(3)]
    """Where the machine stands."""
    rise_s: Annotated[Array, shaped()]
    """Seconds of the rise that the next decision begins with."""
    totals: Annotated[Array, shaped(Totals)]
    """See ``Totals``."""
    head_closes_s: Annotated[Array, shaped("wilting_heads")]
    """When each head has wilted; none where none wilts."""
    track_told: Annotated[Array, shaped("wilting_tracks", Told)]
    """What is reported of that, see ``Told``."""


class PickerPlan(NamedTuple):
    """What the picker has to do in each world; positions are (cart, u, v): cart along the row, tool in the arm's plane.

    Attributes:
        kind: (B,), effort index, ``DRIVE``, ``NOTHING``, ``FINISH`` or ``EMPTY``.
        slot: (B,), candidate slot, ``slots`` when none.
        report: (B,), the report behind it, the empty one when there is none.
        start: (B, 3), metres.
        target: (B, 3), metres.
        rise_s: (B,), seconds of the rise to the traverse level.
        beside_s: (B, 2), seconds of the cart's move and of the traverse across, which go on side by side.
        descent_s: (B,), seconds of the descent.
        phases_s: (B, phases), nominal seconds of each.
        next_rise_s: (B,), seconds of the rise that the next decision begins with.
    """

    kind: NDArray[np.int64]
    slot: NDArray[np.int64]
    report: NDArray[np.int64]
    start: Array
    target: Array
    rise_s: Array
    beside_s: Array
    descent_s: Array
    phases_s: Array
    next_rise_s: Array


def tables_of(config: SafflowerConfig, from_outside: bool) -> Tables:
    """The tables of a configuration; ``from_outside`` as in ``Tables``."""
    scenario, process, weights = config.scenario, config.process, config.weights
    stop_pose = stop_poses(config)
    return Tables(
        standing_s=standing_s(config),
        efforts=np.column_stack([process.strokes, [dropped_share(process, seconds) for seconds in process.suction_s]]),
        shears=Shears.of(process),
        rates=Rates.of(config),
        stop_pose=stop_pose,
        look_pose=stop_pose - [config.machine.picker.camera_ahead_m, 0.0, 0.0],
        weights=np.array([weights.collected_g, weights.lost_g, weights.seconds]),
        time_limit_s=scenario.time_limit_s,
        from_outside=from_outside,
        bag_g=float(scenario.bag.capacity_g) if scenario.bag.capacity_g > 0.0 else np.inf,
        clog=float(scenario.bag.clog),
    )


def stop_poses(config: SafflowerConfig) -> Array:
    """Pose (S, 3) at each stop with the tool parked and the arm at the middle of the stop's window."""
    stops = stop_centres(config.scenario)
    park = np.array([0.5 * config.machine.picker.five_bar.base_m, config.machine.clear_level_m])
    return np.column_stack([stops, np.tile(park, (len(stops), 1))])


def empty_worlds(config: SafflowerConfig, b: int) -> Worlds:
    """State of ``b`` worlds in which nothing grows."""
    scenario = config.scenario
    room_for = scenario.plants * scenario.max_heads, scenario.max_tracks, config.slots, scenario.stops
    heads, tracks, slots, stops = (most + 1 for most in room_for)
    wilting = {"wilting_heads": heads, "wilting_tracks": tracks} if scenario.demanding else {}
    wilting = wilting or {"wilting_heads": 0, "wilting_tracks": 0}
    return allocated(Worlds, b, heads=heads, tracks=tracks, slots=slots, stops=stops, **wilting)
