"""Every number of the weeders' configurations, one after the other set to nonsense and to the ends of its range."""

from dataclasses import fields, is_dataclass
from math import inf, nan

import numpy as np
import pytest

from fieldgym.envs.weeding.perception import PerceptionModel
from fieldgym.envs.weeding.tools.hoe import motors as hoe_motors
from fieldgym.envs.weeding.tools.hoe.config import HoeWeedingConfig
from fieldgym.envs.weeding.tools.hoe.env import hoe_core
from fieldgym.envs.weeding.tools.laser import motors as laser_motors
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.env import laser_core
from fieldgym.kernels.config import ConfigError, override
from fieldgym.kernels.config_fields import DECLARED
from fieldgym.simulation.weeder_model import WeederParameters

TOOLS = {
    "laser": (WeedingConfig, laser_core, laser_motors.within_motors),
    "hoe": (HoeWeedingConfig, hoe_core, hoe_motors.within_motors),
}
NONSENSE = (nan, inf, -inf, None, "7.3", 1e9, -1e9, 0.0, True)


def leaves(config, prefix=""):
    """Dotted name, value and declaration of every field that holds no other configuration."""
    for item in fields(config):
        value = getattr(config, item.name)
        if is_dataclass(value):
            yield from leaves(value, f"{prefix}{item.name}.")
        elif DECLARED in item.metadata:
            # A mechanism checks itself.
            yield prefix + item.name, value, item.metadata[DECLARED]


def tries(config):
    """Dotted names and values: nonsense, and what the declared range just allows, in all places of a tuple."""
    for name, value, declared in leaves(config):
        if isinstance(value, bool | str):
            yield from ((name, bad) for bad in (nan, None, "x", 3))
            continue
        whole = isinstance(value, int) or (isinstance(value, tuple) and isinstance(value[0], int))
        ends = [declared.low, declared.high, declared.low + 0.01 * (declared.high - declared.low)]
        for number in (*NONSENSE, *(round(end) if whole else end for end in ends)):
            yield name, (number,) * len(value) if isinstance(value, tuple) else number
            if isinstance(value, tuple):
                yield name, (number, *value[1:])


@pytest.mark.slow
@pytest.mark.parametrize("tool", TOOLS)
def test_any_number_is_refused_in_one_line_or_gives_observations_inside_their_space(tool):
    """Short strips, so that every weed is drawn and seen; the largest that the ranges allow would take gigabytes."""
    make, build, fit = TOOLS[tool]
    small = override(make(), {"scenario.strip_m": 1.0, "speed_control": True})
    names = {name for name, _, _ in leaves(small)}
    refused = played = 0
    for name, value in tries(small):
        try:
            config = override(small, {name: value})
            if config.scenario.strip_m > 20.0:
                continue
            if name.startswith("machine."):
                config = fit(config)
        except ConfigError as error:
            # A rule between fields may name another one than that which was changed.
            assert "\n" not in str(error) and error.path.split("[")[0] in names, (name, value, str(error))
            refused += 1
            continue
        core = build(config, PerceptionModel.measured("classical", "easy"), 2)
        core.reset_rows(np.arange(2), [np.random.default_rng(seed) for seed in range(2)])
        rng = np.random.default_rng(0)
        for _ in range(12):
            for key, values in core.observe().items():
                space = core.observation_space[key]
                inside = np.isfinite(values).all() and np.all((values >= space.low) & (values <= space.high))
                assert inside, (name, value, key)
            plan = core.plan(rng.integers(0, core.action_space.n, 2))
            result = core.apply(plan, core.nominal(plan))
            assert np.isfinite(result.rewards).all() and np.isfinite(result.phases_s).all(), (name, value)
            assert np.isfinite(core.scores()).all(), (name, value)
        played += 1
    assert refused > 300 and played > 80


@pytest.mark.parametrize(
    ("make", "name", "value", "words"),
    [
        (WeedingConfig, "reach.gap_m", 850.0, "reach.gap_m = 850.0: give a number in [0.05, 5] m"),
        (WeedingConfig, "process.spot_radius_m", 3.0, "[0.0001, 0.05] m"),
        (WeedingConfig, "process.dose_j", (75.0, 30.0, 200.0), "give ascending doses"),
        (WeedingConfig, "weights.seconds", nan, "weights.seconds = nan: give a number in [-1000, 1000] 1/s"),
        (WeedingConfig, "reach.base_height_m", 0.5, "reach.gap_m = 0.85: it leaves no room"),
        (WeedingConfig, "scenario.offered_load", 90.0, "scenario.offered_load = 90.0: it asks for"),
        (WeedingConfig, "scenario.crop", "oats", "give 'beet' or 'maize'"),
        (WeedingConfig, "scenario.stage_shares", (0.5, 0.5, 0.5), "give shares that add up to 1"),
        (WeedingConfig, "scenario.max_weeds", 10, "the strip holds 128 weeds on average"),
        (WeedingConfig, "scenario.band_m", 0.6, "the tool reaches 0.2 m to either side"),
        (WeedingConfig, "cart.speed_range_m_s", (0.2, 0.1), "give slowest < fastest"),
        (WeedingConfig, "cart.camera_ahead_m", 0.3, "the front camera's view must end before the window"),
        (HoeWeedingConfig, "process.depth_m", (0.01, 0.02), "process.depth_m"),
        (HoeWeedingConfig, "process.depth_m", (12.0, 22.0, 35.0), "[0.0001, 0.2] m"),
        (HoeWeedingConfig, "process.stir_radius_m", (0.01, 0.02, 0.03), "at most blade_radius_m = 0.014"),
        (HoeWeedingConfig, "process.slope", -1.0, "[0.1, 50]"),
        (HoeWeedingConfig, "reach.travel_m", 140.0, "[0.005, 2] m"),
        (WeederParameters, "base_height_m", 1450.0, "[0.2, 5] m"),
    ],
)
def test_what_is_wrong_is_named_with_what_is_allowed(make, name, value, words):
    with pytest.raises(ConfigError) as told:
        override(make(), {name: value})
    assert words in str(told.value) and "\n" not in str(told.value)


def test_both_tools_meet_the_headline_scenario_by_default():
    assert WeedingConfig().scenario == HoeWeedingConfig().scenario
    assert WeedingConfig().scenario.offered_load == 1.25


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"false_sightings": ((), (), ())}, "every class with a sighting"),
        ({"sightings": ((0.0,) * 7,)}, "sightings"),
        ({"false_sightings": (((0.0,) * 6,),) * 3}, "rows of 8"),
        ({"false_sightings": (((0.0,) * 7,),) * 3}, "do not tell the confidence: measure anew"),
        ({"false_sightings": (((0.0,) * 7 + (1.5,),),) * 3}, "rows of 8"),
        ({"crop_gap_m": (0.2, 0.1), "odds_near_crop": (1.0, 1.0, 1.0)}, "ascending"),
        ({"odds_near_weed": (1.0, 1.0)}, "give 1 factors"),
        ({"recall": (((2.0, 1.0, 1.0), (1.0, 1.0, 1.0)),) * 2}, "[0, 1]"),
    ],
)
def test_statistics_of_cameras_that_make_no_sense_are_refused(changes, words):
    with pytest.raises(ConfigError) as told:
        override(PerceptionModel.perfect(), changes)
    assert words in str(told.value)
