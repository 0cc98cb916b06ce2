"""Set up the harmonic balance of a PNLSS model: equations, number of harmonics, linear resonance."""

from collections.abc import Mapping

import numpy as np

from identification.channels import MOTION_ORDER
from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.harmonic_balance.basis import Basis
from identification.harmonic_balance.setting_up import Held, drive_of, held_values
from identification.harmonic_balance.states import motion_rows
from identification.models.pnlss.model import PnlssModel
from identification.models.pnlss.steady.balance import Balance, samples_for

_LIGHT = 0.3
"""Largest damping ratio at which a pole counts as a resonance."""


def linear_resonance_hz(model: PnlssModel, near_hz: float | None = None) -> float:
    """Natural frequency of the lightly damped mode of the linear part that is nearest, or that moves the drive point most.

    If the excited band of the training data is known and contains such modes, only these are considered, because modes
    outside the band are uncertain. Raises `IdentificationError` if there is no lightly damped mode.
    """
    poles = np.linalg.eigvals(model.a)
    s = np.log(poles[(poles.imag > 0.0) & (np.abs(poles) > 0.0)]) * model.sample_rate_hz
    s = s[-s.real <= _LIGHT * np.abs(s)]
    if not s.size:
        raise IdentificationError(
            "band_hz: not given, and the model's linear part has no lightly damped mode to set them by"
        )
    low, high = (2.0 * np.pi * f for f in model.excited_hz or (0.0, np.inf))
    inside = (np.abs(s) >= low) & (np.abs(s) <= high)
    s = s[inside] if inside.any() else s
    if near_hz is not None:
        natural_hz = np.abs(s) / (2.0 * np.pi)
        return float(natural_hz[np.argmin(np.abs(natural_hz - near_hz))])
    output = motion_rows(model.outputs)[0]
    order = MOTION_ORDER[model.outputs[output].motion]
    forces = [row for row, channel in enumerate(model.inputs) if channel.role == "force"] or slice(None)
    response = model.linear_part.response(np.exp(1j * s.imag / model.sample_rate_hz))[:, output, forces]
    size = np.linalg.norm(response, axis=1) / np.abs(s) ** order
    return float(np.abs(s[int(np.argmax(size))]) / (2.0 * np.pi))


def balance_of(
    model: PnlssModel,
    level: float,
    force: Held,
    exciter: Exciter | None,
    held_inputs: Mapping[str, float] | None,
    harmonics: int,
    samples: int | None,
) -> Balance:
    """Return the equations; raise `IdentificationError` for too few samples and as `held_values` and `drive_of` do."""
    least = 2 * harmonics + 1
    count = samples_for(model, harmonics) if samples is None else samples
    if count < least:
        raise IdentificationError(field="samples", value=count, allowed=f"at least {least} for {harmonics} harmonics")
    basis = Basis(harmonics, count)
    row, values = held_values(model, held_inputs)
    return Balance(model, drive_of(model, level, force, exciter, basis.size, row), basis, values)


def harmonics_that_fit(model: PnlssModel, harmonics: int, highest_hz: float) -> tuple[int, list[str]]:
    """Return the number of harmonics below half the sample rate, with a note if it is lower than requested."""
    IdentificationError.unless_at_least("harmonics", harmonics, 1)
    room = int(np.ceil(0.5 * model.sample_rate_hz / highest_hz)) - 1
    if room < 1:
        raise IdentificationError(
            f"{highest_hz:g} Hz is not below half the model's {model.sample_rate_hz:g} Hz", field="frequency_hz"
        )
    if room >= harmonics:
        return harmonics, []
    return room, [
        f"{room} harmonics, for which the model's {model.sample_rate_hz:g} Hz has room at {highest_hz:.4g} Hz"
    ]
