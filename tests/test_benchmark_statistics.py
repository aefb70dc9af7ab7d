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
