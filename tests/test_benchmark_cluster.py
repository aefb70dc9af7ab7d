"""Episodes on a cluster: the same records, whatever becomes of a worker; a stand-in for Ray loses some on purpose."""

import os
import signal
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from fieldgym.benchmark import cluster, runner
from fieldgym.benchmark.episode import run_episode
from fieldgym.benchmark.record import Record, identity, key, untimed
from fieldgym.benchmark.suites import BOUND, Case, Condition, Episode, Suite, suite

CONDITION = Condition("fieldgym/Stand-v0", "pots", "analytic", "model")
SMALL = Suite("quick", (Case(CONDITION, ("first", "second"), "first", (0, 1, 2, 3)),))
BOUNDED = Suite("quick", (Case(CONDITION, ("first", "second"), "first", (0, 1, 2, 3), bounds=4),))


def instead(episode: Episode, cancelled: Any) -> Record:
    """A result that only the episode decides."""
    if episode.policy == BOUND:
        return {**identity(episode), "bound": {"net_rate": None, "episode_return": 9.0, "curve": []}}
    card = {"net_rate": 0.1 * episode.seed, "cycle_time_s": None}
    return {**identity(episode), "return": float(len(episode.policy)), "scorecard": card}


class WorkerCrashedError(Exception):
    """A worker is gone."""


class StandIn:
    """As much of Ray as is used, in this process; ``losing`` says which begun tasks lose their worker."""

    def __init__(self, losing: Any = lambda policy, seed, attempt: False, started: bool = False):
        self.losing, self.started = losing, started
        self.stopped, self.cancelled = False, 0
        self.begun: dict[tuple[str, int], int] = {}
        self.most_under_way = 0
        self.exceptions = SimpleNamespace(
            WorkerCrashedError=WorkerCrashedError, NodeDiedError=WorkerCrashedError, OutOfMemoryError=WorkerCrashedError
        )

    def is_initialized(self) -> bool:
        return self.started

    def init(self, **options: Any) -> None:
        self.started = True

    def shutdown(self) -> None:
        self.stopped = True

    def cluster_resources(self) -> dict[str, float]:
        return {"CPU": 3.0}

    def remote(self, **options: Any) -> Any:
        assert options == {"num_cpus": 1, "max_retries": 0}
        return lambda function: SimpleNamespace(remote=lambda *given: (function, given, object()))

    def wait(self, references: list[Any], num_returns: int) -> tuple[list[Any], list[Any]]:
        self.most_under_way = max(self.most_under_way, len(references))
        return references[-num_returns:], references[:-num_returns]

    def get(self, reference: Any) -> Any:
        function, given, _ = reference
        name = (given[1].policy, given[1].seed)
        self.begun[name] = self.begun.get(name, 0) + 1
        if self.losing(*name, self.begun[name]):
            raise WorkerCrashedError
        return function(*given)

    def cancel(self, reference: Any, force: bool) -> None:
        self.cancelled += 1


def by_key(records: list[Record]) -> dict[Any, Record]:
    return {key(record): record for record in records}


def test_a_cluster_gives_the_records_of_one_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    stand_in = StandIn()
    monkeypatch.setattr(cluster, "load", lambda: stand_in)
    small = BOUNDED
    local = runner.run_suite(small, tmp_path / "local", run=instead)
    spread = runner.run_suite(small, tmp_path / "ray", jobs=2, run=instead, engine="ray")
    assert by_key(spread.records) == by_key(local.records)
    assert by_key(spread.bounds) == by_key(local.bounds)
    assert stand_in.most_under_way == 2
    assert stand_in.stopped


def test_a_policy_s_file_is_found_on_a_node_or_told(tmp_path: Path):
    path = tmp_path / "mine.py"
    path.write_text(
        "class Mine:\n    def act(self, observation):\n        return observation['action_mask'].argmax(axis=1)\n"
    )
    name = f"{path}:Mine"
    small = suite("quick", ["fieldgym/SafflowerPicking-v0"]).narrowed(None, [name], 1, "analytic").traced()
    (record,) = cluster.run_on_ray(small.episodes(), run_episode, ray=StandIn())
    (source,) = small.cases[0].sources
    assert (record["policy"], record["source"], record["terminated"]) == (name, source.sha256, True)
    path.unlink()
    (record,) = cluster.run_on_ray(small.episodes(), run_episode, ray=StandIn())
    assert f"cannot read {path}" in record["error"]


def test_an_episode_that_lost_its_worker_runs_again():
    stand_in = StandIn(lambda policy, seed, attempt: seed == 1 and attempt == 1)
    todo = SMALL.episodes()
    records = list(cluster.run_on_ray(todo, instead, ray=stand_in))
    assert by_key(records) == by_key([instead(episode, None) for episode in todo])
    assert {name: count for name, count in stand_in.begun.items() if count > 1} == {("first", 1): 2, ("second", 1): 2}


def test_an_episode_that_kills_every_worker_is_given_up_and_told():
    stand_in = StandIn(lambda policy, seed, attempt: (policy, seed) == ("second", 2))
    records = list(cluster.run_on_ray(SMALL.episodes(), instead, ray=stand_in))
    assert len(records) == 8
    (lost,) = [record for record in records if "error" in record]
    assert (lost["policy"], lost["seed"]) == ("second", 2)
    assert "3 workers died" in lost["error"]
    assert stand_in.begun["second", 2] == cluster.ATTEMPTS


def test_a_node_with_another_state_of_the_package_is_told(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(cluster, "_own_digest", lambda: "another")
    stand_in = StandIn()
    with pytest.raises(cluster.EngineError, match="install the same one on every node"):
        list(cluster.run_on_ray(SMALL.episodes(), instead, ray=stand_in))
    assert stand_in.cancelled == 5 and stand_in.stopped


def test_a_cluster_that_was_there_before_is_left_running():
    stand_in = StandIn(started=True)
    list(cluster.run_on_ray(SMALL.episodes()[:2], instead, ray=stand_in))
    assert not stand_in.stopped


def test_a_cluster_that_cannot_be_reached_is_told():
    class Away(StandIn):
        def init(self, **options: Any) -> None:
            raise ConnectionError("nobody\nanswers")

    with pytest.raises(cluster.EngineError, match=r"cannot reach the Ray cluster \(nobody answers\)"):
        list(cluster.run_on_ray(SMALL.episodes(), instead, ray=Away()))


def test_without_ray_one_line_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(cluster.EngineError, match="pip install ray"):
        runner.run_suite(SMALL, tmp_path / "results", engine="ray")
    assert not (tmp_path / "results").exists()


class KillsOnce:
    """Runs episodes, and the first worker that meets a seed dies of it."""

    def __init__(self, seed: int, mark: Path):
        self.seed, self.mark = seed, mark

    def __call__(self, episode: Episode, cancelled: Any) -> Record:
        if episode.seed == self.seed and not self.mark.exists():
            self.mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return run_episode(episode, cancelled)


@pytest.mark.slow
@pytest.mark.long
def test_with_ray_itself_a_killed_worker_costs_nothing(tmp_path: Path):
    pytest.importorskip("ray")
    tiny = suite("full").narrowed("fieldgym/SafflowerPicking-v0", ("nearest", "learned"), 3, "analytic")
    seed = tiny.cases[0].seeds[1]
    local = runner.run_suite(tiny, tmp_path / "local")
    killer = KillsOnce(seed, tmp_path / "killed")
    spread = runner.run_suite(tiny, tmp_path / "ray", jobs=2, run=killer, engine="ray")
    assert killer.mark.exists()
    assert spread.failures == []
    for one, other in ((local.records, spread.records), (local.bounds, spread.bounds)):
        assert by_key([untimed(record) for record in one]) == by_key([untimed(record) for record in other])
