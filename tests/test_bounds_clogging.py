"""What a bag that fills up costs at least, recomputed pair by pair."""

import numpy as np
import pytest

from fieldgym.bounds.clogging import clogging


def test_prices_of_a_bag_miss_what_it_lets_drop_by_the_squares_that_they_leave_out():
    """Layer by layer half the square of what the bag holds less its price; so they are exact where both are equal."""
    rng, saved = np.random.default_rng(7), 0.4
    for n in (1, 2, 5, 9):
        more, least = rng.uniform(0.01, 0.1, (n, 1)), rng.uniform(0.1, 0.5, (n, 1))
        found = clogging([more[: n // 2], more[n // 2 :]], [least[: n // 2], least[n // 2 :]], saved)
        assert found.saved == saved
        ratio, v = (more / least)[:, 0], least[:, 0]
        pairs = [v[i] * v[j] * min(ratio[i], ratio[j]) for i in range(n) for j in range(i)]
        layers = np.sort(ratio)
        widths, heights = np.diff(layers, prepend=0.0), (n - np.arange(n)) / n
        prices = heights * np.sqrt(2.0 * saved / (heights**2 @ widths))
        held = np.array([v[ratio >= layer].sum() for layer in layers])
        missed = 0.5 * widths @ (held - prices) ** 2
        assert sum(pairs) - (sum(cost.sum() for cost in found.costs) - saved) == pytest.approx(missed)
