"""On which systems the package runs: without PyBullet, without a folder that can be written, with any Python."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fieldgym import env_ids
from fieldgym.kernels.sums import in_order

pytestmark = pytest.mark.portable
OWN = tuple(env_id for env_id in env_ids() if env_id.startswith("fieldgym/"))

WITHOUT_PYBULLET = """
import sys
sys.modules["pybullet"] = None
import gymnasium as gym
import fieldgym
for env_id in sys.argv[1:]:
    env = gym.make(env_id, backend="analytic")
    _, info = env.reset(seed=1)
    env.step(env.action_space.sample(info["action_mask"]))
    try:
        gym.make(env_id, backend="pybullet")
    except ImportError as error:
        print(error.name, error)
"""
COMMAND_WITHOUT_PYBULLET = """
import sys
sys.modules["pybullet"] = None
sys.argv[0] = "fieldgym"
from fieldgym.scripts.cli import main
main()
"""
WHAT_TO_INSTALL = r'backend="pybullet" needs PyBullet, which is not installed: pip install pybullet'


def run(script: str, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", script, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **variables})


def test_without_pybullet_the_analytic_backend_works_and_the_other_says_what_to_install() -> None:
    done = run(WITHOUT_PYBULLET, *OWN)
    assert done.returncode == 0, done.stderr
    told = done.stdout.splitlines()
    assert len(told) == len(OWN)
    assert all(line.startswith("pybullet " + WHAT_TO_INSTALL) for line in told)


def test_a_command_without_pybullet_ends_with_one_line() -> None:
    done = run(COMMAND_WITHOUT_PYBULLET, "run", "SafflowerPicking", "--backend", "pybullet", "--quiet")
    assert done.returncode == 2
    assert done.stderr.startswith("fieldgym: " + WHAT_TO_INSTALL) and done.stderr.count("\n") == 1


def test_sums_are_rounded_after_each_number() -> None:
    # Python's own sum gives 1.0 for the first since 3.12.
    assert in_order([0.1] * 10) == 0.9999999999999999
    assert in_order([1e16, 1.0, -1e16]) == 0.0
    assert in_order([]) == 0.0


@pytest.mark.slow
@pytest.mark.long  # everything is compiled, and nothing of it kept
def test_without_a_folder_that_can_be_written_an_environment_runs_with_one_warning(tmp_path: Path) -> None:
    nowhere = tmp_path / "file"
    nowhere.write_text("not a folder")
    places = dict.fromkeys(("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"), str(nowhere / "below"))
    done = run(WITHOUT_PYBULLET, "fieldgym/SafflowerPicking-v0", **places)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("Machine code is not kept") == 1


def test_children_of_tests_hear_ctrl_c_where_the_shell_ignores_it() -> None:
    script = (
        "import os, runpy, signal, sys; sys.path.insert(0, os.path.dirname(sys.argv[1])); "
        "signal.signal(signal.SIGINT, signal.SIG_IGN); runpy.run_path(sys.argv[1]); "
        "print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)"
    )
    done = run(script, str(Path(__file__).with_name("conftest.py")))
    assert done.stdout.split() == ["True"], done.stderr
