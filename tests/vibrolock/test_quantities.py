"""Units as people and programs spell them, against their definitions."""

import pytest
from hypothesis import given, strategies as st

from vibrolock.quantities import number_in, quantity, says_a_unit, seconds_in

# SI unit and factor: standard gravity 9.80665 m/s2, inch 0.0254 m, pound of force 4.4482216152605 N (NIST SP 811).
KNOWN = {
    **{"N": ("N", 1.0), "Newtons": ("N", 1.0), "newton": ("N", 1.0), "kN": ("N", 1e3), "lbs": ("N", 4.4482216152605)},
    **{"lbf": ("N", 4.4482216152605), "kgf": ("N", 9.80665), "V": ("V", 1.0), "Volts": ("V", 1.0), "mV": ("V", 1e-3)},
    **{"m/s²": ("m/s2", 1.0), "m/s^2": ("m/s2", 1.0), "m/s/s": ("m/s2", 1.0), "ms-2": ("m/s2", 1.0)},
    **{"m s^-2": ("m/s2", 1.0), "meters per second": ("m/s", 1.0), "m/sec^2": ("m/s2", 1.0), "in/s2": ("m/s2", 0.0254)},
    **{"g": ("m/s2", 9.80665), "gn": ("m/s2", 9.80665), "G": ("m/s2", 9.80665), "mg": ("m/s2", 9.80665e-3)},
    **{"mil": ("m", 2.54e-5), "inches": ("m", 0.0254), "ft": ("m", 0.3048), "µm": ("m", 1e-6), "cm": ("m", 0.01)},
    **{"ms": ("s", 1e-3), "min": ("s", 60.0), "hours": ("s", 3600.0), "us": ("s", 1e-6), "milliseconds": ("s", 1e-3)},
    **{"[N]": ("N", 1.0), "%": ("1", 0.01), "m/m": ("1", 1.0), "ustrain": ("1", 1e-6), "kHz": ("Hz", 1e3)},
}


@pytest.mark.parametrize("text", KNOWN)
def test_a_unit_is_understood_as_it_is_spelled(text):
    found = quantity(text)
    assert found is not None
    assert (found.si, float(found.factor)) == (KNOWN[text][0], pytest.approx(KNOWN[text][1], rel=1e-15))


@pytest.mark.parametrize("text", ["", "dB", "degC", "stone", "m/", "m//s", "12", "N2N^99", "(m/s", "g rms", "x" * 100])
def test_what_is_no_factor_to_si_is_not_understood(text):
    assert quantity(text) is None


@given(st.text(max_size=60))
def test_no_text_is_too_strange(text):
    found = quantity(text)
    assert found is None or found.factor > 0


@pytest.mark.parametrize(("ratio", "of", "to"), [("(m/s^2)/N", "m/s2", "N"), ("g/N", "g", "N"), ("mV/g", "mV", "g")])
def test_ratios_are_the_quotients_of_their_units(ratio, of, to):
    above, below = quantity(of), quantity(to)
    assert above is not None
    assert below is not None
    assert quantity(ratio) == above / below


def test_units_of_time_may_tell_their_beginning_and_others_are_none():
    assert seconds_in("ms since 2020-01-01 00:00") == 1e-3
    assert (seconds_in("Hz"), seconds_in("")) == (None, None)
    assert says_a_unit("counts")
    assert not any(map(says_a_unit, ("", " - ", "None", "n/a")))


@pytest.mark.parametrize(
    ("text", "unit", "number"),
    [
        *(("17 lbf", "N", 17 * 4.4482216152605), ("0.2 N", "N", 0.2), ("-1.5e-3 kN", "N", -1.5), (".5in", "m", 0.0127)),
        *(
            ("5 g", "m/s^2", 49.03325),
            ("2 m", "N", None),
            ("17", "N", None),
            ("1e400 furlongs", "m", None),
            ("N", "N", None),
        ),
    ],
)
def test_a_number_with_a_unit_is_told_in_another(text, unit, number):
    found = number_in(text, unit)
    assert found is None if number is None else found == pytest.approx(number, rel=1e-12)
