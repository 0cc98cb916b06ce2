"""The unit of a name is its end."""

import pytest

from vibrolock.units import UNITS, titled, unit_of


@pytest.mark.parametrize(
    ("field", "unit"),
    [
        ("levels_v[3]", "V"),
        ("limits.force_n", "N"),
        ("rate_1_s", "1/s"),
        ("stiffness_n_m", "N/m"),
        ("response_integral_per_s", "1/s"),
        ("modes", ""),
        ("speed_m_s", "m/s"),
    ],
)
def test_the_unit_of_a_field_follows_from_its_name(field, unit):
    assert unit_of(field) == unit


def test_no_end_hides_a_longer_one():
    ends = list(UNITS)
    assert not [(a, b) for i, a in enumerate(ends) for b in ends[i + 1 :] if b.endswith(f"_{a}")]


def test_a_key_is_titled_in_words_with_its_unit():
    assert titled("lowest_frequency_hz") == "lowest frequency (Hz)"
    assert titled("seed") == "seed"
