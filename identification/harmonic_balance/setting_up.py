"""Set up the equations of a harmonic balance, whatever model it describes: drive, held inputs, band, nearby unknowns."""

from collections.abc import Callable, Mapping
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from identification.channels import MOTION_ORDER, find_role
from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.experiments.simulators import Driven
from identification.harmonic_balance.basis import real_coefficients
from identification.harmonic_balance.driven import DrivenBalance
from identification.harmonic_balance.drives import Coupled, Drive, HeldOutput, Sine
from identification.harmonic_balance.states import SteadyStates
from identification.validation import positive
from vibrolock.arrays import Float

Held = Literal["fundamental", "rms", "pure-sine", "voltage"]

_BAND = (0.85, 1.15)  # limits of the band, when none is given, over the resonance frequency; chosen


def held_values(model: Driven, held_inputs: Mapping[str, float] | None) -> tuple[int, NDArray[np.float64]]:
    """Return the row of the driven input, and the constant values of all other inputs, float[n_inputs].

    The driven input is the only force, or the only input that is not held. Raises `IdentificationError` if there is no such
    input, or if another input has no value.
    """
    given = dict(held_inputs or {})
    names = [channel.name for channel in model.inputs]
    for name, value in given.items():
        if name not in names:
            raise IdentificationError(
                f"the model has no input '{name}', its inputs are {', '.join(names)}", field="held_inputs"
            )
        if model.inputs[names.index(name)].role == "force":
            raise IdentificationError(
                f"'{name}' is the force, which drives", field="held_inputs", hint="hold the other inputs"
            )
        if not np.isfinite(value):
            raise IdentificationError(f"'{name}' is {value:g}", field="held_inputs", allowed="a finite value")
    forces = [row for row, channel in enumerate(model.inputs) if channel.role == "force"]
    free = [row for row, name in enumerate(names) if name not in given]
    if len(forces) > 1 or (not forces and len(free) != 1):
        raise IdentificationError(
            f"has {len(names)} inputs, {len(forces)} of them forces and {len(given)} held constant",
            field="model",
            allowed="one force, or a voltage alone (held_inputs holds others)",
        )
    row = forces[0] if forces else free[0]
    missing = [names[other] for other in free if other != row]
    if missing:
        raise IdentificationError(
            f"has no value for {', '.join(missing)}, which the model has beside {names[row]}; give each its "
            "constant value",
            field="held_inputs",
        )
    return row, np.array([float(given.get(name, 0.0)) for name in names])


def drive_of(model: Driven, level: float, held: Held, exciter: Exciter | None, coefficients: int, row: int) -> Drive:
    """Return the drive at input ``row``; raise `IdentificationError` if model, exciter and held quantity do not match."""
    IdentificationError.unless_one_of("force", held, get_args(Held))
    amplitude = positive("force_n", level, "V" if held == "voltage" else "N")
    m = len(model.inputs)
    if model.inputs[row].role != "force":
        return _voltage_driven(model, amplitude, held, exciter, row)
    if exciter is None:
        if held != "pure-sine":
            raise IdentificationError(
                f"'{held}' of a model driven by a force needs an exciter, which makes the force's harmonics; "
                "without one 'pure-sine' is predicted",
                field="force",
            )
        return Sine(amplitude, row, m)
    if held == "pure-sine":
        raise IdentificationError("makes harmonics of the force", field="exciter", hint="leave it out for 'pure-sine'")
    drive = find_role(model.outputs, "drive")
    order = MOTION_ORDER[model.outputs[drive].motion]
    return Coupled(exciter, amplitude, held, drive, order, row, m, coefficients)


def _voltage_driven(model: Driven, amplitude: float, held: Held, exciter: Exciter | None, row: int) -> Drive:
    if exciter is not None:
        raise IdentificationError("is inside a model that is driven by a voltage", field="exciter", hint="leave it out")
    force = find_role(model.outputs, "force")
    if held == "voltage":
        return Sine(amplitude, row, len(model.inputs), is_voltage=True)
    if held == "pure-sine":
        raise IdentificationError(
            "'pure-sine' is not what a sine of voltage makes; a model driven by a voltage answers "
            "'fundamental', 'rms' or 'voltage'",
            field="force",
        )
    return HeldOutput(amplitude, held, force, row, len(model.inputs))


def band_around(
    resonance: Callable[[], float], lowest_hz: float | None, highest_hz: float | None, most_hz: float
) -> tuple[float, float]:
    """Return the band in Hz, by default around a resonance (Hz); raise `IdentificationError` if the limits do not rise."""
    if lowest_hz is None or highest_hz is None:
        at_hz = resonance()
        lowest_hz = _BAND[0] * at_hz if lowest_hz is None else lowest_hz
        highest_hz = _BAND[1] * at_hz if highest_hz is None else highest_hz
    if not 0.0 < lowest_hz < highest_hz < most_hz:
        raise IdentificationError(
            f"is {lowest_hz:g} to {highest_hz:g} Hz", field="band_hz", allowed=f"rising between 0 and {most_hz:g} Hz"
        )
    return float(lowest_hz), float(highest_hz)


def unknowns_near(balance: DrivenBalance, near: SteadyStates) -> Float:
    """Return unknowns from the first point of other steady states; harmonics that these lack are zero."""
    size = balance.basis.size

    def fitted(harmonics: NDArray[np.complex128]) -> Float:
        given = real_coefficients(harmonics)[:size]
        return np.concatenate([given, np.zeros((size - len(given), given.shape[1]))])

    states, inputs, voltage = fitted(near.states[0]), fitted(near.inputs[0]), complex(near.voltage_v[0])
    own = np.zeros(balance.drive.size)
    if own.size == 1:
        own[0] = voltage.real
    elif own.size:
        row = next(row for row, channel in enumerate(balance.inputs) if channel.role == "force")
        own[:] = [*inputs[1:, row], voltage.real, -voltage.imag]
    return np.concatenate([states.ravel(), own])
