"""The picker's numbers: nonsense is refused in one line, what is taken gives finite observations inside their space."""

from math import inf, nan
from typing import Any

import numpy as np
import pytest

from fieldgym.envs.safflower.config import SCENARIOS, PerceptionModel, SafflowerConfig
from fieldgym.envs.safflower.core import SafflowerCore
from fieldgym.kernels.config import ConfigError, override
from fieldgym.kernels.config_fields import dotted, entries
from fieldgym.kernels.config_kinds import Number, Row
from fieldgym.mechanisms import FiveBar

VALUES = (
    nan,
    inf,
    -inf,
    None,
    "7.3",
    [],
    {},
    True,
    -1,
    0,
    1,
    3,
    -0.5,
    1e-9,
    0.01,
    0.4,
    2.5,
    1000.0,
    1180,
    1e9,
    10**400,
)
BASES = {
    "pots": SafflowerConfig(),
    "row-dense": override(SafflowerConfig(), {"scenario": SCENARIOS["row-dense"], "slots": 4}),
}
NAMES = dotted(SafflowerConfig)


def entry(cls: type, name: str) -> Any:
    """The declaration of a dotted name."""
    head, _, rest = name.partition(".")
    found = entries(cls)[head]
    return entry(found.nested, rest) if rest and found.nested else found


def candidates(name: str, base: SafflowerConfig) -> list[Any]:
    """Values to try: nonsense, and the ends of the declared range; for tuples one of their numbers each."""
    kind = entry(SafflowerConfig, name).kind
    if isinstance(kind, Row) and isinstance(kind.kinds[0], Number):
        now: Any = base
        for part in name.split("."):
            now = getattr(now, part)
        return [*VALUES, *([value, *now[1:]] for value in (*VALUES, kind.kinds[0].low, kind.kinds[0].high))]
    return [*VALUES, *((kind.low, kind.high) if isinstance(kind, Number) else ())]


def play(config: SafflowerConfig, perception: PerceptionModel) -> None:
    """A few decisions, every observation inside its space, every reward and score finite."""
    core, rng = SafflowerCore(config, perception, 2), np.random.default_rng(0)
    core.reset_rows(np.arange(2), [np.random.default_rng(seed) for seed in range(2)])
    for _ in range(6):
        observation = core.observe()
        for name, values in observation.items():
            space: Any = core.observation_space[name]
            assert np.isfinite(values).all() and (values >= space.low).all() and (values <= space.high).all(), name
        assert np.isfinite(core.scores()).all()
        lots = np.where(observation["action_mask"] > 0, rng.random(observation["action_mask"].shape), -1.0)
        lots[:, -1] *= 0.99
        plan = core.plan(lots.argmax(axis=1))
        result = core.apply(plan, core.nominal(plan))
        assert np.isfinite(result.rewards).all() and np.isfinite(result.phases_s).all()
        assert (result.phases_s >= 0.0).all()


def fuzz(name: str, base: SafflowerConfig) -> tuple[int, int]:
    """How many values of a field are taken and refused."""
    taken = refused = 0
    for value in candidates(name, base):
        try:
            config = override(base, {name: value})
            perception = PerceptionModel.measured(config.scenario.camera_fit)
        except ConfigError as error:
            refused += 1
            assert ": " in str(error) and "give" in str(error)
            assert len(str(error).splitlines()) == 1 and len(str(error)) < 300
            continue
        taken += 1
        play(config, perception)
    return taken, refused


@pytest.mark.slow
@pytest.mark.parametrize("base", BASES)
def test_every_field_with_every_kind_of_value(base):
    counts = {name: fuzz(name, BASES[base]) for name in NAMES}
    assert all(refused for _, refused in counts.values())
    assert sum(taken for taken, _ in counts.values()) > 200


@pytest.mark.parametrize(
    "changes",
    [
        {"scenario": SCENARIOS["row-sparse"], "slots": 1},
        {"scenario.time_limit_s": 1.0},
        {"process.recognise_s": 0.0, "process.locate_s": 0.0, "process.illegal_s": 0.0},
        {"scenario.window_m": 5.0, "scenario.pitch_m": 5.0},
        {"machine.picker.camera_ahead_m": 3.0, "machine.picker.tool_velocity_m_s": 1e-3},
        {"scenario.motor_height_m": 3.0},
        {"process.luck_logit": 5.0, "process.strokes": (0, 50, 50), "process.stroke_cut": 1.0 - 1e-6},
        {"scenario.dispersion": 6.0, "scenario.mean_heads": 0.01},
    ],
)
def test_extremes_stay_inside_the_space(changes):
    play(override(SafflowerConfig(), changes), PerceptionModel.measured("row-dense"))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"scenario.motor_height_m": 1180}, "scenario.motor_height_m = 1180: give a number in [0.3, 3] m"),
        ({"weights.seconds": nan}, "weights.seconds = nan: give a number in [-1000, 1000] g/s"),
        ({"process.strokes": (1, 2)}, "process.strokes = (1, 2): give 3 values"),
        ({"process.stroke_cut": 1.0}, "process.stroke_cut = 1.0: give a number in"),
        ({"machine.clear_level_m": -0.1}, "machine.clear_level_m = -0.1: outside the arm's workspace"),
        ({"machine.picker.tool_velocity_m_s": -1.0}, "machine.picker.tool_velocity_m_s = -1.0: give a number in"),
        ({"slots": 81}, "slots = 81: give at most scenario.max_tracks = 80"),
        ({"scenario.crown_m": (0.3, 0.2)}, "scenario.crown_m = (0.3, 0.2): give a lower and an upper end"),
        (
            {"scenario.plants": 500, "scenario.max_heads": 41},
            "scenario.max_heads = 41: with 500 plants give at most 40",
        ),
        ({"scenario.camera_fit": "orchard"}, "scenario.camera_fit = 'orchard': give 'pots', "),
        (
            {"scenario.plant_height_m": (0.9, 0.3), "scenario.potted": False},
            "scenario.plant_height_m = (0.9, 0.3): give a",
        ),
        ({"process.cut": 1.0}, "process.cut: no such field"),
    ],
)
def test_the_error_names_field_value_range_and_unit(changes, says):
    with pytest.raises(ConfigError) as caught:
        override(SafflowerConfig(), changes)
    assert str(caught.value).startswith(says)


def test_an_arm_in_millimetres_is_refused():
    bar = FiveBar.from_lengths(175, 350, 40, 60, 350, 175, 580)
    with pytest.raises(ConfigError, match=r"five_bar = .*580 m long, give at most 5 m"):
        override(SafflowerConfig(), {"machine.picker.five_bar": bar})
