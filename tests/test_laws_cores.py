"""What the rules of every task say of themselves: decisions in words, states that cannot be, fields taken in whole."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.envs.safflower.config import EFFORTS
from fieldgym.envs.transplanting.config import HEALTHY, SPEEDS, TransplantingConfig
from fieldgym.envs.transplanting.core import TransplantingCore
from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.state import PAD
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.env import laser_core
from fieldgym.kernels.config import override

PICKER, TRAYS, SORTER = (f"fieldgym/{name}-v0" for name in ("SafflowerPicking", "TrayTransplanting", "ProduceSorting"))
WEEDERS = [f"fieldgym/{name}-v0" for name in ("LaserWeeding", "LaserWeedingSpeed", "HoeWeeding")]
IDS = [PICKER, TRAYS, SORTER, *WEEDERS]
LASER = "low", "normal", "high"
MODES = {WEEDERS[0]: LASER, WEEDERS[1]: LASER, WEEDERS[2]: ("gentle", "normal", "deep")}


def made(env_id: str, worlds: int = 1, **settings: Any) -> Any:
    env: Any = gym.make_vec(env_id, worlds, vectorization_mode="vector_entry_point", **settings)
    env.reset(seed=4)
    return env.unwrapped.core


def card(core: Any) -> dict[str, float]:
    return dict(zip(core.score_names, core.scores()[0].tolist(), strict=True))


def candidate(core: Any, observation: Any, slot: int) -> dict[str, float]:
    names = core.candidate_features
    row = observation["candidates"][0].reshape(-1, len(names))[slot]
    return dict(zip(names, map(float, row), strict=True))


def in_words(env_id: str, core: Any, action: int, legal: bool, seen: Any, grown: dict[str, float], terms: Any) -> str:
    """What a decision was, from its number, what was shown before it, and what it brought."""
    k = core.config.slots if env_id != TRAYS else core.config.scenario.pairs
    if env_id == PICKER:
        if action == 3 * k:
            stop = int(card(core)["stop"]) + 1
            return f"drive to stop {stop}/{core.config.scenario.stops}" if grown["stop"] else "leave the row"
        if not legal:
            return "illegal action"
        return f"pick slot {action // 3} {EFFORTS[action % 3]}: {grown['collected_g']:.3f} g in"
    if env_id == SORTER:
        if action == k or not legal:
            return "wait" if action == k else "illegal action"
        grade = max(("ware", "seed", "ripe", "green"), key=lambda name: candidate(core, seen, action)[name])
        words = {"done": "placed", "misplaced": "wrong bin", "damaged": "dropped", "wasted": "nothing held"}
        return f"{grade} from slot {action}: {next(word for name, word in words.items() if grown[name])},"
    if env_id == TRAYS:
        pair, speed = divmod(action, 3)
        if not legal:
            return "illegal action"
        if pair == k:
            side = action - 3 * k
            rows = (core.source_shape, core.target_shape)[side][0]
            row = int((core.state.source_row, core.state.target_row)[side][0]) + 1
            last = side == 1 and terms["over"]
            return "last target row leaves" if last else f"{('source', 'target')[side]} row {row}/{rows}"
        source, target = divmod(pair, core.target_shape[1])
        cleared = ", cleared first" if candidate(core, seen, pair)["clear"] else ""
        found = "" if grown["phase_carry_s"] else ": no plug gripped"
        return f"plug {source + 1} -> {target + 1}{cleared}, {SPEEDS[speed]}{found}"
    rest = action % (3 * k + 1)
    if rest == 3 * k or not legal:
        return "wait" if rest == 3 * k else "illegal action"
    effect = "weed dies" if grown["done"] else "no kill"
    harm = ", crop plant dies" if grown["damaged"] else ""
    return f"{MODES[env_id][rest % 3]} dose on slot {rest // 3}: {effect}{harm},"


@pytest.mark.parametrize("env_id", IDS)
def test_decisions_are_told_as_they_were(env_id):
    core, rng, told = made(env_id), np.random.default_rng(1), set()
    before = card(core)
    for number in range(70):
        seen = {name: values.copy() for name, values in core.observe().items()}
        mask = seen["action_mask"][0]
        pool = np.flatnonzero(mask == 0) if number % 9 == 4 else np.flatnonzero(mask)
        pool = pool if len(pool) else np.flatnonzero(mask)
        action = int(rng.choice(pool if number % 3 else pool[-2:]))
        plan = core.plan(np.array([action]))
        result = core.apply(plan, core.nominal(plan))
        after, over = card(core), bool(result.terminated[0])
        grown = {name: after[name] - before[name] for name in after}
        words = in_words(env_id, core, action, bool(mask[action]), seen, grown, {"over": over})
        digits = 1 if env_id == PICKER else 2
        seconds = f"{result.phases_s[0].sum():.{digits}f} s"
        joined = " " if words.endswith((" in", ",")) else ": "
        assert core.describe(plan, result) == f"{words}{joined}{seconds}"
        told.add(words.split(" ")[0])
        before = after
        if over or result.truncated[0]:
            break
    assert len(told) > 2


def limits(env_id: str, core: Any) -> dict[str, tuple[Any, int]]:
    """Where every index of a state stands, and how many things it may name."""
    state = core.state
    found: dict[str, Any]
    own: dict[str, Any]
    if env_id == PICKER:
        heads, reports, stops = state.head_mass_g.shape[1], state.track_legal.shape[1], len(core.tables.stop_pose)
        found = {"head_stage": 4, "track_head": heads, "stop": stops}
        found |= dict.fromkeys(("first", "slot_report", "cursor", "stop_end", "remaining"), reports)
        own = {"head_plant": core.config.scenario.plants, "plant_count": core.config.scenario.plants + 1}
    elif env_id == SORTER:
        found = {"report_item": state.item_truth.shape[1], "report_grade": 4}
        found, own = found | dict.fromkeys(("queue", "queued", "first", "slot_report"), state.number.shape[1]), {}
    elif env_id == TRAYS:
        found = dict.fromkeys(("source_cells", "target_cells", "source_reports", "target_reports"), 4)
        found |= {"source_row": core.source_shape[0] + 1, "target_row": core.target_shape[0] + 1}
        found |= {"place": 2 * (core.source_shape[1] + core.target_shape[1]) + 1}
        own = {"source_began": 4}
    else:
        tracks = state.track_aim.shape[1]
        found, own = (
            {"plant_kind": 4, "track_count": tracks, "slot_track": tracks, "cursor": tracks},
            {"plant_species": 2},
        )
    return {name: (getattr(state, name), n) for name, n in found.items()} | {
        name: (getattr(core, name), n) for name, n in own.items()
    }


@pytest.mark.parametrize("env_id", IDS)
def test_an_index_that_names_nothing_is_told(env_id):
    core = made(env_id)
    assert core.misplaced() == ""
    for name, (array, count) in limits(env_id, core).items():
        kept = array.flat[0]
        for value, wrong in ((count - 1, False), (count, True), (-1, True), (0, False)):
            array.flat[0] = value
            assert core.misplaced() == (name if wrong else ""), (name, value)
        array.flat[0] = kept
    assert core.misplaced() == ""


def test_a_shot_reaches_plants_that_are_there():
    core = made(WEEDERS[0])
    near, kinds = core.state.track_near, core.state.plant_kind
    # Weeds, with room on either side for those looked at, come before the crop plants; behind one there is another.
    weeds = core.weeds_end - PAD - 1
    crops = kinds.shape[1] - core.weeds_end
    for side, count in ((0, weeds), (1, crops - core.tables.crop_beside)):
        kept = near[0, 0, side]
        for value, wrong in ((count - 1, False), (count, True), (-1, True)):
            near[0, 0, side] = value
            assert core.misplaced() == ("track_near" if wrong else ""), (side, value)
        near[0, 0, side] = kept


@pytest.mark.parametrize("env_id", IDS)
def test_a_field_goes_into_its_own_world_and_counts_as_an_episode(env_id):
    core = made(env_id, 3)
    episodes, states = core.episode.copy(), [part.copy() for part in core.state]
    core.load(np.array([1]), core.stack([core.draw_field(np.random.default_rng(9))]))
    assert (core.episode - episodes).tolist() == [0, 1, 0]
    for part, before in zip(core.state, states, strict=True):
        if part.shape[:1] == (3,):
            assert np.array_equal(part[[0, 2]], before[[0, 2]], equal_nan=part.dtype.kind == "f")


def test_all_of_a_picker_s_field_is_taken_in():
    core = made(PICKER, 2, scenario="row")
    batch = core.stack([core.draw_field(np.random.default_rng(8))])
    core.load(np.array([1]), batch)
    heads, plants = batch.heads, batch.plants
    for own, given in (
        *((core.plant_base, plants.base), (core.plant_count, plants.count), (core.plant_height_m, plants.height_m)),
        *((core.plant_crown_m, plants.crown_m), (core.head_size_m, heads.size_m), (core.head_plant, heads.plant)),
        *((core.head_exists, heads.exists), (core.head_occluded, heads.occluded)),
    ):
        assert np.array_equal(own[1], given[0]) and np.any(own[1])


def test_trays_end_and_begin_with_nothing_to_do_behind_them():
    core = made(TRAYS, 2)
    batch = core.stack([core.draw_field(np.random.default_rng(8))])
    core.load(np.array([1]), batch)
    assert np.array_equal(core.source_began[1], batch.source[0])
    assert np.array_equal(core.source_looks[1], batch.source_lot[0])
    assert np.array_equal(core.target_looks[1], batch.target_lot[0])
    assert (core.state.target_cells[:, -1] == HEALTHY).all() and (core.state.target_reports[:, -1] == HEALTHY).all()
    last, over = len(core.observe()["action_mask"][0]) - 1, []
    for _ in range(core.target_shape[0]):
        plan = core.plan(np.full(2, last))
        over.append(bool(core.apply(plan, core.nominal(plan)).terminated.all()))
    assert over == [False] * (core.target_shape[0] - 1) + [True]
    seen = core.observe()
    assert not seen["action_mask"][:, : 3 * core.config.scenario.pairs].any()
    assert not seen["machine"][:, core.machine_features.index("gaps")].any()


def test_cameras_are_asked_for_rows_that_are_new():
    core = TransplantingCore(TransplantingConfig(), None, 1)
    core.reset_rows(np.array([0]), [np.random.default_rng(3)])
    n, m = core.source_shape[1], core.target_shape[1]
    state, one, two = core.state, np.ones(n, np.int8), 2 * np.ones(m, np.int8)
    core.receive(0, one, two)
    assert (state.source_reports[0, 0] == 1).all() and (state.target_reports[0, 0] == 2).all()
    core.receive(0, 0 * one, 0 * two)
    assert (state.source_reports[0, 0] == 1).all() and (state.target_reports[0, 0] == 2).all()
    plan = core.plan(np.array([len(core.observe()["action_mask"][0]) - 2]))
    core.apply(plan, core.nominal(plan))
    core.receive(0, 2 * one, 0 * two)
    assert (state.source_reports[0, 1] == 2).all() and (state.target_reports[0, 0] == 2).all()


def test_a_camera_s_tracks_are_held_against_the_plants_that_stand_nearest():
    core = laser_core(override(WeedingConfig(scenario=SCENARIOS["dense"]), {"scenario.strip_m": 1.0}), None)
    field = core.draw_field(np.random.default_rng(2))
    core.load(np.array([0]), core.stack([field]))
    weeds, crops = field.weeds, field.crops
    some = np.column_stack([weeds.along_m, weeds.across_m])[::3] + np.array([0.002, -0.001])
    n = len(some)
    core.receive(0, some, np.zeros(n, int), np.zeros(n, int), np.full(n, 0.1), np.ones(n), np.zeros(n, bool))
    shown = core.state.slot_track[0]
    shown = shown[shown != core.capacity]
    assert 3 < len(shown) <= core.config.slots
    pad = int(np.flatnonzero(core.state.plant[0, :, 0] == np.sort(weeds.along_m)[0])[0])
    for track in shown.tolist():
        weed, crop = core.state.track_near[0, track]
        plants = core.state.plant[0]
        assert abs(plants[pad + weed, 0] - some[track, 0]) == np.abs(weeds.along_m - some[track, 0]).min()
        nearest = np.abs(crops.along_m - some[track, 0]).min()
        assert abs(plants[core.weeds_end + crop, 0] - some[track, 0]) <= max(nearest, 0.5) + 1e-9
