"""What the transplanter's planners believe of a pair is what its reports promise, every outcome counted one by one."""

from itertools import product

import numpy as np
import pytest

from fieldgym.agents.policies.tray_belief import TrayBelief
from fieldgym.envs.transplanting.config import ORDERS, PerceptionModel, TransplantingConfig
from fieldgym.envs.transplanting.config import SCENARIOS as TRAYS
from fieldgym.envs.transplanting.process import speed_chances


@pytest.mark.parametrize("scenario", ["replug-high", "orders"])
def test_a_transplant_gains_what_its_reports_promise(scenario):
    """Every content of both cells, and whatever becomes of the plug, counted one by one."""
    config = TransplantingConfig(scenario=(TRAYS | ORDERS)[scenario])
    work, ordered = config.scenario, config.scenario.orders.on
    eyes = PerceptionModel(
        ((0.9, 0.06, 0.04), (0.03, 0.9, 0.07), (0.05, 0.25, 0.7)), ((0.8, 0.1, 0.1), (0.1, 0.8, 0.1), (0.1, 0.2, 0.7))
    )
    share = work.orders.supply[1] if ordered else work.poor
    sown = [work.vacancy, (1.0 - work.vacancy) * (1.0 - share), (1.0 - work.vacancy) * share]
    waits = sown if work.replug else [1.0, 0.0, 0.0]
    machine = np.zeros((1, 43), np.float32)
    machine[0, 7:11] = 0.5, 0.0, 0.0, share
    empty, damaged = 0, 3
    for second, clear in product((False, True) if ordered else (False,), (False, True)):
        want = 2 if second else 1
        seen = 3 - want if clear else empty
        cells, spoiled, weight = np.zeros(3), np.zeros(3), 0.0
        for plug, there in product(range(3), range(3)):
            chance = sown[plug] * eyes.source[plug][want] * waits[there] * eyes.target[there][seen]
            weight += chance
            for speed, (lose, hurt) in enumerate(speed_chances(config.machine, config.process)):
                grips = config.process.extraction if plug != empty else 0.0
                left = empty if clear else there
                for now, odds in (
                    (left, 1.0 - grips * (1.0 - lose)),
                    (damaged if left != empty else plug, grips * (1.0 - lose) * (1.0 - hurt)),
                    (damaged, grips * (1.0 - lose) * hurt),
                ):
                    cells[speed] += chance * odds * (float(now == want) - float(there == want))
                good = grips * (1.0 - lose) * (1.0 - hurt) * (plug == want and left == empty)
                spoiled[speed] += chance * ((plug == 1 or (ordered and plug == 2)) - good)
        gains = TrayBelief(config, eyes).gains({"machine": machine}, np.array([second]), np.array([clear]))
        assert gains.cells[0] == pytest.approx(cells / weight, abs=1e-6)
        assert gains.spoiled[0] == pytest.approx(spoiled / weight, abs=1e-6)
