"""The same picture, to the last bit, on every processor: plain ones, without wide vectors, with another BLAS."""

import os
import subprocess
import sys

import numpy as np
import pytest

CODE = """
import hashlib
import numpy as np
from fieldgym.envs.safflower.scene import Looks, PickerScene
from fieldgym.envs.sorting.config import SortingConfig
from fieldgym.envs.sorting.scene import ShownItem, SorterScene, item_colour
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.scene import WeederScene

digest = hashlib.sha256()

def add(frame):
    digest.update(frame.rgb.tobytes())
    digest.update(frame.depth_m.tobytes())

rng = np.random.default_rng(4)
picker = PickerScene()
n, p = 24, 4
base = np.column_stack([0.15 * np.arange(p), np.zeros(p), np.zeros(p)])
plant = rng.integers(0, p, n)
head = base[plant] + rng.uniform((-0.1, -0.1, 0.75), (0.1, 0.1, 0.88), (n, 3))
picker.load(Looks(head, rng.integers(0, 4, n), rng.uniform(0.04, 0.056, n), plant, rng.random(n) < 0.3, base,
                  np.full(p, 0.86), np.full(p, 0.25), False))
picker.set_machine(0.0, [0.09, -0.33])
add(picker.look())
digest.update(picker.render(320, 240).tobytes())
sorter = SorterScene(SortingConfig())
sorter.set_belt(0.02)
sorter.set_items([ShownItem(k, np.array([-0.6 + 0.02 * k, 0.03 * k - 0.1, 0.82]), np.array([0.8, 0.36, 0.0, 0.48]),
                            (0.07, 0.05, 0.04), item_colour(k % 2 == 0, 0.1 * k, 0.5)) for k in range(8)])
sorter.set_machine([0.03, -0.02, 0.04, 0.1, -0.1, 0.4])
add(sorter.look())
digest.update(sorter.render(320, 240).tobytes())
config = WeedingConfig()
weeder = WeederScene(config, config.parameters)
weed = rng.uniform((-0.2, -0.15), (0.6, 0.15), (30, 2))
crop = np.array([[0.0, 0.0], [0.25, 0.0]])
weeder.load(weed, rng.integers(0, 2, 30), rng.integers(0, 3, 30), rng.random(30), crop, 7)
add(weeder.look_front(-0.6))
add(weeder.look_tool(np.array([0.1, 0.0, 0.87]), weed[0]))
weeder.set_machine(-0.5, [0.02, 0.6, 0.1, -0.1], True)
digest.update(weeder.render(320, 240).tobytes())
print(digest.hexdigest())
"""


def drawn(**settings: str) -> str:
    command = [sys.executable, "-W", "ignore", "-c", CODE]
    result = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **settings}, check=True)
    return result.stdout.strip()


@pytest.mark.slow
def test_pictures_are_the_same_bits_on_other_processors():
    core = np._core._multiarray_umath  # type: ignore[attr-defined]
    wide = [name for name in core.__cpu_dispatch__ if core.__cpu_features__.get(name)]
    here = drawn()
    assert len(here) == 64
    assert drawn(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="") == here
    assert drawn(NPY_DISABLE_CPU_FEATURES=" ".join(wide), OPENBLAS_CORETYPE="Nehalem") == here
