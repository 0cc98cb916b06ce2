from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identification import IdentificationError, LinearModes, extrapolated_to_zero, linear_modes, mac_matrix
from tests.identification.linear.structures import DAMPING, FREQUENCY_HZ, SHAPES, measured
from tests.refused import refused


@cache
def template() -> LinearModes:
    return linear_modes(measured(0, 0.1))


def at_level(force_rms_n: float, power: float, std: float = 1e-6) -> LinearModes:
    modes = template()
    bent = force_rms_n**power
    return replace(
        modes,
        frequency_hz=FREQUENCY_HZ * (1 - 1e-3 * bent),
        damping_ratio=DAMPING * (1 + 0.1 * bent),
        shapes=SHAPES * (1 + 0.01 * bent),
        force_rms_n=force_rms_n,
        covariance=std**2 * np.eye(12),
    )


@pytest.mark.parametrize("power", [1.0, 1.3, 2.0])
def test_a_known_power_gives_the_modes_at_zero(power: float) -> None:
    zero = extrapolated_to_zero(at_level(1.0, power), at_level(2.0, power), at_level(3.0, power), exponent=power)
    np.testing.assert_allclose(zero.frequency_hz, FREQUENCY_HZ, rtol=1e-12)
    np.testing.assert_allclose(zero.damping_ratio, DAMPING, rtol=1e-12)
    np.testing.assert_allclose(zero.shapes, SHAPES, rtol=1e-12)
    assert zero.force_rms_n == 0.0


def test_two_levels_carry_their_errors_over() -> None:
    zero = extrapolated_to_zero(at_level(2.0, 1.0, 1e-4), at_level(1.0, 1.0, 1e-4), exponent=1.0)
    np.testing.assert_allclose(zero.frequency_std_hz, 1e-4 * np.sqrt(5.0), rtol=1e-9)  # 2 y_1 - y_2


def test_an_unknown_power_is_in_the_interval() -> None:
    for power in (1.2, 1.3, 1.7, 2.0, 2.5, 3.0):
        zero = extrapolated_to_zero(at_level(1.0, power), at_level(2.0, power))
        assert np.all(np.abs(zero.damping_ratio - DAMPING) < 1.96 * zero.damping_ratio_std)


def test_all_powers_of_a_range_are_equally_likely() -> None:
    low, high = at_level(1.0, 2.0, 1e-9), at_level(2.0, 2.0, 1e-9)
    zero, change = extrapolated_to_zero(low, high), low.damping_ratio - high.damping_ratio
    mean = 0.5 * np.log2((1.0 - 2.0**-3) / (1.0 - 2.0**-1))  # of 1 / (2^p - 1) over p from 1 to 3
    variance = 0.5 * (1.0 - 1.0 / 7.0) / np.log(2.0) - mean - mean**2
    np.testing.assert_allclose(zero.damping_ratio, low.damping_ratio + mean * change, rtol=1e-9)
    np.testing.assert_allclose(zero.damping_ratio_std, np.sqrt(variance) * np.abs(change), rtol=1e-6)


def test_levels_that_cannot_be_told_apart_are_refused() -> None:
    with refused(IdentificationError, "levels-are", field="force_rms_n"):
        extrapolated_to_zero(at_level(1.0, 1.0), at_level(1.05, 1.0))
    with refused(IdentificationError, field="exponent", value=0.0):
        extrapolated_to_zero(at_level(1.0, 1.0), at_level(2.0, 1.0), exponent=0.0)


def test_a_mode_is_like_itself_and_the_matrix_needs_common_channels() -> None:
    modes = at_level(1.0, 1.0)
    matrix = mac_matrix(modes, modes)
    np.testing.assert_allclose(np.diag(matrix), 1.0)
    expected = (SHAPES[:, 0] @ SHAPES[:, 1]) ** 2 / (SHAPES[:, 0] @ SHAPES[:, 0]) / (SHAPES[:, 1] @ SHAPES[:, 1])
    assert matrix[0, 1] == pytest.approx(expected)
    other = replace(modes, channels=tuple(replace(c, name=f"{c.name} 2") for c in modes.channels))
    with refused(IdentificationError, "share-none", field="channels"):
        mac_matrix(modes, other)


def test_levels_of_two_specimens_are_refused() -> None:
    with refused(IdentificationError, "level-of-plate-level-of-beam", field="specimen"):
        extrapolated_to_zero(
            replace(at_level(1.0, 1.0), specimen="plate"), replace(at_level(2.0, 1.0), specimen="beam")
        )
