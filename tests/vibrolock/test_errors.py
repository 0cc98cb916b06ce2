"""Errors: one line from the parts, the parts kept between processes and classes."""

import pickle

import numpy as np
import pytest

from identification import IdentificationError
from rig.errors import ConfigurationError
from vibrolock.errors import InputError, StatedError, at_least


@pytest.mark.parametrize(
    ("parts", "line"),
    [
        ({"field": "x"}, "`x`"),
        ({"field": "x", "value": 3}, "`x` = 3"),
        ({"field": "x", "value": 3, "allowed": at_least(1)}, "`x` = 3; allowed: 1 and above"),
        ({"field": "x", "value": 2.50, "unit": "V", "allowed": "0 to 2 V"}, "`x` = 2.5 V; allowed: 0 to 2 V"),
        ({"field": "x", "value": "a", "allowed": ["b", "c"], "hint": "see y"}, "`x` = 'a'; allowed: b, c; see y"),
        ({"where": "plan.toml", "field": "x", "value": np.float64(0.1)}, "plan.toml: `x` = 0.1"),
        ({"where": "plan.toml", "allowed": "a table"}, "plan.toml: allowed: a table"),
        ({"field": "x", "value": np.arange(2), "further": ["and 2 more"]}, "`x` = [0, 1]; and 2 more"),
    ],
)
def test_the_line_is_made_from_the_parts_that_are_given(parts, line):
    assert str(StatedError(**parts)) == line


def test_a_reason_stands_between_the_value_and_what_is_allowed():
    assert str(StatedError("too much", field="x", value=3, allowed="up to 2")) == "`x` = 3: too much; allowed: up to 2"
    assert str(StatedError("too much", field="x", allowed="up to 2")) == "`x`: too much; allowed: up to 2"
    assert str(StatedError("port", "gone")) == "port gone"


def test_parts_cross_to_another_process():
    error = ConfigurationError("too much", where="plan.toml", field="x", value=3, further=[ConfigurationError("again")])
    back = pickle.loads(pickle.dumps(error))
    assert str(back) == str(error) == "plan.toml: `x` = 3: too much; again"
    assert (back.field, back.value, back.reason) == ("x", 3, "too much")


def test_an_error_of_another_class_keeps_its_parts_and_gets_a_place():
    error = ConfigurationError.of(InputError(field="y", value=3, allowed="up to 2"), where="a.toml", within="x[0]")
    assert str(error) == "a.toml: `x[0].y` = 3; allowed: up to 2"
    assert str(ConfigurationError.of(OSError("gone"), where="a.toml")) == "a.toml: gone"


def test_common_ranges_are_checked_in_a_line_and_nan_is_in_none():
    IdentificationError.unless_one_of("x", "a", ("a", "b"))
    IdentificationError.unless_between("x", 1, 1, 2)
    IdentificationError.unless_at_least("x", 1, 1)
    IdentificationError.unless_above("x", 2, 1)
    for check, value, allowed in (
        (lambda x: IdentificationError.unless_one_of("x", x, ("a", "b")), "c", "a, b"),
        (lambda x: IdentificationError.unless_between("x", x, 1, 2, "V"), np.nan, "1 to 2 V"),
        (lambda x: IdentificationError.unless_at_least("x", x, 1), 0, "1 and above"),
        (lambda x: IdentificationError.unless_above("x", x, 1, "V"), 1, "above 1 V"),
    ):
        with pytest.raises(IdentificationError) as raised:
            check(value)
        assert (raised.value.field, raised.value.allowed) == ("x", allowed)


def test_another_name_may_stand_in_place_of_the_field():
    error = StatedError("missing", field="band_hz", further=[StatedError("too", field="modes")])
    assert error.line(lambda one: {"band_hz": "--band"}.get(one.field, one.field)) == "--band: missing; modes: too"
