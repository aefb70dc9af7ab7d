"""The same picture, to the last bit, on every processor: plain ones, without wide vectors, with another BLAS."""

import os
import subprocess
import sys

import numpy as np
import pytest


def drawn(**settings: str) -> str:
    """Digests of every camera's picture and of those for people, from a process of its own."""
    command = [sys.executable, "-W", "ignore", "-m", "fieldgym.scripts.compare_renderers", "--hashes"]
    result = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **settings}, check=True)
    return result.stdout.strip()


@pytest.fixture(scope="module")
def here() -> str:
    return drawn()


@pytest.mark.slow
def test_pictures_are_the_same_bits_without_wide_registers(here: str):
    core = np._core._multiarray_umath  # type: ignore[attr-defined]
    wide = [name for name in core.__cpu_dispatch__ if core.__cpu_features__.get(name)]
    assert len(here.splitlines()) == 17
    assert drawn(NPY_DISABLE_CPU_FEATURES=" ".join(wide), OPENBLAS_CORETYPE="Nehalem") == here


@pytest.mark.slow  # compiles all pictures once more
def test_pictures_are_the_same_bits_from_machine_code_for_any_processor(here: str):
    assert drawn(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="") == here
