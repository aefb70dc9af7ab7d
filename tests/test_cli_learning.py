"""``fieldgym train`` and ``fieldgym evaluate`` as a user meets them."""

import json
import re
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fieldgym.agents import make_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.agents.learning.runs import Progress
from fieldgym.bounds import instance
from fieldgym.kernels.seeds import CHOOSING
from fieldgym.scripts import cli
from fieldgym.scripts.train_beside import WINDOW_S, TimeLeft

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
        " evaluation_episodes: 2, teacher_decisions: 640, teacher_epochs: 1}"
    )
    out = tmp_path / "run"
    words = ["train", "SafflowerPicking", "--config", str(config), "--out", str(out), "--threads", "1"]
    first = CliRunner().invoke(cli.app, [*words, "--steps", "128"])
    assert first.exit_code == 0, first.output
    assert "environment" in first.stdout and "chosen on, after 128 decisions" in first.stdout
    # Others stand beside the learner before it begins and in every line, with what they return on the same seeds.
    told = re.search(
        r"chosen on: (fixed-order ([-.\d]+), best \(grams-per-second\) ([-.\d]+), bound ([-.\d]+))\n", first.stdout
    )
    assert told is not None
    shown = {}
    for name in ("fixed-order", "grams-per-second"):
        played = evaluate(lambda env, name=name: make_policy(name, env), ENV, CHOOSING.take(2))
        shown[name] = played.returns.mean()
    bound = [instance(ENV, seed).bound().episode_return for seed in CHOOSING.take(2)]
    assert [float(told[i]) for i in (2, 3, 4)] == pytest.approx([*shown.values(), sum(bound) / 2], abs=6e-4)
    assert f"Others there: {told[1]}" in first.stdout
    line = next(line for line in first.stdout.splitlines() if line.startswith("           0  return"))
    assert re.fullmatch(rf" +0  return [-.\d]+ \({re.escape(told[1])}\)", line)
    again = CliRunner().invoke(cli.app, [*words, "--steps", "256"])
    assert again.exit_code != 0 and "--resume" in str(again.exception)
    more = CliRunner().invoke(cli.app, [*words, "--steps", "256", "--resume"])
    assert more.exit_code == 0 and "chosen on, after 256 decisions" in more.stdout
    words = ["evaluate", "SafflowerPicking", "--policy", str(out / "best.npz"), "--episodes", "2", "--json"]
    scored = CliRunner().invoke(cli.app, words)
    assert scored.exit_code == 0 and len(json.loads(scored.stdout)["policies"]) == 2


def test_the_time_left_is_told_from_the_latest_pace():
    left = TimeLeft()

    def after(steps: int, now_s: float) -> float | None:
        return left.after(Progress(steps=steps, total=10_000), now_s)

    # A slow beginning (a resume, a lesson, what compiles) is forgotten once it lies a window back.
    assert after(1000, 0.0) is None
    assert after(1100, 50.0) == pytest.approx(8900 * 50.0 / 100)
    paces = [after(1100 + 100 * i, 50.0 + 10.0 * i) for i in range(1, 8)]
    assert paces[-1] == pytest.approx(8200 * 10.0 / 100) and WINDOW_S == 60.0
    assert after(10_500, 125.0) == 0.0
    # Where one update takes longer than the window, the last two count.
    slow = TimeLeft()
    clock = enumerate((0.0, 900.0, 1000.0, 1100.0))
    paces = [slow.after(Progress(steps=100 * i, total=1000), now_s) for i, now_s in clock]
    assert paces[-1] == pytest.approx(700 * 1.0)
