"""Models with a constant input beside the one that is driven, against simulation."""

from dataclasses import replace

import numpy as np
import pytest

from identification import (
    Channel,
    Features,
    IdentificationError,
    PnlssModel,
    coupled_run,
    harmonic_response,
    steady_state,
)
from tests.identification.models.pnlss.steady.oscillators import (
    RATE_HZ,
    driven_by_voltage,
    level,
    oscillator,
    settled,
    shaker,
)
from tests.refused import refused

SHIFT_N = 15.0


def offset(model: PnlssModel) -> PnlssModel:
    """With a constant input that pushes the states as ``SHIFT_N`` of the first input does, and shifts the outputs."""
    constant = Channel("constant", "monitor", "1")
    features = [
        Features(variables=4, exponents=np.hstack([own.exponents, np.zeros((own.count, 1), dtype=np.int64)]))
        for own in (model.state_features, model.output_features)
    ]
    return replace(
        model,
        b=np.hstack([model.b, SHIFT_N * model.b]),
        d=np.hstack([model.d, np.full((len(model.outputs), 1), 0.3)]),
        state_features=features[0],
        output_features=features[1],
        inputs=(*model.inputs, constant),
        input_range=np.array([*model.input_range, 1.0]),
    )


@pytest.mark.parametrize("by_voltage", [False, True])
def test_a_constant_input_is_there_at_every_level_as_in_a_simulation(by_voltage: bool) -> None:
    plain = oscillator(5e7, 2e6, damping=0.05)
    model = offset(driven_by_voltage(plain) if by_voltage else plain)
    force = "voltage" if by_voltage else "pure-sine"
    found = steady_state(
        model, RATE_HZ / 128, **level(2.0, force), held_inputs={"constant": 1.0}, harmonics=9, largest_range_use=3.0
    )
    assert found.inputs[0, 0].tolist() == [0.0, 1.0]
    assert found.input_use[0, 1] == pytest.approx(1.0)
    simulated, left = settled(model, found, 200)
    assert left.max() < 1e-6
    size = np.abs(simulated).max(axis=0)
    np.testing.assert_allclose(found.outputs[0] / size, simulated[:10] / size, atol=2e-5)
    without = steady_state(
        model, RATE_HZ / 128, **level(2.0, force), held_inputs={"constant": 0.0}, harmonics=9, largest_range_use=3.0
    )
    tip, other = found.outputs[0, 1, -1], without.outputs[0, 1, -1]
    assert abs(tip - other) > 0.05 * abs(other)


def test_a_response_with_a_constant_input_goes_through_its_band_and_says_what_was_held() -> None:
    found = harmonic_response(
        offset(oscillator(5e7, 2e6)),
        1.0,
        force="fundamental",
        exciter=shaker(),
        held_inputs={"constant": 1.0},
        band_hz=(22.0, 34.0),
        largest_range_use=3.0,
    )
    assert found.complete
    assert "input 'constant' is held at 1" in found.notes
    np.testing.assert_allclose(np.abs(found.points.force_n[:, 1]), 1.0, rtol=1e-9)
    stiffer = harmonic_response(
        oscillator(5e7, 2e6), 1.0, force="fundamental", exciter=shaker(), band_hz=(22.0, 34.0), largest_range_use=3.0
    )
    assert found.prediction.peak().frequency_hz > 1.02 * stiffer.prediction.peak().frequency_hz


def test_inputs_without_a_value_are_named() -> None:
    model = offset(oscillator())

    def asked(one: PnlssModel, held: dict[str, float] | None) -> None:
        steady_state(one, 25.0, 1.0, force="pure-sine", held_inputs=held, largest_range_use=3.0)

    with refused(IdentificationError, "has-no-value-for-constant-which", field="held_inputs"):
        asked(model, None)
    with refused(IdentificationError, "has-no-input-offset-its-inputs", field="held_inputs"):
        asked(model, {"offset": 1.0})
    with refused(
        IdentificationError, "force-is-the-force-which-drives", field="held_inputs", hint="hold the other inputs"
    ):
        asked(model, {"force": 1.0, "constant": 1.0})
    with refused(IdentificationError, field="held_inputs", allowed="a finite value"):
        asked(model, {"constant": float("nan")})
    with refused(
        IdentificationError, field="model", allowed="one force, or a voltage alone (held_inputs holds others)"
    ):
        asked(offset(driven_by_voltage(oscillator())), None)
    with refused(IdentificationError, field="model", allowed="a model of the force alone"):
        coupled_run(model, shaker(), np.zeros(100))
