"""A clone learns what a dataset's policy does, says how well, and plays from its file."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from fieldgym.agents import make_policy
from fieldgym.benchmark import statistics

torch = pytest.importorskip("torch", reason="the rl extra is not installed")
minari = pytest.importorskip("minari", reason="the datasets extra is not installed")
pytest.importorskip("sb3_contrib", reason="the rl extra is not installed")

from fieldgym.agents.datasets import collect  # noqa: E402
from fieldgym.agents.learning import portable  # noqa: E402
from fieldgym.agents.learning.cloning import Lessons, clone, lessons_of  # noqa: E402
from fieldgym.agents.policies.layout import layout_of  # noqa: E402
from fieldgym.scripts import clone_policy  # noqa: E402

LASER = "fieldgym/LaserWeeding-v0"


@pytest.fixture(scope="module")
def edf(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Six episodes of a rule that a network can learn."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MINARI_DATASETS_PATH", str(tmp_path_factory.mktemp("sets")))
        seeds = range(2_000_000_000, 2_000_000_006)
        written = collect(
            lambda env: make_policy("edf", env, 1), LASER, seeds, "tests/edf-v0", algorithm="edf", backend="analytic"
        )
        yield written.dataset


@pytest.fixture(scope="module")
def lessons(edf: Any) -> Lessons:
    return lessons_of(edf)


def layout(edf: Any) -> Any:
    return layout_of(edf.recover_environment())


def taught(edf: Any, lessons: Lessons, epochs: int, **kwargs: Any) -> Any:
    settings = {"hidden": 32, "batch_size": 64, "learning_rate": 4e-3} | kwargs
    return clone(lessons, layout(edf), {"env_id": LASER}, epochs=epochs, **settings)


def test_lessons_are_the_decisions_that_were_taken(edf: Any, lessons: Lessons) -> None:
    assert len(lessons.actions) == edf.total_steps and set(lessons.episodes) == set(range(6))
    rows = np.arange(len(lessons.actions))
    assert (lessons.action_mask[rows, lessons.actions] == 1).all()
    episode = next(iter(edf.iterate_episodes()))
    first = lessons.episodes == 0
    assert np.array_equal(lessons.candidates[first], episode.observations["candidates"][:-1])
    assert np.array_equal(lessons.machine[first][-1], episode.observations["machine"][-2])


def test_a_clone_comes_to_do_as_its_teacher(edf: Any, lessons: Lessons) -> None:
    losses: list[float] = []
    before = taught(edf, lessons, 1, learning_rate=1e-9)
    after = taught(edf, lessons, 30, on_epoch=lambda epoch, loss: losses.append(loss))
    assert after.decisions == int((lessons.episodes < 5).sum()) < len(lessons.actions)
    # Of what it has never seen it gets less than half as much wrong as one that was taught nothing.
    assert 1.0 - after.agreement < 0.5 * (1.0 - before.agreement)
    assert losses[-1] < 0.3 * losses[0] and len(losses) == 30


def test_what_is_held_out_is_not_learned(edf: Any, lessons: Lessons) -> None:
    """Other actions in the last episode change what is counted, and no weight."""
    rest = lessons.episodes == 5
    turned = lessons._replace(actions=np.where(rest, lessons.action_mask.argmax(axis=1), lessons.actions))
    one, other = taught(edf, lessons, 2), taught(edf, turned, 2)
    assert all(np.array_equal(values, other.policy.weights[name]) for name, values in one.policy.weights.items())
    assert one.agreement != other.agreement


def test_a_single_episode_is_refused(edf: Any, lessons: Lessons) -> None:
    first = lessons.episodes == 0
    alone = {name: values[first] for name, values in lessons._asdict().items()}
    with pytest.raises(ValueError, match=r"^1 episodes: give at least 2"):
        taught(edf, lessons._replace(**alone), 1)


def test_the_command_tells_the_shares_and_writes_a_policy(edf: Any, tmp_path: Path) -> None:
    out = tmp_path / "made" / "edf.npz"
    words = [LASER, "--dataset", "tests/edf-v0", "--episodes", "12", "--epochs", "20", "--out", str(out)]
    done = CliRunner().invoke(clone_policy.app, words)
    assert done.exit_code == 0, done.output
    assert "decisions of edf" in done.stdout and "on 12 seeds from 3000000000" in done.stdout
    policy = portable.load(out)
    assert policy.card["cloned_from"] == "tests/edf-v0" and policy.card["policy"] == "edf"
    share = float(done.stdout.split("return ")[1].split(": ")[1].split(" %")[0])
    assert 70.0 < share < 115.0


def test_a_clone_is_told_as_a_share_of_its_teacher_on_the_same_fields(monkeypatch: pytest.MonkeyPatch) -> None:
    copy, asked = SimpleNamespace(fitted=object()), []

    def evaluate(make: Any, *condition: Any, **settings: Any) -> Any:
        asked.append((condition, settings))
        values = np.linspace(0.4, 0.6, len(condition[1])) * (0.95 if make is copy.fitted else 1.0)
        return SimpleNamespace(returns=40.0 * values, scorecard={"net_rate": values})

    monkeypatch.setattr("fieldgym.agents.evaluation.evaluate", evaluate)
    told = clone_policy.compared(LASER, "edf", copy, range(3_000_000_000, 3_000_000_020), {"engine": "analytic"})
    share = "95.00 % [95.00, 95.00]"
    assert told == {"return": f"19.00 of 20.00: {share}", "net rate": f"47.50 % of 50.00 %: {share}"}
    assert asked[0] == asked[1] and len(asked) == 2


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([LASER, "--dataset", "tests/nothing-v0"], "no dataset is called tests/nothing-v0"),
        (["SafflowerPicking", "--dataset", "tests/edf-v0"], "it is of fieldgym/LaserWeeding-v0"),
        ([LASER, "--dataset", "tests/edf-v0", "--epochs", "0"], "--epochs 0: give at least 1"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(edf: Any, words: list[str], told: str) -> None:
    done = CliRunner().invoke(clone_policy.app, words)
    assert done.exit_code != 0 and told in str(done.exception) and "\n" not in str(done.exception)


def test_a_share_is_of_means_in_pairs() -> None:
    reference = np.linspace(1.0, 3.0, 200)
    share = statistics.paired_share(0.95 * reference, reference)
    assert (share.value, share.low, share.high) == pytest.approx((0.95, 0.95, 0.95), rel=1e-12) and share.n == 200
    noisy = statistics.paired_share(0.95 * reference + 0.1 * np.sin(37.0 * reference), reference)
    assert noisy.low < noisy.value < noisy.high and noisy.high - noisy.low < 0.03
    # Of means, not the mean of shares, which is 0.625.
    assert statistics.paired_share([1.0, np.nan, 3.0], [2.0, 1.0, 4.0]).value == pytest.approx(2.0 / 3.0)
    with pytest.raises(ValueError, match="a share needs a positive one"):
        statistics.paired_share([1.0, 2.0], [1.0, -1.0])
    with pytest.raises(ValueError, match="must be paired"):
        statistics.paired_share([1.0, 2.0], [1.0])
