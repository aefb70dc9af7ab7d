import numpy as np
import pytest
import scipy.stats

from fieldgym.benchmark import statistics


def test_mean_interval_is_the_one_of_scipy():
    values = np.random.default_rng(3).gamma(2.0, 1.0, 40)
    expected = scipy.stats.bootstrap(
        (values,),
        np.mean,
        n_resamples=statistics.RESAMPLES,
        method="BCa",
        rng=np.random.default_rng(statistics.BOOTSTRAP_SEED),
    ).confidence_interval
    result = statistics.mean(values)
    assert (result.value, result.n) == (pytest.approx(values.mean(), rel=1e-12), 40)
    assert (result.low, result.high) == pytest.approx((expected.low, expected.high), rel=1e-12)
    assert statistics.mean(values) == result


@pytest.mark.parametrize("n", [5, 8, 41])
def test_interquartile_interval_is_the_one_of_scipy(n):
    values = np.random.default_rng(n).gamma(2.0, 1.0, n)

    def middle(sample, axis=-1):
        return scipy.stats.trim_mean(sample, 0.25, axis=axis)

    expected = scipy.stats.bootstrap(
        (values,),
        middle,
        n_resamples=statistics.RESAMPLES,
        method="BCa",
        rng=np.random.default_rng(statistics.BOOTSTRAP_SEED),
    ).confidence_interval
    result = statistics.interquartile_mean(values)
    assert result.value == pytest.approx(middle(values), rel=1e-12)
    assert (result.low, result.high) == pytest.approx((expected.low, expected.high), rel=1e-12)


def test_mean_interval_of_many_normal_values_is_the_textbook_one():
    values = np.random.default_rng(5).normal(10.0, 2.0, 400)
    half = 1.96 * values.std(ddof=1) / np.sqrt(400)
    result = statistics.mean(values)
    assert (result.low, result.high) == pytest.approx((values.mean() - half, values.mean() + half), abs=0.02)


def test_intervals_hold_the_true_mean_about_as_often_as_they_say():
    samples = np.random.default_rng(7).normal(1.0, 1.0, (500, 60))
    estimates = [statistics.mean(sample) for sample in samples]
    hits = sum(estimate.low <= 1.0 <= estimate.high for estimate in estimates)
    # Binomial noise is 1 %, and intervals of 60 values are known to be some 1 % too narrow.
    assert 0.91 <= hits / len(samples) <= 0.98


def test_interquartile_mean_ignores_the_outer_quarters():
    result = statistics.interquartile_mean([-1e9, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 1e9])
    assert result.value == pytest.approx(3.5)


def test_paired_difference_sees_what_unpaired_intervals_hide():
    rng = np.random.default_rng(11)
    field = rng.normal(0.0, 5.0, 40)
    first, second = field + 0.5 + rng.normal(0.0, 0.1, 40), field + rng.normal(0.0, 0.1, 40)
    difference = statistics.paired_difference(first, second)
    assert difference.significant
    assert 0.4 < difference.low < 0.5 < difference.high < 0.6
    assert statistics.mean(first).low < statistics.mean(second).high


def test_a_difference_whose_interval_holds_zero_is_not_significant():
    values = np.random.default_rng(13).normal(0.0, 1.0, 30)
    difference = statistics.paired_difference(values - values.mean() + 0.01, np.zeros(30))
    assert difference.low < 0.0 < difference.high
    assert not difference.significant
    assert not statistics.paired_difference([1.0, 2.0], [1.0, 2.0]).significant


def test_too_few_pairs_are_never_significant():
    one, zero = np.ones(statistics.FEWEST_PAIRS), np.zeros(statistics.FEWEST_PAIRS)
    assert statistics.paired_difference(one, zero).significant
    assert not statistics.paired_difference(one[1:], zero[1:]).significant


@pytest.mark.parametrize("values", [[], [np.nan]])
def test_no_values_have_no_mean(values):
    result = statistics.mean(values)
    assert result.n == 0
    assert np.isnan([result.value, result.low, result.high]).all()


def test_one_value_has_no_interval_and_equal_ones_a_point():
    single = statistics.mean([2.0, np.inf])
    assert (single.value, single.n) == (2.0, 1)
    assert np.isnan([single.low, single.high]).all()
    assert statistics.mean([3.0, 3.0, 3.0]) == statistics.Estimate(3.0, 3.0, 3.0, 3)


@pytest.mark.filterwarnings("error")
def test_where_the_jackknife_does_not_vary_the_percentiles_serve():
    result = statistics.interquartile_mean([0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 5.0])
    assert result.value == 1.0
    assert result.low <= 1.0 <= result.high


def test_pairs_must_match():
    with pytest.raises(ValueError, match="paired"):
        statistics.paired_difference([1.0, 2.0], [1.0])
    result = statistics.paired_difference([1.0, np.nan, 4.0], [0.0, 1.0, 2.0])
    assert (result.value, result.n) == (1.5, 2)


def test_a_difference_has_the_p_value_of_the_paired_t_test():
    rng = np.random.default_rng(23)
    first, second = rng.normal(0.3, 1.0, 40), rng.normal(0.0, 1.0, 40)
    expected = scipy.stats.ttest_rel(first, second).pvalue
    assert statistics.paired_difference(first, second).p == pytest.approx(expected, rel=1e-9)
    assert statistics.paired_difference([2.0] * 4, [1.0] * 4).p == 0.5**3  # four signs alike, either way
    assert statistics.paired_difference([1.0, 2.0], [1.0, 2.0]).p == 1.0
    assert np.isnan(statistics.paired_difference([1.0], [0.0]).p)


def test_together_comparisons_are_held_to_holm_s_steps():
    values = {"a": 0.01, "b": 0.04, "c": 0.03, "d": 0.005, "lone": np.nan}
    items = {key: statistics.Difference(1.0, 0.1, 2.0, 20, p) for key, p in values.items()}
    found = statistics.compared(items)
    # 4 x 0.005, 3 x 0.01, 2 x 0.03, and 0.04 alone, which may not fall below the step before it.
    assert [found[key].together for key in "dacb"] == pytest.approx([0.02, 0.03, 0.06, 0.06])
    assert [found[key].stands for key in "dacb"] == [True, True, False, False]
    assert all(item.significant for item in found.values())
    assert np.isnan(found["lone"].together) and found["lone"].stands
    assert statistics.compared({1: items["b"]})[1].together == 0.04


def test_wins_are_shares_of_pairs_and_ties_are_halves():
    found = statistics.paired_wins([3.0, 2.0, 1.0, 5.0, np.nan], [1.0, 2.0, 4.0, 4.0, 0.0])
    assert (found.value, found.n) == (0.625, 4)
    with pytest.raises(ValueError, match="paired"):
        statistics.paired_wins([1.0], [1.0, 2.0])


def test_the_front_is_of_those_that_nobody_beats():
    spots = {"fast": (0.6, -1.0), "sure": (0.9, -3.0), "twin": (0.9 + 1e-12, -3.0), "slow": (0.8, -3.0)}
    assert statistics.front({**spots, "idle": (0.0, np.nan)}) == {"fast", "sure", "twin"}


def test_over_tasks_each_counts_the_same_and_is_resampled_by_itself():
    few, many = np.array([0.2, 0.6]), np.random.default_rng(29).uniform(0.5, 1.0, 40)
    share, low, high = statistics.profile([few, many], [0.1, 0.55, 1.01])
    assert share == pytest.approx([1.0, 0.5 * (0.5 + np.mean(many >= 0.55)), 0.0])
    assert (low[0], high[0], high[2]) == (1.0, 1.0, 0.0) and low[1] < share[1] < high[1]
    same = [np.random.default_rng(31).normal(0.0, 1.0, 200)] * 4
    # Four tasks that are alike: half as wide as one, which equal draws for all of them would not be.
    (one, four) = (statistics.mean_of_means(groups) for groups in (same[:1], same))
    assert four.value == pytest.approx(one.value) and four.n == 800
    assert (four.high - four.low) / (one.high - one.low) == pytest.approx(0.5, abs=0.05)
