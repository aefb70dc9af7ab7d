"""Bounds from both sides: their parts against trying everything, and the figures of small and of whole instances.

A bound that becomes looser breaks no promise, so only a figure notices. They stand in ``bound_figures.json``; who makes
a bound tighter writes them anew with ``python tests/test_laws_bounds.py > tests/bound_figures.json``.
"""

import json
from collections.abc import Iterator
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stopped import some_stops

from fieldgym import bounds
from fieldgym.bounds import base, safflower, sorting, stops, transplanting, weeding
from fieldgym.envs.safflower.config import SCENARIOS as ROWS
from fieldgym.envs.safflower.config import PerceptionModel as PickerEyes
from fieldgym.envs.safflower.config import SafflowerConfig
from fieldgym.envs.safflower.core import SafflowerCore
from fieldgym.envs.safflower.field import SafflowerField
from fieldgym.envs.sorting.config import PerceptionModel as SorterEyes
from fieldgym.envs.sorting.config import SortingConfig
from fieldgym.envs.sorting.core import SortingCore
from fieldgym.envs.sorting.field import ProduceField
from fieldgym.envs.transplanting.config import PerceptionModel as TrayEyes
from fieldgym.envs.transplanting.config import TransplantingConfig
from fieldgym.envs.transplanting.core import TransplantingCore
from fieldgym.envs.transplanting.field import TrayField
from fieldgym.envs.weeding.field import WeedField
from fieldgym.envs.weeding.perception import PerceptionModel as WeederEyes
from fieldgym.envs.weeding.tools.hoe.config import HoeWeedingConfig
from fieldgym.envs.weeding.tools.hoe.env import hoe_core
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.env import laser_core
from fieldgym.kernels.config import override

FILE = Path(__file__).with_name("bound_figures.json")
EXACT = 1e-9


def toys() -> Iterator[tuple[str, Any, Any, Any]]:
    """Every toy that ships: name, the module of its bound, its rules, the toy."""
    for toy in SafflowerField.toy():
        core = SafflowerCore(override(SafflowerConfig(), toy.overrides), PickerEyes.measured("pots"), 1)
        yield f"safflower {toy.name}", safflower, core, toy
    for toy in TrayField.toy():
        core = TransplantingCore(override(TransplantingConfig(), toy.overrides), TrayEyes.perfect(), 1)
        yield f"transplanting {toy.name}", transplanting, core, toy
    for toy in ProduceField.toy():
        core = SortingCore(override(SortingConfig(), toy.overrides), SorterEyes.perfect(), 1)
        yield f"sorting {toy.name}", sorting, core, toy
    tools: Any = ("laser", laser_core, WeedingConfig()), ("hoe", hoe_core, HoeWeedingConfig())
    for tool, make, config in tools:
        for toy in WeedField.toy(tool):
            yield f"{tool} {toy.name}", weeding, make(override(config, toy.overrides), WeederEyes.perfect()), toy


def drawn() -> Iterator[tuple[str, Any]]:
    """Whole instances: of every task, with reports as drawn, driven and any."""
    every: Any = {}, {"backend": "pybullet", "perception": "model"}, {"backend": "pybullet"}
    for name, scenario in (
        ("SafflowerPicking", "row"),
        ("TrayTransplanting", "replug"),
        ("ProduceSorting", "load-1.6"),
    ):
        for settings in every:
            words = " ".join(settings.values())
            yield f"{name} {scenario} {words}", bounds.instance(f"fieldgym/{name}-v0", 3, scenario=scenario, **settings)
    short = {"scenario.strip_m": 0.8}
    # Where the speed is chosen the rest is the laser's.
    for name, several in (("LaserWeeding", every), ("LaserWeedingSpeed", every[:1]), ("HoeWeeding", every)):
        for settings in several:
            words = " ".join(settings.values())
            yield f"{name} {words}", bounds.instance(f"fieldgym/{name}-v0", 3, overrides=short, **settings)
    hasty = replace(ROWS["row"], time_limit_s=260.0)
    yield "hasty row", bounds.instance("fieldgym/SafflowerPicking-v0", 5, config=SafflowerConfig(scenario=hasty))


def figures() -> dict[str, list[Any]]:
    """What bounds say, by instance."""
    found = {}
    for name, module, core, toy in toys():
        core.load(np.array([0]), core.stack([core.complete(toy.field, np.random.default_rng(0))]))
        for reports in base.REPORTS:
            found[f"{name} {reports}"] = said(module.instance_of(core, reports))
    return found | {name: said(instance) for name, instance in drawn()} | parts()


def said(instance: Any) -> list[Any]:
    """A bound, and the cycle times at smaller rates."""
    bound = instance.bound()
    assert 0.0 <= bound.wall_s < 600.0
    cycles = [instance.cycle_time_at(share * bound.net_rate) for share in (0.2, 0.6)]
    values = [bound.net_rate, bound.episode_return, bound.cycle_time_s, bound.gap, *cycles]
    return [round(value, 9) if isfinite(value) else str(value) for value in values] + [bound.proven, bound.method]


def parts() -> dict[str, list[Any]]:
    """What the parts say of what they do not have to say exactly."""
    found = {}
    for seed in range(4):
        some, worths = some_stops(seed), [stop.gain for stop in some_stops(seed)]
        for budget_s, second in ((2.0, 0.0), (3.5, 0.1), (9.0, 0.4)):
            ends = [stops.largest(some, worths, budget_s, second, reach_end=end) for end in (True, False)]
            found[f"stops {seed} {budget_s} {second}"] = [round(float(v), 9) for pair in ends for v in pair]
        grams = sum(float(stop.gain.max(axis=1).sum()) for stop in some)
        found[f"cycle {seed}"] = [
            round(float(stops.shortest_cycle(some, share * grams, 0.5)), 9) for share in (0.3, 0.9)
        ]
    return found


def test_bounds_are_as_tight_as_they_were():
    known = json.loads(FILE.read_text("utf-8"))
    found = figures()
    assert list(found) == list(known)
    for name, values in found.items():
        assert len(values) == len(known[name])
        for value, was in zip(values, known[name], strict=True):
            if isinstance(value, float) and isinstance(was, float):
                assert value == pytest.approx(was, rel=1e-6, abs=1e-8), name
            else:
                assert value == was, name


def test_toys_optima_lie_within_their_bounds_and_close():
    known, loose = json.loads(FILE.read_text("utf-8")), 0
    for name, _, _, toy in toys():
        for reports in base.REPORTS:
            rate, value = known[f"{name} {reports}"][:2]
            assert rate >= toy.net_rate - EXACT and value >= toy.episode_return - EXACT, name
        rate, value = known[f"{name} drawn"][:2]
        loose += rate > toy.net_rate + EXACT or value > toy.episode_return + 0.2
    assert loose <= 4


if __name__ == "__main__":
    print("{\n" + ",\n".join(f"  {json.dumps(k)}: {json.dumps(v)}" for k, v in figures().items()) + "\n}")
