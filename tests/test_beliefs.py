"""What planners believe of a decision, held to what it brings; weeders at constant speed: test_weeding_outcomes."""

import numpy as np
import pytest

from fieldgym.kernels.seeds import SHOWN
from fieldgym.scripts.beliefs import ACCOUNTS, SHOTS, played

ELSEWHERE = ("fieldgym/LaserWeeding-v0", "fieldgym/HoeWeeding-v0")
HERE = [account for account in ACCOUNTS if account.env_id not in ELSEWHERE and account.policy != "learned"]


@pytest.mark.parametrize("account", HERE, ids=[account.name for account in HERE])
def test_beliefs_hold_over_all_decisions_of_a_few_fields(account):
    """3.5 standard errors are chance: a belief that is off by a tenth fails."""
    # A strip is hundreds of shots.
    seen = played(account, SHOWN.take(3 if account.kind is SHOTS else 10, 600))
    error = seen.happened - seen.believed
    assert abs(error.mean()) < 3.5 * error.std() / np.sqrt(len(error)) < 0.07
