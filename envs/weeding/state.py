"""What the weeding rules work on: the running numbers of B worlds, and the names of what they count and score."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import allocated, shaped
from ..columns import Says, names, numbered
from ..core import COMMON_SCORES, Array
from ..shaking import Shape, Surface
from .config import SPECIES, STAGES, FieldTask
from .features import Lasting
from .ground import shape_of, span
from .perception import TOOL_GATE_M
from .process import WeedingProcess
from .timing import Arm, Coordinates, move_time

MODES = 3
WAIT, NOTHING = MODES, MODES + 1
"""Kinds of decision after the three modes: wait a moment, an illegal action."""
BLOCKS = 3
"""The speed variant's blocks of actions: hold the speed, slower, faster."""
CROP_KIND = len(STAGES)
"""Kind of a crop plant; the kinds before it are the weeds' stages."""
PAD = 2
"""Empty places before and after the weeds of a world, so that a weed's neighbours always exist."""
FAR_M = 1e3
"""Where what does not exist lies."""


class Totals(NamedTuple):
    """What is counted in an episode."""

    time: Annotated[int, Says("s", "simulated time since the episode began")]
    killed: Annotated[int, Says("", "weeds that died")]
    crop: Annotated[int, Says("", "crop plants that died")]
    leaves: Annotated[int, Says("", "leaf area that living crop plants lost, in whole plants")]
    illegal: Annotated[int, Says("", "actions that were not possible")]
    shots: Annotated[int, Says("", "works on a place")]
    blanks: Annotated[int, Says("", "those at a track without a weed")]
    joules: Annotated[int, Says("J", "energy of all works")]
    last_shot: Annotated[int, Says("s", "when the last work was done")]
    last_kill: Annotated[int, Says("s", "when the last work was done that killed a weed")]
    worth: Annotated[int, Says("", "what the weeds that died count")]


class Rewards(NamedTuple):
    """Terms of the reward; each is its quantity times its weight."""

    killed: Annotated[
        int, Says("", "what the weeds that died count, one each where the scenario does not say otherwise")
    ]
    crop: Annotated[int, Says("", "crop plants that died")]
    time: Annotated[int, Says("s", "seconds")]
    energy: Annotated[int, Says("J", "energy of the work")]
    leaves: Annotated[int, Says("", "leaf area that living crop plants lost, in whole plants")]


class Common(NamedTuple):
    """The scores before the phases: those that every task has."""

    net_rate: Annotated[
        int, Says("", "what weeds that died count / what all true weeds of the band do, missed ones too")
    ]
    cycle_time_s: Annotated[int, Says("s", "time until the last weed died / weeds that died")]
    throughput_per_min: Annotated[int, Says("1/min", "weeds that died a minute")]
    duration_s: Annotated[int, Says("s", "simulated time")]
    done: Annotated[int, Says("", "weeds that died")]
    missed: Annotated[int, Says("", "weeds that live")]
    damaged: Annotated[int, Says("", "crop plants that died")]
    illegal: Annotated[int, Says("", "actions that were not possible")]


class Own(NamedTuple):
    """The scores behind the phases: those of weeding alone."""

    crop_loss_percent: Annotated[int, Says("%", "crop plants of the strip that died")]
    leaf_loss: Annotated[int, Says("", "mean share of their leaf area that crop plants of the strip lost alive")]
    joules_per_weed: Annotated[int, Says("J", "energy of all works / weeds that died")]
    ha_per_h: Annotated[int, Says("ha/h", "area that the cart has driven over, an hour")]
    shots: Annotated[int, Says("", "works on a place")]
    blank_shots: Annotated[int, Says("", "those at a track without a weed")]
    shot_time_s: Annotated[int, Says("s", "time until the last work / works")]
    weeds: Annotated[int, Says("", "true weeds of the band")]
    tracks: Annotated[int, Says("", "tracks so far")]


class Speeds(NamedTuple):
    """The cart's speeds of a decision."""

    before: Annotated[int, Says("m/s", "at its beginning")]
    after: Annotated[int, Says("m/s", "the one that it changes to")]


class Near(NamedTuple):
    """Which plants a shot at a track may reach; for scoring alone."""

    weed: Annotated[int, Says("", "nearest weed along the row, counted without the empty places")]
    crop: Annotated[int, Says("", "nearest crop plant along the row")]


T, R, S, OWN = numbered(Totals), numbered(Rewards), numbered(Common), numbered(Own)
V, N = numbered(Speeds), numbered(Near)
assert names(Common) == COMMON_SCORES


class Tables(NamedTuple):
    """What the rules look up; the same in every world.

    Attributes:
        work_s: (M, P), seconds of each phase on the target by mode.
        stand_s: (M,), their sums.
        energy_j: (M,).
        pause_s: (2,), what waiting a moment and an illegal action take at least.
        weights: (5,), of the reward's terms; see ``Rewards``.
        weeds_end: weeds lie before this place of the plants, crop plants behind it.
        start_m: the cart begins this far before the strip.
        crop_beside: so many crop plants before and behind the nearest one along may be in reach of a shot too.
        strip_m: length of the strip.
        end_m: cart position at which the strip has passed the window.
        blind_m: way of the cart from which the front camera's view has left a place until it has left the window.
        exit_m: the window's rear edge behind the cart.
        delay_s: from a picture to the use of what it showed.
        speed_control: whether actions include the cart's speed.
        notch_m_s: step of the commanded speed.
        speed_range_m_s: of the commanded speed.
        acceleration_m_s2: of the cart.
        ha_s_per_m_h: hectares an hour at a metre a second.
        time_limit_s: when the episode is cut off.
        looks_after: whether a camera beside the tool looks after the move and its correction is a motion of its own.
        gate_m: how far from where it looks it finds a plant.
        believes: whether tracks say where a plant will be believed when it is under the tool's middle; else now.
        depths_m: (M,), how deep the tool works in the ground, by mode.
        shape: of frame and tool on ground that is not level.
        demanded: share of the weeds beyond which kills are worth nothing, 0 where all count.
        leaf_m: how far a crop plant's leaves reach.
        worth: (species, stage), what a weed counts.
        budget_j: energy that all works may take, infinite where it is not scarce.
        half: (species, stage), dose that kills half of a kind of weed.
        in_order: whether tracks lie in the order of their reports along the row; those of pictures do not.
    """

    work_s: Array
    stand_s: Array
    energy_j: Array
    pause_s: Array
    weights: Array
    weeds_end: int
    start_m: float
    crop_beside: int
    strip_m: float
    end_m: float
    blind_m: float
    exit_m: float
    delay_s: float
    speed_control: bool
    notch_m_s: float
    speed_range_m_s: tuple[float, float]
    acceleration_m_s2: float
    ha_s_per_m_h: float
    time_limit_s: float
    looks_after: bool
    gate_m: float
    believes: bool
    depths_m: Array
    shape: Shape
    demanded: float
    leaf_m: float
    worth: Array
    budget_j: float
    half: Array
    in_order: bool


class Worlds(NamedTuple):
    """State of the worlds, each array's first axis; places are metres along and across."""

    plant: Annotated[Array, shaped("plants", 2, empty=FAR_M)]
    """Weeds sorted along with empty places before and after them, then the crop plants in order."""
    plant_kind: Annotated[NDArray[np.int64], shaped("plants")]
    """Stage of a weed, 3 for a crop plant."""
    plant_tolerance: Annotated[Array, shaped("plants", empty=np.inf)]
    """Dose that kills; infinite where nothing grows."""
    plant_worth: Annotated[Array, shaped("plants", empty=1)]
    """What it counts when it dies."""
    plant_dose: Annotated[Array, shaped("plants")]
    """Dose so far."""
    leaf_lost: Annotated[Array, shaped("crops")]
    """Share of a crop plant's leaf area that is lost."""
    weeds: Annotated[Array, shaped()]
    """True weeds of the strip."""
    worth: Annotated[Array, shaped()]
    """What they count."""
    crops_in_strip: Annotated[Array, shaped()]
    """Crop plants of the strip."""
    track_report: Annotated[Array, shaped("tracks", 2, empty=FAR_M)]
    """Where the machine believes a plant when it aims; the last track stands for none."""
    track_aim: Annotated[Array, shaped("tracks", 2, empty=FAR_M)]
    """Where the tool is set after its correction."""
    track_known_m: Annotated[Array, shaped("tracks")]
    """Cart position from which on a track is known, not counting the delay; ascending."""
    track_near: Annotated[NDArray[np.int64], shaped("tracks", Near, empty=1)]
    """See ``Near``."""
    track_real: Annotated[NDArray[np.bool_], shaped("tracks")]
    """Whether a weed is behind it; for scoring alone."""
    track_feature: Annotated[NDArray[np.float32], shaped("tracks", Lasting)]
    """What does not depend on where the machine is; what it has done here adds up."""
    track_count: Annotated[NDArray[np.int64], shaped()]
    """Tracks known to the rules, those to come included."""
    slot_track: Annotated[NDArray[np.int64], shaped("slots", empty="tracks")]
    """Track in each slot."""
    cursor: Annotated[NDArray[np.int64], shaped()]
    """Next track that has not been in a slot."""
    cart: Annotated[Array, shaped()]
    """Its place, metres along the row."""
    speed: Annotated[Array, shaped(empty=1)]
    """Of the cart, m/s."""
    set_speed: Annotated[Array, shaped(empty=1)]
    """The commanded speed."""
    place: Annotated[Array, shaped(Coordinates)]
    """Where the arm stands; see ``timing.Coordinates``."""
    totals: Annotated[Array, shaped(Totals)]
    """See ``Totals``."""
    phases_s: Annotated[Array, shaped("phases")]
    """Seconds so far."""
    surface: Annotated[Array, shaped("rows", Surface)]
    """The ground along the row; no rows where it is a plane."""


class WeederPlan(NamedTuple):
    """What the machine has to do in each world.

    Attributes:
        kind: (B,), mode, ``WAIT`` or ``NOTHING``.
        slot: (B,), candidate slot, ``slots`` when none.
        track: (B,), track behind it.
        start: (B, 3), place of the arm now.
        target: (B, 3), where it stands during the work, the tool camera's correction included.
        aim: (B, 2), where the tool works in the world, metres; far away when it does not.
        cart: (B,), cart position at the beginning.
        speed: (B, 2), see ``Speeds``.
        phases_s: (B, P), nominal seconds of each phase, in order: those of ``timing.Moving``, the process's own, pause.
        correction: (B, 2), the part of the way to the target that is a second motion, in the tool's first own phase.
    """

    kind: NDArray[np.int64]
    slot: NDArray[np.int64]
    track: NDArray[np.int64]
    start: Array
    target: Array
    aim: Array
    cart: Array
    speed: Array
    phases_s: Array
    correction: Array


def tables_of(
    config: FieldTask, arm: Arm, process: WeedingProcess, delay_s: float, believes: bool, in_order: bool
) -> Tables:
    """The tables of a configuration; tracks are used ``delay_s`` after the pictures that they come from."""
    scenario, cart, weights = config.scenario, config.cart, config.weights
    leaves = weights.leaves if scenario.leaves_count else 0.0
    # A target must stay in reach for the longest correction too.
    spare_s = float(move_time(arm, TOOL_GATE_M, 0.0, TOOL_GATE_M)) if config.looks_after else 0.0
    return Tables(
        work_s=np.ascontiguousarray(process.work_s, dtype=np.float64),
        stand_s=process.work_s.sum(axis=1) + spare_s,
        energy_j=np.asarray(process.energy_j, dtype=np.float64),
        pause_s=np.array([cart.moment_s, cart.illegal_s], float),
        weights=np.array([weights.killed, weights.crop, weights.seconds, weights.joules, leaves], float),
        weeds_end=scenario.max_weeds + 2 * PAD,
        start_m=float(cart.start_m),
        crop_beside=int(scenario.bed.beside),
        strip_m=float(scenario.strip_m),
        end_m=float(scenario.strip_m + arm.front_m),
        blind_m=float(cart.unseen_m + arm.front_m),
        exit_m=float(arm.front_m),
        delay_s=delay_s,
        speed_control=bool(config.speed_control),
        notch_m_s=float(cart.notch_m_s),
        speed_range_m_s=(float(cart.speed_range_m_s[0]), float(cart.speed_range_m_s[1])),
        acceleration_m_s2=float(cart.acceleration_m_s2),
        ha_s_per_m_h=0.36 * scenario.band_m,
        time_limit_s=float(config.time_limit_s),
        looks_after=bool(config.looks_after),
        gate_m=TOOL_GATE_M,
        believes=believes,
        depths_m=np.array(config.depths_m, float),
        shape=shape_of(config),
        demanded=float(scenario.demanded),
        leaf_m=float(scenario.leaf_m),
        worth=np.array(scenario.worth, float),
        budget_j=float(scenario.energy_j) if scenario.energy_j > 0.0 else np.inf,
        half=process.response.half_of(*np.indices((len(SPECIES), len(STAGES)))),
        in_order=in_order,
    )


def empty_worlds(config: FieldTask, phases: int, tracks: int, worlds: int) -> Worlds:
    """State of worlds that hold nothing yet, with room for ``tracks`` tracks and sums of ``phases`` phases."""
    scenario = config.scenario
    weeds_end = scenario.max_weeds + 2 * PAD
    plants = weeds_end + scenario.crops
    rows = span(config)[1] if scenario.ground.uneven else 0
    sizes = {
        "plants": plants,
        "crops": scenario.crops,
        "tracks": tracks + 1,
        "slots": config.slots,
        "phases": phases,
        "rows": rows,
    }
    state = allocated(Worlds, worlds, **sizes)
    state.plant_kind[:, weeds_end:] = CROP_KIND
    return state
