"""What the first minute costs: importing, compiling, the first step after that."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator

from fieldgym.envs import env_ids
from fieldgym.scripts.speed_lines import Line, cpu_s


def first_use(quick: bool) -> Iterator[Line]:
    """Fresh interpreters, so that nothing is in the process; ``prepare`` starts with an empty cache."""
    repetitions = 3 if quick else 9

    def start(code: str) -> float:
        return min(cpu_s(code) for _ in range(repetitions))

    gymnasium, whole = start("import gymnasium"), start("import fieldgym")
    yield Line("import fieldgym, beyond Gymnasium", whole - gymnasium, "s", 0.15, True, f"Gymnasium {gymnasium:.2f} s")
    if quick:
        return
    with tempfile.TemporaryDirectory(prefix="fieldgym-speed-") as folder:
        code = "from fieldgym.scripts.prepare import main; main()"
        yield Line("fieldgym prepare, empty cache", cpu_s(code, NUMBA_CACHE_DIR=folder), "s", 40.0, True, "all ids")
        for env_id in env_ids():
            code = f"""
import time
import gymnasium, fieldgym
env = gymnasium.make({env_id!r}, backend="analytic")
env.action_space.seed(0)
env.reset(seed=0)
env.step(env.action_space.sample())
"""
            name = env_id.removeprefix("fieldgym/")
            second_s = cpu_s(code, NUMBA_CACHE_DIR=folder) - whole
            yield Line(f"{name}, make to first step", second_s, "s", 1.0, True, "after prepare")
