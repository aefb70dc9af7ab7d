"""Assumptions at the ends of their ranges: every end can be played, effects are paired, charts show what was found."""

import json
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from typer.testing import CliRunner

import fieldgym  # noqa: F401
from fieldgym.benchmark import assumption_page, rates, tornado
from fieldgym.benchmark.assumptions.declared import SURE, Dossier, dossier, dossier_ids
from fieldgym.benchmark.assumptions.eyes import aiming, scaled, tracking
from fieldgym.benchmark.episode import run_episode
from fieldgym.benchmark.sensitivity import FIGURES, Study, beside, study
from fieldgym.benchmark.suites import Condition, Episode
from fieldgym.benchmark.trials import trial
from fieldgym.envs import env_ids, task
from fieldgym.scripts import cli

SORTER = "fieldgym/ProduceSorting-v0"
HOE = "fieldgym/HoeWeeding-v0"
OWN = tuple(env_id for env_id in env_ids() if env_id.startswith("fieldgym/"))


def small(env_id: str, *names: str) -> Dossier:
    """The dossier with a few assumptions."""
    whole = dossier(env_id)
    kept = tuple(item for item in whole.assumptions if item.name in names)
    assert len(kept) == len(names)
    return replace(whole, assumptions=kept)


def test_every_task_has_a_dossier():
    assert dossier_ids() == OWN
    with pytest.raises(ValueError, match="no assumptions are listed for 'x/Y-v0': choose one of fieldgym/Safflower"):
        dossier("x/Y-v0")


@pytest.mark.parametrize("env_id", OWN)
def test_every_end_is_allowed_and_another_than_the_present_value(env_id: str):
    parts = task(env_id).assembly
    config = parts.configured()
    for item in dossier(env_id).assumptions:
        assert item.ends and set(re.split(r"/", item.sure)) <= set(SURE), item.name
        for end in item.ends.values():
            changed = parts.configured(overrides=end.numbers)
            assert (changed != config) == bool(end.numbers), (item.name, end.text)
            if end.eyes is not None:
                model = parts.measured(config)
                assert end.eyes(model) != model, (item.name, end.text)


def test_a_trial_is_the_benchmarks_own_episodes():
    numbers = {"preset": "commercial"}
    found = trial("fieldgym/LaserWeeding-v0", range(3, 5), numbers)
    where = Condition("fieldgym/LaserWeeding-v0", "load-1.25", "analytic", "model", json.dumps(numbers))
    for i, seed in enumerate((3, 4)):
        record = run_episode(Episode(where, "fifo", seed))
        told = {**record["scorecard"], **rates.derived(record), "return": record["return"]}
        for name in (*FIGURES, "joules_per_weed", rates.EACH_J, rates.AREA_KWH):
            assert found[name][i] == pytest.approx(told[name], rel=1e-12), name


def test_eyes_change_what_they_say():
    assembly = task("fieldgym/LaserWeeding-v0").assembly
    model = assembly.measured(assembly.configured())
    was = [np.array(rows) for rows in model.sightings]
    sharp, worse = aiming(0.001)(model), tracking(0.004)(model)
    for own, aim, track in zip(was, sharp.sightings, worse.sightings, strict=True):
        aim, track, own = np.array(aim), np.array(track), np.repeat(own, 8, axis=0)
        assert np.array_equal(aim[:, [0, 1, 4, 5, 6]], own[:, [0, 1, 4, 5, 6]])
        assert np.array_equal(track[:, 2:], own[:, 2:])
    assert np.std(np.concatenate([np.array(rows)[:, 2:4] for rows in sharp.sightings])) == pytest.approx(1e-3, rel=0.05)
    assert np.allclose(scaled("recall", 0.5)(model).recall, 0.5 * np.array(model.recall))
    # The hoe's own assembly makes its model; what is changed there reaches the rules.
    drifting = next(item for item in dossier(HOE).assumptions if item.name.startswith("odometry")).high
    assert drifting is not None
    changed = trial(HOE, range(4), eyes=drifting.eyes)
    assert not np.array_equal(changed["net_rate"], trial(HOE, range(4))["net_rate"])


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[Dossier, Study, Path]:
    chosen = small(SORTER, "slip on the belt, mm an axis", "picture to report, s")
    kept = tmp_path_factory.mktemp("study") / "kept.jsonl"
    return chosen, study(chosen, 6, kept), kept


def test_effects_are_paired_differences(found: tuple[Dossier, Study, Path]):
    _, result, _ = found
    assert [(effect.name[:4], effect.end) for effect in result.effects] == [
        ("slip", "low"), ("slip", "high"), ("pict", "low"), ("pict", "high"),
    ]  # fmt: skip
    seeds = range(100_000, 100_006)
    base, slips = trial(SORTER, seeds), trial(SORTER, seeds, {"belt.slip_sigma_m": 0.005})
    high = result.effects[1]
    for name in FIGURES:
        assert result.base[name].value == pytest.approx(base[name].mean())
        assert high.means[name].value == pytest.approx(slips[name].mean())
        assert high.differences[name].value == pytest.approx((slips[name] - base[name]).mean())
        assert high.differences[name].n == 6
    assert high.differences["net_rate"].value < 0.0


def test_what_was_played_is_not_played_again(found: tuple[Dossier, Study, Path]):
    chosen, result, kept = found
    with kept.open("a") as lines:
        lines.write('\n{"trial": "cut o')  # as a stop leaves it
    played: list[str] = []
    assert study(chosen, 6, kept, played.append) == result and not played
    study(chosen, 2, kept, played.append)  # other episodes are other trials
    assert len(played) == 5


def test_the_chart_shows_every_effect(found: tuple[Dossier, Study, Path]):
    chosen, result, _ = found
    text = tornado.tornado(chosen, result)
    assert text == tornado.tornado(chosen, result)
    root = ElementTree.fromstring(text)
    space = "{http://www.w3.org/2000/svg}"
    words = [node.text for node in root.iter(f"{space}text")]
    assert [word for word in words if word in {item.name for item in chosen.assumptions}] == [
        "slip on the belt, mm an axis",  # the one that moves most stands first
        "picture to report, s",
    ]
    assert "net rate, points" in words and "now 2: 1 ... 5" in words
    bars = [node for node in root.iter(f"{space}rect") if node.get("height") == "9" and node.get("y") != "18"]
    widths = [float(node.get("width", "")) for node in bars]
    assert len(bars) == 2 * len(result.effects)
    slip = [100.0 * effect.differences["net_rate"].value for effect in result.effects[:2]]
    assert widths[0] / widths[1] == pytest.approx(abs(slip[0] / slip[1]), rel=0.01)


def test_a_lonely_effect_does_not_press_the_others_together(found: tuple[Dossier, Study, Path]):
    chosen, result, _ = found
    whole = dossier(SORTER)
    given = [item for item in whole.assumptions if item.low and item.high][:3]
    sizes = dict(zip((item.name for item in given), (0.30, 0.04, 0.02), strict=True))
    effect = result.effects[0]
    moved = {name: replace(effect.differences["net_rate"], value=x, low=x, high=x) for name, x in sizes.items()}
    effects = tuple(
        effect._replace(name=item.name, end=end, differences={**effect.differences, "net_rate": moved[item.name]})
        for item in given
        for end in item.ends
    )
    text = tornado.tornado(replace(chosen, assumptions=tuple(given)), Study(result.base, effects, 6))
    assert ">+30.0<" in text and ">+4.0<" not in text
    ticks = [float(x) for x in re.findall(r'text-anchor="middle"[^>]*>(-?\d+)<', text)]
    assert max(ticks) < 10.0


def test_the_page_holds_the_figures(found: tuple[Dossier, Study, Path]):
    chosen, result, _ = found
    text = assumption_page.page([(chosen, result)], "assumptions", "fieldgym sensitivity X")
    assert "`fieldgym sensitivity X`" in text and "](assumptions/ProduceSorting.svg)" in text
    high = result.effects[1].differences["net_rate"]
    ends = f"({100.0 * high.low:.2f} .. {100.0 * high.high:.2f})"
    assert f"|  |  | 5 | {100.0 * high.value:+.2f} {ends} |" in text
    assert "; preset `slipping-belt` is the upper end." in text
    own = beside(chosen.yardsticks[0], result.base)
    assert f"| picks a minute | {own.value:.1f} (" in text
    tables = re.findall(r"(?:^\|.*\n)+", text, flags=re.MULTILINE)
    assert len(tables) == 3
    assert all(len({len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}) == 1 for table in tables)


def test_the_command_writes_page_and_chart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from fieldgym.benchmark.assumptions import declared

    few = small(SORTER, "picture to report, s")
    monkeypatch.setattr(declared, "dossier", lambda env_id: few)
    page = tmp_path / "deep" / "what.md"
    done = CliRunner().invoke(cli.app, ["sensitivity", "ProduceSorting", "--episodes", "2", "--page", str(page)])
    assert done.exit_code == 0, done.output
    assert page.read_text().startswith("# What is assumed")
    assert [path.name for path in (tmp_path / "deep" / "what").iterdir()] == ["ProduceSorting.svg"]


def test_presets_are_sets_of_overrides_and_single_numbers_win():
    def configured(**overrides):
        return gym.make("fieldgym/LaserWeeding-v0", backend="analytic", overrides=overrides).unwrapped.core.config  # type: ignore[attr-defined]

    plain, commercial = configured(), configured(preset="commercial")
    assert configured(preset="co2-2012") == plain
    assert (commercial.process.power_w, commercial.process.ed95_j) == (150.0, 20.0)
    both = configured(preset=["commercial", "settled"], **{"process.power_w": 100.0})
    assert (both.process.power_w, both.process.ed95_j, both.process.correct_s) == (100.0, 20.0, 0.30)
    # A dose belongs to its spot: both lasers put about as much on a square millimetre.
    fluence = [c.process.ed95_j / c.process.spot_radius_m**2 for c in (plain, commercial)]
    assert 1.0 < fluence[1] / fluence[0] < 1.5
    with pytest.raises(ValueError, match=r"preset = 'comercial' is unknown: did you mean 'commercial'|commercial"):
        configured(preset="comercial")


@pytest.mark.parametrize("env_id", OWN)
def test_every_preset_is_allowed(env_id: str):
    parts = task(env_id).assembly
    assert parts.presets
    for name in parts.presets:
        parts.configured(overrides={"preset": name})
