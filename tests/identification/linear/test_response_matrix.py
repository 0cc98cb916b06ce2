import json

import numpy as np
import pytest

from identification import Channel, FrequencyResponseMatrix, IdentificationError
from identification.storage import decode, encode
from tests.refused import refused

OUTPUTS = (Channel("drive", "drive", "m/s2"), Channel("tip", "response", "m/s2"))
INPUTS = (Channel("force", "force", "N"), Channel("second", "force", "N"))
FREQUENCY_HZ = np.array([1.0, 2.0, 4.0])


def matrix(**changes: object) -> FrequencyResponseMatrix:
    random = np.random.default_rng(0)
    value = random.normal(size=(3, 2, 2)) + 1j * random.normal(size=(3, 2, 2))
    root = random.normal(size=(3, 4, 4)) + 1j * random.normal(size=(3, 4, 4))
    fields = {
        "outputs": OUTPUTS,
        "inputs": INPUTS,
        "frequency_hz": FREQUENCY_HZ,
        "value": value,
        "noise_covariance": root @ np.conj(root.swapaxes(1, 2)),
        "estimator": "H1",
        "input_rms": (1.0, 2.0),
        "notes": ("made up",),
    }
    return FrequencyResponseMatrix(**(fields | changes))


def test_paths_deviations_and_covariance_agree() -> None:
    found = matrix()
    assert np.array_equal(found.path("tip", "second"), found.value[:, 1, 1])
    assert np.array_equal(found.path("tip"), found.value[:, 1, 0])
    covariance = found.covariance("noise")
    np.testing.assert_allclose(found.noise_std[:, 1, 0] ** 2, covariance[:, 2, 2].real)
    assert np.all(np.isnan(found.total_std))
    with refused(IdentificationError, "unknown-of-two-realisations-or-more", field="total_covariance"):
        found.covariance("total")


def test_a_part_keeps_the_covariance_of_its_paths() -> None:
    whole, part = matrix(), matrix().select(["tip"], lowest_hz=1.5)
    assert part.outputs == OUTPUTS[1:]
    assert np.array_equal(part.value, whole.value[1:, 1:])
    assert np.array_equal(part.noise_covariance, whole.noise_covariance[1:, 2:, 2:])
    turned = whole.select(["tip", "drive"])
    assert np.array_equal(turned.noise_covariance[:, 0, 3], whole.noise_covariance[:, 2, 1])
    with refused(IdentificationError, "no-line-in", field="lowest_hz, highest_hz", allowed="from 1 to 4 Hz"):
        whole.select(lowest_hz=5.0)


def test_arrays_and_attributes_bring_it_back() -> None:
    whole = matrix()
    arrays, attributes = encode(whole)
    back = decode(FrequencyResponseMatrix, arrays, json.loads(json.dumps(attributes)))
    for name in ("frequency_hz", "value", "noise_covariance"):
        assert np.array_equal(getattr(back, name), getattr(whole, name))
    assert back.total_covariance is None
    assert (back.outputs, back.inputs, back.estimator) == (whole.outputs, whole.inputs, "H1")
    assert (back.input_rms, back.notes) == (whole.input_rms, whole.notes)
    with refused(IdentificationError, "outputs-is-missing-or-unknown", where="frequency response matrix"):
        decode(FrequencyResponseMatrix, arrays, {k: v for k, v in attributes.items() if k != "outputs"})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"value": np.full((3, 2, 2), np.nan)}, {"says": "value-at-is", "field": "value"}),
        ({"value": np.ones((3, 2, 1))}, {"says": "shape-3", "field": "value", "allowed": "(3, 2, 2)"}),
        (
            {"noise_covariance": np.ones((3, 2, 2))},
            {"says": "shape-2", "field": "noise_covariance", "allowed": "(3, 4, 4)"},
        ),
        (
            {"frequency_hz": [1.0, 1.0, 2.0]},
            {"field": "frequency_hz", "allowed": "at least one, none below zero, each above the one before"},
        ),
        ({"outputs": ()}, {"field": "outputs, inputs", "allowed": "at least one of each"}),
        ({"input_rms": (1.0,)}, {"says": "values-for-inputs", "field": "input_rms"}),
    ],
)
def test_what_does_not_fit_is_named(change: dict[str, object], message: str) -> None:
    with refused(IdentificationError, **message):
        matrix(**change)
