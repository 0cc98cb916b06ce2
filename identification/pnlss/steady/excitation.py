"""Which drive a model and what is asked for amount to, and where its resonance is."""

from typing import Literal, get_args

import numpy as np

from identification.channels import MOTION_ORDER, find_role
from identification.errors import IdentificationError
from identification.pnlss.model import PnlssModel
from identification.pnlss.steady.coupled import Coupled
from identification.pnlss.steady.drives import Drive, HeldOutput, Sine
from identification.pnlss.steady.states import motion_rows
from identification.prediction.exciter import Exciter
from identification.validation import positive

__all__ = ["Held", "drive_of", "linear_resonance_hz"]

Held = Literal["fundamental", "rms", "pure-sine", "voltage"]

_LIGHT = 0.3
"""Damping ratio up to which a pole makes a resonance."""


def drive_of(model: PnlssModel, level: float, held: Held, exciter: Exciter | None, coefficients: int) -> Drive:
    """The drive; raises `IdentificationError` where model, exciter and what is to be held do not go together."""
    if held not in get_args(Held):
        raise IdentificationError(f"force: is '{held}', allowed are {', '.join(get_args(Held))}")
    amplitude = positive("force_n", level, "V" if held == "voltage" else "N")
    m = len(model.inputs)
    forces = [row for row, channel in enumerate(model.inputs) if channel.role == "force"]
    if len(forces) > 1 or (not forces and m != 1):
        raise IdentificationError(
            f"model: has {m} inputs, {len(forces)} of them forces; needs one force, or a voltage alone"
        )
    if not forces:
        return _voltage_driven(model, amplitude, held, exciter)
    if exciter is None:
        if held != "pure-sine":
            raise IdentificationError(
                f"force: '{held}' of a model driven by a force needs an exciter, which makes the force's harmonics; "
                "without one 'pure-sine' is predicted"
            )
        return Sine(amplitude, forces[0], m)
    if held == "pure-sine":
        raise IdentificationError("exciter: makes harmonics of the force; leave it out for 'pure-sine'")
    drive = find_role(model.outputs, "drive")
    order = MOTION_ORDER[model.outputs[drive].motion]
    return Coupled(exciter, amplitude, held, drive, order, forces[0], m, coefficients)


def _voltage_driven(model: PnlssModel, amplitude: float, held: Held, exciter: Exciter | None) -> Drive:
    if exciter is not None:
        raise IdentificationError("exciter: is inside a model that is driven by a voltage; leave it out")
    force = find_role(model.outputs, "force")
    if held == "voltage":
        return Sine(amplitude, 0, 1, is_voltage=True)
    if held == "pure-sine":
        raise IdentificationError(
            "force: 'pure-sine' is not what a sine of voltage makes; a model driven by a voltage answers 'fundamental', "
            "'rms' or 'voltage'"
        )
    return HeldOutput(amplitude, held, force, 0, 1)


def linear_resonance_hz(model: PnlssModel) -> float:
    """Natural frequency of the linear part's lightly damped mode with the largest displacement of the drive point.

    Raises `IdentificationError` if it has none.
    """
    poles = np.linalg.eigvals(model.a)
    s = np.log(poles[(poles.imag > 0.0) & (np.abs(poles) > 0.0)]) * model.sample_rate_hz
    s = s[-s.real <= _LIGHT * np.abs(s)]
    if not s.size:
        raise IdentificationError(
            "lowest_hz, highest_hz: not given, and the model's linear part has no lightly damped mode to set them by"
        )
    output = motion_rows(model.outputs)[0]
    order = MOTION_ORDER[model.outputs[output].motion]
    response = model.linear_part.response(np.exp(1j * s.imag / model.sample_rate_hz))[:, output, :]
    size = np.linalg.norm(response, axis=1) / np.abs(s) ** order
    return float(np.abs(s[int(np.argmax(size))]) / (2.0 * np.pi))
