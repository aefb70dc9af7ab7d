"""Checkpoints and policies that somebody else may have written: what is odd is refused in one line, before it runs."""

import dataclasses
import json
import os
import random
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.agents.learning import portable
from fieldgym.agents.learning.runs import CheckpointError, Journal
from fieldgym.agents.learning.train_settings import TrainSettings
from fieldgym.agents.policies.weights import PolicyFileError
from fieldgym.envs import env_ids
from fieldgym.kernels.locks import FolderBusyError, FolderLock

ID = "fieldgym/SafflowerPicking-v0"
SMALL = TrainSettings(
    scenario="pots",
    steps=64,
    num_envs=4,
    n_steps=16,
    batch_size=32,
    n_epochs=1,
    hidden=8,
    critic_hidden=8,
    evaluate_every=1,
    evaluation_episodes=2,
)


# Checkpoints


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("sb3_contrib")
    pytest.importorskip("tensorboard")
    from fieldgym.agents.learning.training import train

    folder = tmp_path_factory.mktemp("trained")
    train(ID, SMALL, folder, threads=1)
    return folder


def resumed(folder: Path, state: dict[str, Any]) -> None:
    """Go on from a checkpoint that was changed, one more update."""
    import torch

    from fieldgym.agents.learning.training import train

    folder.mkdir(exist_ok=True)
    torch.save({**state, "text": json.dumps(state["text"])}, folder / "state.pt")
    train(ID, dataclasses.replace(SMALL, steps=128), folder, resume=True, threads=1)


def changed(part: str, name: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(state: dict[str, Any]) -> None:
        state[part][name][(0,) * state[part][name].ndim] = value

    return change


def replaced(part: str, name: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(state: dict[str, Any]) -> None:
        state[part][name] = value

    return change


def numpy_position(state: dict[str, Any]) -> None:
    state["text"]["numpy"][1] = 10**9


def float_reports(state: dict[str, Any]) -> None:
    state["core"]["state.slot_report"] = state["core"]["state.slot_report"].double() * float("nan")


def small_memory(state: dict[str, Any]) -> None:
    import torch

    state["optimizer"]["state"][0]["exp_avg"] = torch.zeros(1)


CHANGES = {
    "slot_report points": changed("core", "state.slot_report", 10**12),
    "track_head points": changed("core", "state.track_head", -5),
    "first points": changed("core", "state.first", 10**9),
    "cursor points": changed("core", "state.cursor", -1),
    "stop_end points": changed("core", "state.stop_end", 10**6),
    "stop points": changed("core", "state.stop", 10**6),
    "head_stage points": changed("core", "state.head_stage", 77),
    "slot_report does not fit": float_reports,
    "generator is none": numpy_position,
    "optimiser does not fit": small_memory,
    "last observation does not fit": lambda state: state["last_obs"].pop("action_mask"),
    "updates are no counts": replaced("text", "n_updates", -1),
    "steps or updates": replaced("text", "num_timesteps", "many"),
    "episodes are no numbers": replaced("text", "episodes", [{"r": "x", "l": 1, "t": 0}]),
    "TypeError": replaced("text", "generators", 3),
    "ValueError": replaced("text", "generators", []),
    "KeyError": lambda state: state.pop("core"),
    "settings": lambda state: state["text"]["run"].pop("settings"),
    "latest episodes": lambda state: state["text"]["run"].update(recent=["x"]),
    "steps, updates or curve": lambda state: state["text"]["run"].update(curve=3),
}


@pytest.mark.parametrize("told", CHANGES)
def test_a_checkpoint_that_does_not_fit_is_refused_in_one_line(trained: Path, tmp_path: Path, told: str):
    from fieldgym.agents.learning import checkpoint

    state = checkpoint.read(trained / "state.pt")
    CHANGES[told](state)
    with pytest.raises(CheckpointError, match=rf"{told}.*: start without --resume$") as error:
        resumed(tmp_path, state)
    assert "\n" not in str(error.value)


def test_an_unchanged_checkpoint_goes_on(trained: Path, tmp_path: Path):
    from fieldgym.agents.learning import checkpoint

    resumed(tmp_path, checkpoint.read(trained / "state.pt"))


@pytest.mark.parametrize("env_id", env_ids())
def test_whatever_whole_number_is_changed_it_fits_or_is_refused_before_anything_runs(env_id: str):
    """Out of bounds a kernel would read foreign memory; every array of whole numbers that it may use is guarded."""
    pytest.importorskip("stable_baselines3")
    from fieldgym.agents.learning.sb3 import make_vec_env
    from fieldgym.envs.state import held

    env = make_vec_env(env_id, 3, 0)
    env.reset()
    core = env.native.core
    counters = {"episode", "sensor_seed"}
    whole = {
        name: array
        for name, array in held(core).items()
        if array.dtype.kind in "iu" and array.size and name not in counters
    }
    assert len(whole) > 4 and core.misplaced() == ""
    for name, array in whole.items():
        before = array.copy()
        for odd in (-1, 127 if array.dtype == np.int8 else 10**9):
            array.flat[-1] = odd
            assert core.misplaced() == name.rpartition(".")[2]
            array[...] = before
    assert core.misplaced() == ""


@pytest.mark.parametrize("data", [b"", b"PK", b"\x80\x04.", b"[" * 1000])
def test_a_file_that_is_no_checkpoint_is_told_in_one_line(tmp_path: Path, data: bytes):
    pytest.importorskip("torch")
    from fieldgym.agents.learning import checkpoint

    (tmp_path / "state.pt").write_bytes(data)
    with pytest.raises(CheckpointError, match=r"is damaged .*: start without --resume$") as told:
        checkpoint.read(tmp_path / "state.pt")
    assert "\n" not in str(told.value)


def test_a_failed_resume_leaves_no_folder_and_a_second_run_none_of_its_files(trained: Path, tmp_path: Path):
    from fieldgym.agents.learning.training import train

    with pytest.raises(CheckpointError, match="there is no checkpoint"):
        train(ID, SMALL, tmp_path / "none", resume=True)
    assert not (tmp_path / "none").exists()
    with FolderLock(trained), pytest.raises(FolderBusyError, match="another run writes into"):
        train(ID, SMALL, trained, resume=True)
    assert not (trained / ".lock").exists()


def test_whatever_a_journal_finds_it_goes_on_or_tells_in_one_line(tmp_path: Path):
    rng, log = random.Random(0), SimpleNamespace(record=lambda key, value: None, dump=lambda step=0: None)
    odd = (None, "x", [], {}, -1, 2.5, [3], {"a": 1}, True)
    refused = 0
    for _ in range(300):
        journal = Journal(ID, SMALL, 0, tmp_path, log)  # type: ignore[arg-type]
        run = json.loads(json.dumps(journal.text()))
        part = run if rng.random() < 0.5 else run[rng.choice(("settings", "progress"))]
        part[rng.choice(list(part))] = rng.choice(odd)
        try:
            journal.restore(run)
            json.dumps(journal.text())
        except CheckpointError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 100


# Policies


def test_devices_pipes_links_to_them_and_huge_files_are_not_read(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe.npz")
    (tmp_path / "zero.npz").symlink_to("/dev/zero")
    (tmp_path / "folder.npz").mkdir()
    with open(tmp_path / "huge.npz", "wb") as file:
        file.truncate(2**40)
    shipped = portable.shipped(ID)
    assert shipped is not None
    told = {
        "pipe": "it is a pipe",
        "zero": "it is a device",
        "folder": "it is a folder",
        "huge": "it has 1099511627776",
    }
    for name, reason in told.items():
        (tmp_path / f"{name}.json").write_bytes(shipped.with_suffix(".json").read_bytes())
        with pytest.raises(PolicyFileError, match=reason) as error:
            portable.load(tmp_path / f"{name}.npz")
        assert "\n" not in str(error.value)
    for name in ("pipe", "zero"):
        (tmp_path / "card.npz").write_bytes(shipped.read_bytes())
        (tmp_path / "card.json").unlink(missing_ok=True)
        os.link(tmp_path / f"{name}.npz", tmp_path / "card.json", follow_symlinks=False)
        with pytest.raises(PolicyFileError, match="it is a"):
            portable.load(tmp_path / "card.npz")
    (tmp_path / "linked.npz").symlink_to(shipped)
    (tmp_path / "linked.json").symlink_to(shipped.with_suffix(".json"))
    portable.load(tmp_path / "linked.npz")


@pytest.mark.parametrize("env_id", ("fieldgym/SafflowerPicking-v0", "fieldgym/ProduceSorting-v0"))
def test_a_card_of_any_shape_gives_a_policy_or_one_line(tmp_path: Path, env_id: str):
    shipped = portable.shipped(env_id)
    assert shipped is not None
    card = json.loads(shipped.with_suffix(".json").read_text("utf-8"))
    (tmp_path / "p.npz").write_bytes(shipped.read_bytes())
    odd = (None, "x", [], {}, -1, 2.5, 10**99, [[]], [3], {"a": 1}, True, 1e300, ["x"], "\ud800")
    cards: list[Any] = [*odd, *({**card, name: value} for name in card for value in odd)]
    cards += [{key: value for key, value in card.items() if key != name} for name in card]
    env = __import__("gymnasium").make_vec(env_id, 2, vectorization_mode="vector_entry_point")
    refused = 0
    for each in cards:
        (tmp_path / "p.json").write_text(json.dumps(each), "utf-8")
        try:
            portable.load_for(tmp_path / "p.npz", env)
        except PolicyFileError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > len(odd)
