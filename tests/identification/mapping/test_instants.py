"""Instants that were rounded agree with the even grid that they were made from; uneven ones with none."""

import re

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from identification.mapping.instants import even_sampling, uneven_remark

RATES = st.sampled_from([100.0, 128.0, 1652.0, 2048.0, 5000.0, 8192.0, 12800.0, 25600.0, 44100.0, 51200.0])


@settings(deadline=None)
@given(rate=RATES, size=st.integers(500, 3000), begin=st.sampled_from([0.0, 0.5, 37.25]), decimals=st.integers(6, 9))
def test_instants_in_print_have_the_rate_that_they_were_made_with(rate, size, begin, decimals):
    t = np.array([float(f"{x:.{decimals}f}") for x in begin + np.arange(size) / rate])
    found = even_sampling(t)
    assert found is not None
    assert found.rate_hz == rate
    assert abs(found.start_s - begin) <= 0.51 * 10.0**-decimals


@settings(deadline=None)
@given(rate=RATES, size=st.integers(500, 3000), begin=st.sampled_from([0.0, 10.0, 100.0]))
def test_instants_in_single_precision_have_the_rate_that_they_were_made_with(rate, size, begin):
    t = (begin + np.arange(size) / rate).astype(np.float32)
    assume(float(np.spacing(t[-1])) < 0.9 / rate)
    found = even_sampling(t)
    assert found is not None
    assert found.rate_hz == pytest.approx(rate, rel=2.0 * float(np.spacing(t[-1])) * rate / (size - 1))


@pytest.mark.parametrize("rate", [5000.0, 2048.0, 51200.0])
def test_seconds_since_1970_are_even(rate):
    found = even_sampling(1.7e9 + np.arange(2000) / rate)
    assert found is not None
    assert found.rate_hz == rate


def test_a_rate_that_is_told_elsewhere_goes_before_the_roundest():
    t = np.round(np.arange(10) / 8192.0, 6)
    assert even_sampling(t).rate_hz != 8192.0
    assert even_sampling(t, wanted_hz=8192.0).rate_hz == 8192.0


@pytest.mark.parametrize(
    ("t", "words"),
    [
        (np.cumsum(np.random.default_rng(1).uniform(0.9, 1.1, 5000)), "resample the signals"),
        (
            np.r_[np.arange(500), np.arange(510, 1000)] / 100.0,
            r"from \[499\] to \[500\] it steps by 0.11.*cut the record",
        ),
        (np.round(np.arange(1000) / 51200.0, 4), "does not increase"),
        (np.array([0.0, 1.0, np.nan, 3.0]), r"instant \[2\] is nan"),
        (
            np.round(np.arange(1000) / 100.0 + np.random.default_rng(2).uniform(-2e-3, 2e-3, 1000), 3),
            "not evenly spaced",
        ),
        (np.zeros(1), "has 1 instants"),
    ],
)
def test_uneven_instants_are_refused_with_what_to_do(t, words):
    assert even_sampling(t) is None
    assert re.search(words, uneven_remark(t))
