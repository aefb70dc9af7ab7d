"""Trays as values: drawn, completed, loaded again, read from maps; toys with a known optimum."""

import copy
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldgym.bounds import transplanting as bounds
from fieldgym.envs.field import FieldError
from fieldgym.envs.transplanting.columns import S
from fieldgym.envs.transplanting.config import (
    EMPTY,
    HEALTHY,
    POOR,
    SCENARIOS,
    PerceptionModel,
    TransplantingConfig,
)
from fieldgym.envs.transplanting.core import TransplantingCore, TransplantOutcome
from fieldgym.envs.transplanting.field import TrayField, draw, draw_batch, reports
from fieldgym.envs.transplanting.grid import HEADS, SIGNS, read_grid
from fieldgym.kernels.config import override

ID = "fieldgym/TrayTransplanting-v0"
E, H, P = EMPTY, HEALTHY, POOR


def written(source, target):
    """The map of trays whose cells hold these."""
    return "\n\n".join(
        "\n".join([head, *(" ".join(SIGNS[state] for state in row) for row in cells)])
        for head, cells in zip(HEADS, (source, target), strict=True)
    )


@settings(deadline=None, max_examples=30)
@given(vacancy=st.floats(0.0, 1.0), poor=st.floats(0.0, 1.0), clumped=st.floats(0.0, 1.0), seed=st.integers(0, 2**31))
def test_trays_hold_the_vacancies_that_they_should(vacancy, poor, clumped, seed):
    scenario = replace(SCENARIOS["replug"], vacancy=vacancy, poor=poor, clumped=clumped)
    generators = [np.random.default_rng([seed, world]) for world in range(40)]
    field = draw_batch(scenario, generators)
    cells = np.concatenate([field.source.ravel(), field.target.ravel()])
    # Clumps of nine cells leave at least a ninth of the cells' information.
    spread = 5.0 * np.sqrt(0.25 * 9.0 / len(cells)) + 1e-9
    assert np.mean(cells == EMPTY) == pytest.approx(vacancy, abs=spread)
    assert np.mean(cells == POOR) == pytest.approx((1.0 - vacancy) * poor, abs=spread)


def test_clumped_vacancies_have_vacant_neighbours():
    together = []
    for clumped in (0.0, 0.6):
        scenario = replace(SCENARIOS["replug-high"], clumped=clumped)
        generators = [np.random.default_rng(world) for world in range(200)]
        empty = draw_batch(scenario, generators).source == EMPTY
        together.append(np.mean(empty[:, :, 1:] & empty[:, :, :-1]))
    assert together[0] == pytest.approx(0.04, abs=0.005)
    assert together[1] > 1.5 * together[0]


def test_reports_follow_the_confusion_matrix():
    confusion = ((0.9, 0.06, 0.04), (0.1, 0.7, 0.2), (0.0, 0.5, 0.5))
    rng = np.random.default_rng(3)
    cells = rng.integers(0, 3, 60_000).astype(np.int8)
    seen = reports(confusion, cells, rng.random(cells.shape))
    for state in range(3):
        shares = np.bincount(seen[cells == state], minlength=3) / np.count_nonzero(cells == state)
        assert shares == pytest.approx(np.array(confusion[state]), abs=0.015)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_trays_and_luck_do_not_depend_on_the_camera_and_steps_draw_nothing(scenario):
    drawn = []
    for perception in ("perfect", "model"):
        env: Any = gym.make(ID, backend="analytic", scenario=scenario, perception=perception).unwrapped
        _, info = env.reset(seed=3)
        core = env.core
        drawn.append((core.state.source_cells.copy(), core.state.target_cells.copy(), core.state.luck.copy()))
        state = env.np_random.bit_generator.state
        env.step(int(np.flatnonzero(info["action_mask"])[0]))
        assert env.np_random.bit_generator.state == state
    assert all(np.array_equal(a, b) for a, b in zip(*drawn, strict=True))


def episode(env: Any, first: tuple[Any, Any], seed: int) -> list[Any]:
    """Everything that 40 random legal decisions bring, from what a reset returned."""
    (observation, info), rng = first, np.random.default_rng(seed)
    heard = [observation, info]
    for _ in range(40):
        mask = info["action_mask"]
        actions = [int(rng.choice(np.flatnonzero(row))) for row in np.atleast_2d(mask)]
        step = env.step(np.array(actions) if mask.ndim == 2 else actions[0])
        info = step[-1]
        heard.extend(step)
    return heard


def same(one: Any, other: Any) -> bool:
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[name], other[name]) for name in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return np.array_equal(one, other)


@pytest.mark.parametrize("fields", [10, pytest.param(200, marks=[pytest.mark.slow, pytest.mark.long])])
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_drawn_field_that_is_loaded_again_gives_the_same_episode_alone_and_in_a_batch(scenario, fields):
    env: Any = gym.make(ID, backend="analytic", scenario=scenario, disable_env_checker=True).unwrapped
    kept, heard = [], []
    for seed in range(fields):
        heard.append(episode(env, env.reset(seed=seed), seed))
        kept.append(env.field)
    for seed in range(fields):
        again = episode(env, env.reset(options={"field": kept[seed]}), seed)
        assert same(again, heard[seed]), seed
        assert env.field == kept[seed]
    batch: Any = gym.make_vec(ID, num_envs=fields, scenario=scenario, vectorization_mode="vector_entry_point")
    drawn = episode(batch, batch.reset(seed=0), 1)
    loaded = episode(batch, batch.reset(seed=1000, options={"fields": kept}), 1)
    assert same(drawn, loaded)


@pytest.mark.parametrize("scenario", ["fill", "replug-high"])
def test_public_draw_is_what_a_reset_draws_and_survives_stacking(scenario):
    config = TransplantingConfig(scenario=SCENARIOS[scenario])
    core = TransplantingCore(config, PerceptionModel.perfect(), 1)
    fields = [draw(config, np.random.default_rng(seed)) for seed in range(3)]
    assert fields == [core.draw_field(np.random.default_rng(seed)) for seed in range(3)]
    assert core.unstack(core.stack(fields)) == fields and len(set(fields)) == 3
    assert core.complete(fields[0], np.random.default_rng(9)) == fields[0], "nothing is missing, nothing is drawn"
    assert fields[0].target is not None and fields[0].target.state.any() == config.scenario.replug
    source, target = fields[0].source, fields[0].target
    chances = np.concatenate([source.lot, source.extract, source.lose, source.damage, target.lot])
    assert len(np.unique(chances)) == len(chances), "no number decides twice"


def small() -> TransplantingCore:
    """Two supply trays of 2 x 3 cells, one tray of 2 x 2 cells to serve."""
    kinds = {"scenario.source": {"rows": 2, "columns": 3}, "scenario.target": {"rows": 2, "columns": 2}}
    config = override(TransplantingConfig(), {**kinds, "scenario.target_trays": 1})
    return TransplantingCore(config, PerceptionModel.perfect(), 1)


def test_cells_that_are_not_given_are_empty_and_their_luck_is_drawn():
    field = TrayField.of_cells([[H, P]], [])
    shuffled = replace(field, source=replace(field.source, row=[3, 1], column=[0, 2], lot=[0.25, np.nan]), target=None)
    core = small()
    whole: Any = core.complete(shuffled, np.random.default_rng(0))
    assert whole.source.state.reshape(4, 3).tolist() == [[E, E, E], [E, E, P], [E, E, E], [H, E, E]]
    assert whole.target.state.tolist() == [E] * 4 and whole.source.lot.reshape(4, 3)[3, 0] == 0.25
    for luck in (whole.source.lot, whole.source.extract, whole.source.lose, whole.source.damage, whole.target.lot):
        assert np.isfinite(luck).all() and len(set(luck.tolist())) == len(luck)
    assert whole == core.complete(shuffled, np.random.default_rng(0))
    assert whole != core.complete(shuffled, np.random.default_rng(1))
    core.load(np.array([0]), core.stack([whole]))
    assert core.state.source_cells[0, :-1].tolist() == whole.source.state.reshape(4, 3).tolist()
    assert core.state.luck[0, 3, 0].tolist() == [
        whole.source.extract[9],
        whole.source.lose[9],
        whole.source.damage[9],
    ]


@pytest.mark.parametrize(
    ("source", "target", "word"),
    [
        (
            [(4, 0, H)],
            [],
            r"source 1: row 4, column 0 lies outside the source trays: give rows 0 to 3 and columns 0 to 2",
        ),
        ([(0, 0, H), (1, 3, H)], [], "source 2: row 1, column 3 lies outside"),
        ([(0, 0, H)], [(0, 2, E)], "target 1: row 0, column 2 lies outside the target trays: .* columns 0 to 1"),
        ([(1, 1, H), (0, 0, H), (1, 1, P)], [], "source 3: row 1, column 1 is given twice: remove one"),
        ([(0, 0, 3)], [], "source 1: state = 3: give empty, healthy, poor"),
        ([(0, 0, -1)], [], "source 1: state is missing"),
        ([(-2, 0, H)], [], "source 1: row = -2"),
    ],
)
def test_what_does_not_fit_the_trays_is_named(source, target, word):
    kinds = TrayField.kinds()
    tables = []
    for kind, cells in (("source", source), ("target", target)):
        row, column, state = np.array(cells, np.int64).reshape(-1, 3).T
        tables.append(replace(kinds[kind].empty(len(cells)), row=row, column=column, state=state))
    with pytest.raises(FieldError, match=word) as caught:
        small().complete(TrayField(*tables), np.random.default_rng(0))
    assert "\n" not in str(caught.value)


def test_trays_come_from_plain_maps_and_go_back(tmp_path):
    signs = "source\no o x\n. . o   # second row\n\n\no.o\ntarget:\n\n. o\n"
    words = "healthy healthy poor\nempty empty healthy\nhealthy empty healthy\n\nempty healthy\n"
    source, target = [[H, H, P], [E, E, H], [H, E, H]], [[E, H]]
    assert read_grid(signs, "a")[:2] == (source, target) == read_grid(words, "b")[:2]
    assert read_grid(signs, "a").lines == {"source": [2, 3, 6], "target": [9]}
    assert read_grid(written(source, target), "c")[:2] == (source, target)
    assert read_grid("ooo", "d")[:2] == ([[H, H, H]], [])
    assert TrayField.from_text(signs, "a") == TrayField.of_cells(source, target)
    env: Any = gym.make(ID, backend="analytic", disable_env_checker=True).unwrapped
    path = tmp_path / "trays.txt"
    path.write_text(signs, encoding="utf-8")
    env.reset(seed=0, options={"field": path})
    assert env.core.state.source_cells[0, :3, :3].tolist() == source
    path.write_text("# too wide\nooo\nooo\n\n" + "o" * 7, encoding="utf-8")
    with pytest.raises(FieldError, match=r"trays.txt:5: target: row 0, column 6 lies outside the target trays"):
        env.reset(options={"field": path})


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "map.txt: no source trays"),
        ("target\n. .\n", "map.txt: no source trays"),
        ("o o\no q\n", r"map.txt:2: cell 2: 'q' is no cell: write \. or empty, o or healthy, x or poor"),
        ("o o\no o o\n", "map.txt:2: 3 cells, the first row of the source trays has 2"),
        ("o\n\n.\n\n.\n", "map.txt:5: a third block begins"),
        ("source\no\nsource\no\n", "map.txt:3: the block 'source' begins here again"),
        ("o\n\ntarget\n.\n", "map.txt:3: .*'target'"),
    ],
)
def test_maps_that_cannot_be_read_are_named_with_their_line(text, word):
    with pytest.raises(FieldError, match=word) as caught:
        TrayField.from_text(text, "map.txt")
    assert "\n" not in str(caught.value)


@settings(deadline=None, max_examples=200)
@given(st.text(alphabet="ox.# \n:sourcetargepy\u00e9\t\x00", max_size=60))
def test_any_text_is_a_map_or_an_error_of_one_line(text):
    try:
        source, target, _ = read_grid(text, "map")
    except FieldError as error:
        assert str(error).isprintable()
    else:
        assert read_grid(written(source, target), "map")[:2] == (source, target)


def best_by_trying(core: TransplantingCore) -> tuple[float, float]:
    """Largest return and net rate over all sequences of legal actions."""
    best = [-np.inf, -np.inf]

    def go_on(state: TransplantingCore, total: float) -> None:
        for action in np.flatnonzero(state.observe()["action_mask"][0]):
            child = copy.deepcopy(state)
            plan = child.plan(np.array([action]))
            result = child.apply(plan, TransplantOutcome(plan.phases_s, np.zeros((1, 2))))
            value = total + float(result.rewards.sum())
            best[1] = max(best[1], child.scores()[0, S.net_rate])
            if result.terminated[0] or result.truncated[0]:
                best[0] = max(best[0], value)
            else:
                go_on(child, value)

    go_on(core, 0.0)
    return best[0], best[1]


@pytest.mark.parametrize("toy", TrayField.toy(), ids=lambda toy: toy.name)
def test_toys_have_the_optimum_that_they_say(toy):
    core = TransplantingCore(override(TransplantingConfig(), toy.overrides), PerceptionModel.perfect(), 1)
    core.load(np.array([0]), core.stack([core.complete(toy.field, np.random.default_rng(0))]))
    bound = bounds.instance_of(core).bound()
    most, rate = best_by_trying(core)
    assert (most, rate) == pytest.approx((toy.episode_return, toy.net_rate), abs=1e-9)
    assert bound.episode_return >= most - 1e-9 and bound.net_rate >= rate - 1e-9


def test_the_first_toy_by_hand():
    """Quintic legs under 60 m/s2 over 0.15 m and across, the gripper, and one tray's length of the conveyor."""
    toy = TrayField.toy()[0]

    def leg_s(stroke_m: float) -> float:
        return max(1.875 * stroke_m / 4.5, np.sqrt(10.0 / np.sqrt(3.0) * stroke_m / 60.0))

    conveyor_s = max(1.875 * 0.58 / 0.25, np.sqrt(10.0 / np.sqrt(3.0) * 0.58 / 1.5)) + 0.10
    seconds = leg_s(0.16) + leg_s(0.15) + 2.0 * leg_s(0.15) + leg_s(0.32) + 0.25 + leg_s(0.15) + conveyor_s
    assert toy.episode_return == pytest.approx(1.0 - 0.2 * seconds, abs=1e-9)
