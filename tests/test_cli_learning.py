"""``fieldgym train`` and ``fieldgym evaluate`` as a user meets them."""

import json
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fieldgym.scripts import cli

ENV = "fieldgym/SafflowerPicking-v0"


def told(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *words: str) -> str:
    """The one line that a mistaken command prints."""
    monkeypatch.setattr(sys, "argv", ["fieldgym", *words])
    with pytest.raises(SystemExit) as left:
        cli.main()
    out, err = capsys.readouterr()
    assert left.value.code == 2 and out == "" and err.count("\n") == 1
    return err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["train", "SafflowerPiking"], "no environment is called"),
        (["train", ENV, "--algo", "dqn"], "choose one of 'maskable-ppo', 'ppo'"),
        (["train", ENV, "--scenario", "rwo"], "did you mean 'row'?"),
        (["train", ENV, "--steps", "0"], "--steps 0: give at least 1"),
        (["train", ENV, "--seed", "-1"], "--seed -1: give 0 to 99999"),
        (["train", ENV, "--threads", "0"], "--threads 0"),
        (["train", ENV, "--config", "/nowhere.yaml", "--out", "/tmp"], "/nowhere.yaml: cannot be read"),
        (["evaluate", ENV, "--policy", "neares"], "did you mean 'nearest'?"),
        (["evaluate", ENV, "--policy", "nowhere.npz"], "nowhere.npz (No such file or directory): a policy is NAME.npz"),
        (["evaluate", ENV, "--policy", "nearest", "--against", "furthest"], "policy 'furthest' is unknown"),
        (["evaluate", ENV, "--policy", "nearest", "--backend", "gazebo"], "no backend is called"),
        (["evaluate", ENV, "--policy", "nearest", "--episodes", "0"], "--episodes 0"),
        (["evaluate", ENV], "Missing option"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_mistake_gets_one_line(capsys, monkeypatch, words, message):
    if words[0] == "train":
        pytest.importorskip("sb3_contrib")
        pytest.importorskip("tensorboard")
        pytest.importorskip("yaml")
    assert message in told(capsys, monkeypatch, *words)


def test_training_without_its_extra_names_it(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    assert 'pip install "fieldgym[rl]"' in told(capsys, monkeypatch, "train", ENV)


def test_evaluate_compares_on_equal_seeds_and_with_the_bound():
    words = ["evaluate", "SafflowerPicking", "--policy", "nearest", "--against", "fixed-order", "--episodes", "3"]
    result = CliRunner().invoke(cli.app, [*words, "--seed", "5", "--scenario", "row", "--bound", "--json"])
    assert result.exit_code == 0
    report = json.loads(result.stdout)
    assert [row["policy"] for row in report["policies"]] == ["nearest", "fixed-order"]
    first, other = report["policies"]
    difference = report["differences"][0]["return"]["mean"]
    assert difference == pytest.approx(first["return"]["mean"] - other["return"]["mean"])
    assert first["gap_return"] >= 0.0 and first["gap_net_rate"] >= 0.0
    table = CliRunner().invoke(cli.app, words)
    assert table.exit_code == 0 and "nearest minus" in table.stdout


def test_train_then_go_on_then_evaluate(tmp_path: Path):
    pytest.importorskip("sb3_contrib")
    pytest.importorskip("tensorboard")
    config = tmp_path / "small.yaml"
    config.write_text(
        "defaults: {num_envs: 8, n_steps: 16, batch_size: 64, n_epochs: 1, hidden: 8, critic_hidden: 8,"
        " evaluation_episodes: 2}"
    )
    out = tmp_path / "run"
    words = ["train", "SafflowerPicking", "--config", str(config), "--out", str(out), "--threads", "1"]
    first = CliRunner().invoke(cli.app, [*words, "--steps", "128"])
    assert first.exit_code == 0, first.output
    assert "environment" in first.stdout and "Held-out seeds after 128 decisions" in first.stdout
    again = CliRunner().invoke(cli.app, [*words, "--steps", "256"])
    assert again.exit_code != 0 and "--resume" in str(again.exception)
    more = CliRunner().invoke(cli.app, [*words, "--steps", "256", "--resume"])
    assert more.exit_code == 0 and "Held-out seeds after 256 decisions" in more.stdout
    words = ["evaluate", "SafflowerPicking", "--policy", str(out / "best.npz"), "--episodes", "2", "--json"]
    scored = CliRunner().invoke(cli.app, words)
    assert scored.exit_code == 0 and len(json.loads(scored.stdout)["policies"]) == 2
