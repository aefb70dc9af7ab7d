"""The full suite's structure, killed in the middle: what is finished stays, and the table is the same in the end."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from waiting import until

from fieldgym.benchmark import store, suites
from fieldgym.benchmark.record import digest, key

pytestmark = pytest.mark.portable

SEEDS = 4
WORDS = ["benchmark", "--suite", "full", "--env", "SafflowerPicking", "--backend", "analytic", "--perception", "model"]
POLICIES = ("fixed-order", "grams-per-second")
WORDS += ["--episodes", str(SEEDS), "--policies", ",".join(POLICIES)]
CLOCKED = ("decision_ms", "decision_p95_ms", "wall_s")


def start(folder: Path, *words: str) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "fieldgym.scripts.cli", *WORDS, "--jobs", "2", "--out", str(folder), *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)


def finish(process: "subprocess.Popen[str]") -> str:
    output, errors = process.communicate(timeout=600)
    assert process.returncode == 0, errors
    return output


def simulated(folder: Path) -> str:
    return digest(record for name in (store.EPISODES, store.BOUNDS) for record in store.read(folder / "full" / name))


def table(folder: Path) -> list[dict]:
    """The summary without what clocks measured."""
    rows = json.loads((folder / "full" / "summary.json").read_text())
    for row in rows:
        row["scores"] = {name: value for name, value in row["scores"].items() if name not in CLOCKED}
    return rows


@pytest.mark.slow
def test_a_full_suite_killed_in_the_middle_resumes_to_the_same_table(tmp_path: Path):
    whole, torn = tmp_path / "whole", tmp_path / "torn"
    told = finish(start(whole))
    assert "points below the bound" in " ".join(told.split())

    process = start(torn)
    episodes, bounds = (torn / "full" / name for name in (store.EPISODES, store.BOUNDS))
    until(lambda: process.poll() is not None or (bounds.exists() and bounds.read_bytes().count(b"\n") >= 1))
    process.kill()
    process.communicate()
    asked = suites.suite("full", ["fieldgym/SafflowerPicking-v0"])
    asked = asked.narrowed(policies=POLICIES, episodes=SEEDS, backend="analytic", perception="model")
    wanted = len(asked.episodes())
    before = [line for path in (episodes, bounds) for line in path.read_bytes().split(b"\n")[:-1]]
    assert 1 < len(before) < wanted
    with open(bounds, "ab") as file:
        file.write(b'{"env_id": "fieldgym/Saff')

    told = finish(start(torn, "--resume"))
    assert f"{wanted} episodes, {len(before)} of them finished earlier" in told
    records = [record for path in (episodes, bounds) for record in store.read(path)]
    assert len({key(record) for record in records}) == len(records) == wanted
    assert set(before) <= {line for path in (episodes, bounds) for line in path.read_bytes().split(b"\n")}
    assert simulated(torn) == simulated(whole)
    assert table(torn) == table(whole)
