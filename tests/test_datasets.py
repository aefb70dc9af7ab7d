"""Experience that was collected says what happened, makes its environment again, and gives the same episodes there."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import fieldgym
from fieldgym import env_ids
from fieldgym.agents import make_policy
from fieldgym.agents.datasets import LEVELS, collect, level_policy
from fieldgym.scripts import cli

pytestmark = pytest.mark.portable
minari = pytest.importorskip("minari", reason="the datasets extra is not installed")
OWN = tuple(env_id for env_id in env_ids() if env_id.startswith("fieldgym/"))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    return tmp_path


def gathered(env_id: str, policy: str, name: str, seeds: list[int]) -> Any:
    return collect(lambda env: make_policy(policy, env, 3), env_id, seeds, name, algorithm=policy, backend="analytic")


@pytest.mark.parametrize("env_id", OWN)
def test_a_recovered_environment_plays_the_same_episodes(env_id: str) -> None:
    written = gathered(env_id, "random", "own/random-v0", [5, 2_000_000_007])
    dataset = minari.load_dataset("own/random-v0")
    env: Any = dataset.recover_environment()
    assert env.unwrapped.backend == "analytic" and env.spec.id == env_id
    facts = list(dataset.storage.get_episode_metadata([0, 1]))
    for episode, fact, total in zip(dataset.iterate_episodes(), facts, written.returns, strict=True):
        field = dataset.storage.data_path / fact["field"]
        for options in (None, {"field": field}):
            seen, _ = env.reset(seed=int(fact["seed"]), options=options)
            terminated = truncated = False
            for i, action in enumerate(episode.actions):
                assert all(np.array_equal(values[i], seen[name]) for name, values in episode.observations.items())
                assert seen["action_mask"][action]
                seen, reward, terminated, truncated, info = env.step(action)
                assert (reward, terminated, truncated) == (
                    episode.rewards[i], episode.terminations[i], episode.truncations[i],
                )  # fmt: skip
                for part in ("rewards", "phases_s", "scorecard"):
                    told = {name: values[i + 1] for name, values in episode.infos[part].items()}
                    np.testing.assert_equal(told, info[part])
            assert terminated or truncated
        assert fact["return"] == total == pytest.approx(episode.rewards.sum(), rel=1e-12)
    assert [int(fact["seed"]) for fact in facts] == [5, 2_000_000_007]
    assert {str(fact["fieldgym"]) for fact in facts} == {fieldgym.__version__}
    env.close()


def test_one_command_writes_a_set_a_level_and_none_twice(folder: Path) -> None:
    command = ["collect", "SafflowerPicking", "--episodes", "2"]
    done = CliRunner().invoke(cli.app, command)
    assert done.exit_code == 0, done.output
    assert [line.split(":")[0] for line in done.stdout.splitlines()] == [
        f"fieldgym/SafflowerPicking/{level}-v0" for level in LEVELS
    ]
    for level in LEVELS:
        dataset = minari.load_dataset(f"fieldgym/SafflowerPicking/{level}-v0")
        assert dataset.total_episodes == 2
        assert dataset.storage.metadata["algorithm_name"] == level_policy(OWN[0], level)
    again = CliRunner().invoke(cli.app, [*command, "--policy", "random"])
    assert again.exit_code != 0
    assert str(again.exception) == (
        "a dataset is called 'fieldgym/SafflowerPicking/random-v0' already: take another name, or -v1"
    )


@pytest.mark.parametrize("name", ["no version", "a/b", "../up-v0"])
def test_names_that_minari_does_not_take_are_refused_before_anything_is_played(name: str, folder: Path) -> None:
    with pytest.raises(ValueError, match="give a name of the form namespace/name-v0"):
        gathered(OWN[0], "random", name, [1])
    assert not list(folder.iterdir())


def test_without_minari_a_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "minari", None)
    with pytest.raises(ImportError, match=r'^datasets need Minari: pip install "fieldgym\[datasets\]"$') as told:
        gathered(OWN[0], "random", "own/random-v0", [1])
    assert told.value.name == "minari"  # the command tells it by this name


@pytest.mark.parametrize("env_id", OWN)
def test_every_environment_has_its_levels(env_id: str) -> None:
    assert [level_policy(env_id, level) for level in LEVELS][::2] == ["learned", "random"]
