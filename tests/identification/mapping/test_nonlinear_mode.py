"""Tables of nonlinear modes: whatever the units in which a mode is written down, it is the same mode."""

from typing import Any

import numpy as np
import pytest

from identification import IdentificationError, NonlinearMode
from identification.mapping.nonlinear_mode import NonlinearModeMapping, map_nonlinear_mode
from tests.refused import refused

FREQUENCY_HZ = np.array([24.0, 24.5, 25.5])
OMEGA = 2.0 * np.pi * FREQUENCY_HZ
DAMPING = np.array([0.004, 0.005, 0.007])
AMPLITUDE_M = np.array([1e-4, 5e-4, 2e-3])
FORCE_N = np.array([0.01, 0.06, 0.4])
SHAPE = -0.8  # kg^-1/2; a sign of the shape is none of the amplitude
ROOT_2 = np.sqrt(2.0)


def mapped(table: dict[str, Any] | None = None, **changes: Any) -> NonlinearMode:
    plain = {"f": FREQUENCY_HZ, "d": DAMPING, "a": AMPLITUDE_M, "F": FORCE_N}
    keys = {
        "kind": "nonlinear-mode",
        "values": "peak",
        "frequency": "f",
        "damping": "d",
        "damping_unit": "1",
        "amplitude": "a",
        "amplitude_unit": "m",
        "force": "F",
    }
    mapping = NonlinearModeMapping.model_validate(keys | changes)
    return map_nonlinear_mode(plain | (table or {}), mapping)


@pytest.mark.parametrize(
    ("table", "changes"),
    [
        ({}, {}),
        ({"f": OMEGA}, {"frequency_unit": "rad/s"}),
        ({"d": 100.0 * DAMPING}, {"damping_unit": "%"}),
        ({"a": 1e3 * AMPLITUDE_M}, {"amplitude_unit": "mm"}),
        ({"a": OMEGA * AMPLITUDE_M}, {"amplitude_unit": "m/s"}),
        ({"a": OMEGA**2 * AMPLITUDE_M}, {"amplitude_unit": "m/s2"}),
        ({"a": OMEGA**2 * AMPLITUDE_M / 9.80665}, {"amplitude_unit": "g"}),
        ({"F": 1e3 * FORCE_N}, {"force_unit": "mN"}),
        ({"a": AMPLITUDE_M / ROOT_2, "F": FORCE_N / ROOT_2}, {"values": "rms"}),
    ],
    ids=["SI", "rad/s", "%", "mm", "m/s", "m/s2", "g", "mN", "rms"],
)
def test_every_unit_gives_the_same_mode_in_si_and_peak(table: dict[str, Any], changes: dict[str, Any]) -> None:
    found = mapped(table, drive_mode_shape=SHAPE, **changes)
    wanted = {
        "frequency_hz": FREQUENCY_HZ,
        "modal_frequency_hz": FREQUENCY_HZ,
        "damping_ratio": DAMPING,
        "amplitude_m": AMPLITUDE_M,
        "force_n": FORCE_N,
        "modal_amplitude": AMPLITUDE_M / 0.8,
        "apparent_mass_kg": np.full(3, 1.5625),  # 1 / 0.8^2
        "phase_lag_deg": np.full(3, 90.0),
    }
    for name, values in wanted.items():
        np.testing.assert_allclose(getattr(found, name), values, rtol=1e-12, err_msg=name)


def test_at_phase_resonance_the_displacement_lags_the_force_by_a_quarter_turn_and_has_one_harmonic() -> None:
    found = mapped()
    np.testing.assert_allclose(found.force_harmonics, np.transpose([np.zeros(3), FORCE_N]), rtol=1e-12)
    np.testing.assert_allclose(
        found.response_harmonics_m, np.transpose([np.zeros(3), AMPLITUDE_M * np.exp(-0.5j * np.pi)]), atol=1e-15
    )


def test_what_the_table_does_not_give_is_unknown() -> None:
    found = mapped(force=None)
    for name in ("force_n", "modal_amplitude", "apparent_mass_kg", "damping_ratio_std", "mac", "force_purity"):
        assert np.isnan(getattr(found, name)).all(), name
    assert np.isfinite(found.amplitude_m).all()


@pytest.mark.parametrize(
    ("table", "changes", "told"),
    [
        ({"d": [0.004, np.nan, np.inf]}, {}, {"says": "damping-is-not-finite-at"}),
        ({"F": FORCE_N[:2]}, {}, {"says": "unequal-lengths-frequency-damping-amplit", "field": "columns"}),
        (
            {},
            {"amplitude_unit": "N"},
            {"field": "amplitude_unit", "value": "N", "allowed": "a displacement, velocity or acceleration"},
        ),
        ({}, {"force_unit": "m"}, {"field": "force_unit", "value": "m", "allowed": "a force"}),
    ],
)
def test_tables_that_mean_nothing_are_refused(table: dict[str, Any], changes: dict[str, Any], told: str) -> None:
    with refused(IdentificationError, **told):
        mapped(table, **changes)
