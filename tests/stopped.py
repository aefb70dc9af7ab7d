"""Stops at which something could be done, for tests of bounds."""

import numpy as np

from fieldgym.bounds import stops


def some_stops(seed: int, count: int = 2, targets: int = 2) -> list[stops.Stop]:
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        places = rng.random((targets + 1, 2))
        gain = rng.random((targets, 2)) + 0.1
        found.append(
            stops.Stop(
                gain=gain,
                other=np.zeros((targets, 2)),
                process_s=0.3 + rng.random((targets, 2)),
                approach_s=np.linalg.norm(places[:, None] - places[None, 1:], axis=-1),
                leave_s=0.2 + rng.random(targets + 1),
            )
        )
    return found
