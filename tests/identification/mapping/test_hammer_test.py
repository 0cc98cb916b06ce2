import numpy as np
import pytest
from pydantic import ValidationError

from identification import HammerTestMapping, IdentificationError, hammer_test, map_hammer_test
from tests.identification.hammer.virtual import CHANNELS, RATE_HZ, record
from tests.refused import refused

RECORDS = np.array([record(1.6, [(0.1, height)]) for height in (50.0, 70.0, 60.0)])
FORCE, DRIVE, TIP = (RECORDS[:, row].T for row in range(3))


def mapping(**change):
    return HammerTestMapping.model_validate(
        {
            "kind": "hammer-test",
            "sample_rate_hz": RATE_HZ,
            "channels": [
                {"name": "hammer", "role": "force", "unit": "lbf", "value": "F", "inverted": True},
                {"name": "drive", "role": "drive", "unit": "g", "value": "A[0]", "full_scale": 1000.0},
                {"name": "tip", "role": "response", "unit": "m/s2", "value": "A[1]"},
            ],
            **change,
        }
    )


DATA = {"F": -FORCE / 4.4482216152605, "A": [DRIVE / 9.80665, TIP], "sample_rate_hz": RATE_HZ}


def test_units_signs_and_columns_give_the_test_of_the_same_numbers_in_si():
    found, same = map_hammer_test(DATA, mapping()), hammer_test(list(RECORDS), CHANNELS, RATE_HZ)
    np.testing.assert_allclose(found.responses.value, same.responses.value, rtol=1e-9, atol=1e-12)
    assert [hit.peak_n for hit in found.hits] == pytest.approx([hit.peak_n for hit in same.hits])


def test_records_may_be_a_list_and_the_rate_that_of_instants_or_of_the_file():
    entries = [
        {
            "F": -FORCE[:, k] / 4.4482216152605,
            "A": [DRIVE[:, k] / 9.80665, TIP[:, k]],
            "t": np.arange(len(FORCE)) / RATE_HZ,
        }
        for k in range(3)
    ]
    whole = map_hammer_test(DATA, mapping())
    for how in ({"time": "t", "sample_rate_hz": None}, {"sample_rate_hz": None}):
        found = map_hammer_test({"hits": entries, "sample_rate_hz": RATE_HZ}, mapping(records="hits", **how))
        np.testing.assert_allclose(found.responses.value, whole.responses.value, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(
    ("data", "change", "message"),
    [
        ({"A": [DRIVE, TIP]}, {}, {"says": "channels-hammer-path-no-at-the"}),
        ({**DATA, "F": FORCE[:-1]}, {}, {"says": "unequal-lengths", "field": "channels"}),
        (
            {"F": FORCE, "A": [DRIVE, TIP]},
            {"sample_rate_hz": None},
            {"says": "missing-give-it-or-time", "field": "sample_rate_hz"},
        ),
        ({**DATA, "t": np.arange(5.0) ** 2}, {"sample_rate_hz": None, "time": "t"}, {"says": "is-not-evenly-spaced"}),
        ({**DATA, "F": FORCE}, {}, {"says": "force-no-hit-above-hits", "field": "hits"}),
        ({**DATA, "F": np.where(FORCE > 10.0, np.nan, FORCE)}, {}, {"says": "value-at-is-nan", "field": "records[0]"}),
    ],
)
def test_what_does_not_fit_is_named(data, change, message):
    with refused(IdentificationError, **message):
        map_hammer_test(data, mapping(**change))


def test_values_that_are_not_allowed_are_refused():
    for change in ({"record_s": 0.0}, {"estimator": "H3"}, {"trigger": 3.0}, {"decay_rate_1_s": -1.0}):
        with pytest.raises(ValidationError):
            mapping(**change)
