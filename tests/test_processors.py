"""What is computed does not depend on the processor, on threads, or on whether there is machine code."""

import math
import os
import re
import subprocess
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fieldgym.kernels.elementary import exp, power

DIGESTS = Path(__file__).with_name("digests.py")
_CPU: Any = import_module("numpy._core._multiarray_umath")
WIDE = " ".join(name for name in _CPU.__cpu_dispatch__ if _CPU.__cpu_features__.get(name))
"""What NumPy takes other routines for on this processor."""
FULL, SMALL = ("16", "40"), ("1", "2")


@cache
def digests(*size: str, **variables: str) -> dict[str, str]:
    """By id, from a process of its own."""
    path = os.pathsep.join(filter(None, sys.path))
    done = subprocess.run(
        [sys.executable, str(DIGESTS), *size],
        capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": path, **variables},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return dict(line.split() for line in done.stdout.splitlines())


@pytest.mark.skipif(not WIDE, reason="NumPy has no other routines for this processor")
def test_numpy_s_routines_for_wide_registers_change_nothing() -> None:
    assert digests(*FULL, NPY_DISABLE_CPU_FEATURES=WIDE) == digests(*FULL)


def test_threads_and_hashes_change_nothing() -> None:
    threads = dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    assert digests(*FULL, PYTHONHASHSEED="1", **threads) == digests(*FULL, PYTHONHASHSEED="2")


@pytest.mark.slow  # compiles everything once more
def test_machine_code_for_any_processor_changes_nothing() -> None:
    assert digests(*FULL, NUMBA_CPU_NAME="generic") == digests(*FULL)


@pytest.mark.slow
def test_rules_as_python_change_nothing() -> None:
    assert digests(*SMALL, NUMBA_DISABLE_JIT="1") == digests(*SMALL)


def test_functions_keep_shapes_and_agree_with_numpy_s_to_the_last_digit() -> None:
    rng = np.random.default_rng(0)
    numbers = rng.normal(size=(3, 1, 700)) * 5.0
    for ours, theirs in ((exp(numbers.T), np.exp(numbers.T)), (power(np.abs(numbers), 0.3), np.abs(numbers) ** 0.3)):
        assert ours.shape == theirs.shape
        np.testing.assert_allclose(ours, theirs, rtol=4e-16, atol=0.0)
    assert exp(0.0).shape == () and exp([]).shape == (0,)
    assert exp(numbers[::2, :, ::3])[1, 0, 4] == exp(numbers)[2, 0, 12]


def test_functions_are_those_of_the_c_library_to_the_last_bit() -> None:
    """NumPy's own are not where registers are wide."""
    numbers = np.random.default_rng(1).normal(size=500) * 5.0
    assert exp(numbers).tolist() == [math.exp(number) for number in numbers]
    assert power(np.abs(numbers), 0.3).tolist() == [math.pow(abs(number), 0.3) for number in numbers]


def test_the_rules_take_no_exponentials_of_numpy_s() -> None:
    root = Path(__file__).resolve().parents[1]
    found = {
        path.relative_to(root).as_posix()
        for path in (root / "envs").rglob("*.py")
        if re.search(r"\bnp\.(?:exp|power)\(", path.read_text("utf-8"))
    }
    # A fit that a script makes, and three chances that are only compared with draws.
    assert found == {"envs/weeding/tools/laser/calibration.py", "envs/transplanting/process.py"}
