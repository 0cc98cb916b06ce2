from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from identification import FrequencyResponseMapping, IdentificationError, map_frequency_responses
from tests.refused import refused

FREQUENCY_HZ = np.array([79.5, 80.0, 80.5])
OMEGA = 2 * np.pi * FREQUENCY_HZ
COMPLIANCE = 1.0 / ((2 * np.pi * 80.0) ** 2 - OMEGA**2 + 0.008j * 2 * np.pi * 80.0 * OMEGA)
FORCE_N = np.array([2.0, 0.5, 2.0])
ACCELERATION = -(OMEGA**2) * COMPLIANCE * FORCE_N


def mapping(**changes: Any) -> FrequencyResponseMapping:
    group = {
        "levels": "data.levels",
        "frequency": "f",
        "force": "F",
        "response": "A",
        "phase": "ph",
        "controlled": "response",
        "level_values": [7.0],
    }
    table: dict[str, Any] = {
        "specimen": "beam",
        "units": {"frequency": "Hz", "force": "N", "response": "m/s2", "values": "peak"},
        "phase": {"unit": "rad", "of": "acceleration", "sense": "response-minus-force"},
    }
    for key, value in changes.items():
        (table if key in ("units", "phase") else group)[key] = value
    for name in [name for name, value in group.items() if value is None]:
        del group[name]
    return FrequencyResponseMapping.model_validate({**table, "sets": [group]})


def data(**entry: Any) -> dict[str, Any]:
    plain = {"f": FREQUENCY_HZ, "F": FORCE_N, "A": np.abs(ACCELERATION), "ph": np.angle(ACCELERATION)}
    return {"__header__": b"", "data": {"levels": [plain | entry]}}


@pytest.mark.parametrize("of", ["displacement", "velocity", "acceleration"])
@pytest.mark.parametrize("sense", ["response-minus-force", "force-minus-response"])
@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_every_phase_convention_gives_the_same_response(of: str, sense: str, unit: str) -> None:
    motion = ACCELERATION / (1j * OMEGA) ** {"displacement": 2, "velocity": 1, "acceleration": 0}[of]
    angle = np.angle(motion) * (1 if sense == "response-minus-force" else -1)
    stored = np.degrees(angle) if unit == "deg" else angle
    phase = {"unit": unit, "of": of, "sense": sense}
    (response,) = map_frequency_responses(data(ph=stored), mapping(phase=phase))
    np.testing.assert_allclose(response.response, ACCELERATION, rtol=1e-12)
    np.testing.assert_allclose(response.displacement_m, COMPLIANCE * FORCE_N, rtol=1e-12)
    assert response.phase_lag_deg[1] == pytest.approx(90.0, abs=1e-9)


def test_units_and_rms_become_si_peak() -> None:
    units = {"frequency": "rad/s", "force": "mN", "response": "g", "values": "rms"}
    stored = data(f=OMEGA, F=FORCE_N * 1e3 / np.sqrt(2), A=np.abs(ACCELERATION) / 9.80665 / np.sqrt(2))
    (response,) = map_frequency_responses(stored, mapping(units=units, level_values=[2.0]))
    np.testing.assert_allclose(response.frequency_hz, FREQUENCY_HZ)
    np.testing.assert_allclose(response.force, FORCE_N)
    np.testing.assert_allclose(response.response, ACCELERATION)
    assert response.level == pytest.approx(2.0 * np.sqrt(2) * 9.80665)


def test_complex_responses_need_no_phase() -> None:
    stored = data(A=ACCELERATION * 1j, F=FORCE_N * 1j)
    table = mapping().model_dump()
    del table["sets"][0]["phase"]
    (response,) = map_frequency_responses(stored, FrequencyResponseMapping.model_validate(table))
    np.testing.assert_allclose(response.response / response.force, ACCELERATION / FORCE_N)


def test_columns_of_matrices_are_levels_and_share_a_vector_of_frequencies() -> None:
    stored = {
        "f": FREQUENCY_HZ,
        "F": np.column_stack([FORCE_N, 2 * FORCE_N]),
        "A": np.column_stack([np.abs(ACCELERATION), 2 * np.abs(ACCELERATION)]),
        "ph": np.angle(ACCELERATION)[None, :],
    }
    one, two = map_frequency_responses(stored, mapping(levels=None, level_values=None, label="level {number}"))
    np.testing.assert_allclose(two.response, 2 * ACCELERATION)
    assert (one.label, two.label) == ("level 1", "level 2")
    assert two.level == pytest.approx(np.median(2 * np.abs(ACCELERATION)))


def test_a_single_structure_is_a_list_of_one() -> None:
    stored = data()
    stored["data"]["levels"] = stored["data"]["levels"][0]
    assert len(map_frequency_responses(stored, mapping())) == 1


@pytest.mark.parametrize(
    ("entry", "changes", "message"),
    [
        ({}, {"levels": "data.level"}, {"says": "sets-levels-path-data-level-no"}),
        ({}, {"levels": "Data"}, {"says": "no-data-at-the-top-which"}),
        ({}, {"levels": "data.levels[3].x"}, {"says": "no-at-data-levels-which-has"}),
        ({}, {"levels": "data..levels"}, {"says": "data-levels-is-no-path"}),
        (
            {},
            {"force": "Force"},
            {"says": "sets-force-level-path-force-no"},
        ),
        (
            {"F": "2 N"},
            {},
            {"says": "sets-force-level-f-is-text", "allowed": "numbers", "where": "sets[0].force, level 1 'F'"},
        ),
        (
            {"F": [[1.0, 2.0], [3.0]]},
            {},
            {"says": "f-is-a-list-of-unequal", "allowed": "numbers", "where": "sets[0].force, level 1 'F'"},
        ),
        (
            {"F": np.ones((3, 2))},
            {},
            {"says": "has-shape-allowed-a-vector", "allowed": "a vector", "where": "sets[0].force, level 1 'F'"},
        ),
        ({"F": np.ones(4)}, {}, {"says": "sets-level-unequal-lengths-force"}),
        ({"F": -FORCE_N}, {}, {"says": "sets-force-level-an-amplitude-is"}),
        ({"A": np.array([1.0, np.nan, 1.0])}, {}, {"field": "response", "allowed": "finite"}),
        ({"A": ACCELERATION}, {}, {"says": "sets-phase-is-given-but-a", "field": "sets[0].phase"}),
        (
            {},
            {"level_values": [5.0, 6.0]},
            {"says": "sets-level-values-given-the-data", "field": "sets[0].level_values"},
        ),
        ({}, {"label": "{name}"}, {"says": "sets-level-name", "where": "sets[0], level 1"}),
    ],
)
def test_what_does_not_fit_is_named_in_one_line(
    entry: dict[str, Any], changes: dict[str, Any], message: dict[str, object]
) -> None:
    with refused(IdentificationError, **message) as caught:
        map_frequency_responses(data(**entry), mapping(**changes))
    assert "\n" not in str(caught.value)


def test_real_amplitudes_without_phase_are_refused() -> None:
    table = mapping().model_dump()
    del table["sets"][0]["phase"]
    with refused(IdentificationError, "left-out-but-holds-real-numbers", field="sets[0].phase"):
        map_frequency_responses(data(), FrequencyResponseMapping.model_validate(table))
    with refused(IdentificationError, "the-mapping-has-no-table", field="sets[0].phase", value="ph"):
        map_frequency_responses(
            data(), FrequencyResponseMapping.model_validate(mapping().model_dump() | {"phase": None})
        )


@pytest.mark.parametrize("change", [{"label_": "x"}, {"level_values": [-1.0]}, {"controlled": "speed"}])
def test_unknown_keys_and_values_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        mapping(**change)
