"""From what is asked of a model to the equations of its harmonic balance."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.pnlss.model import PnlssModel
from identification.pnlss.steady.balance import Balance, samples_for
from identification.pnlss.steady.basis import Basis, real_coefficients
from identification.pnlss.steady.excitation import Held, drive_of, held_values, linear_resonance_hz
from identification.pnlss.steady.states import SteadyStates
from identification.prediction.exciter import Exciter

__all__ = ["balance_of", "band_of", "harmonics_that_fit", "unknowns_near"]

Float = NDArray[np.float64]

_BAND = (0.85, 1.15)


def balance_of(
    model: PnlssModel,
    level: float,
    force: Held,
    exciter: Exciter | None,
    held_inputs: Mapping[str, float] | None,
    harmonics: int,
    samples: int | None,
) -> Balance:
    """The equations; raises `IdentificationError` on too few samples and what `held_values` and `drive_of` refuse."""
    least = 2 * harmonics + 1
    count = samples_for(model, harmonics) if samples is None else samples
    if count < least:
        raise IdentificationError(f"samples: is {count}, needs at least {least} for {harmonics} harmonics")
    basis = Basis(harmonics, count)
    row, values = held_values(model, held_inputs)
    return Balance(model, drive_of(model, level, force, exciter, basis.size, row), basis, values)


def band_of(model: PnlssModel, lowest_hz: float | None, highest_hz: float | None) -> tuple[float, float]:
    """The band in Hz, by default about the linear resonance; `IdentificationError` if it is none."""
    if lowest_hz is None or highest_hz is None:
        resonance = linear_resonance_hz(model)
        lowest_hz = _BAND[0] * resonance if lowest_hz is None else lowest_hz
        highest_hz = _BAND[1] * resonance if highest_hz is None else highest_hz
    half = 0.5 * model.sample_rate_hz
    if not 0.0 < lowest_hz < highest_hz < half:
        raise IdentificationError(
            f"lowest_hz, highest_hz: are {lowest_hz:g} and {highest_hz:g} Hz, need to rise between 0 and {half:g} Hz"
        )
    return float(lowest_hz), float(highest_hz)


def harmonics_that_fit(model: PnlssModel, harmonics: int, highest_hz: float) -> tuple[int, list[str]]:
    """Harmonics that the sample rate has room for, with a note where they are fewer than asked for."""
    if harmonics < 1:
        raise IdentificationError(f"harmonics: is {harmonics}, needs at least 1")
    room = int(np.ceil(0.5 * model.sample_rate_hz / highest_hz)) - 1
    if room < 1:
        raise IdentificationError(
            f"frequency_hz: {highest_hz:g} Hz is not below half the model's {model.sample_rate_hz:g} Hz"
        )
    if room >= harmonics:
        return harmonics, []
    return room, [
        f"{room} harmonics, for which the model's {model.sample_rate_hz:g} Hz has room at {highest_hz:.4g} Hz"
    ]


def unknowns_near(balance: Balance, near: SteadyStates) -> Float:
    """Unknowns of the first point of other steady states, as far as their harmonics go."""
    size = balance.basis.size

    def fitted(harmonics: NDArray[np.complex128]) -> Float:
        given = real_coefficients(harmonics)[:size]
        return np.concatenate([given, np.zeros((size - len(given), given.shape[1]))])

    states, inputs, voltage = fitted(near.states[0]), fitted(near.inputs[0]), complex(near.voltage_v[0])
    own = np.zeros(balance.drive.size)
    if own.size == 1:
        own[0] = voltage.real
    elif own.size:
        row = next(row for row, channel in enumerate(balance.model.inputs) if channel.role == "force")
        own[:] = [*inputs[1:, row], voltage.real, -voltage.imag]
    return np.concatenate([states.ravel(), own])
