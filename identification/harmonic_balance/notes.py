"""Notes for the user on a frequency response."""

from collections.abc import Mapping

import numpy as np

from identification.channels import MOTION_ORDER
from identification.exciter_coupling.exciter import Exciter
from identification.experiments.simulators import Driven
from identification.harmonic_balance.states import SteadyStates, motion_rows


def held_notes(
    model: Driven, force: str, exciter: Exciter | None, held_inputs: Mapping[str, float] | None
) -> list[str]:
    """Return notes on what is held."""
    where = f" of the exciter{f' ({exciter.source})' if exciter.source else ''}" if exciter else " at the model's input"
    voltage_driven = exciter is None and not any(channel.role == "force" for channel in model.inputs)
    maker = "the exciter inside the model" if voltage_driven else "the exciter"
    held = {
        "pure-sine": "held: a force without harmonics",
        "fundamental": f"held: the force's fundamental; its harmonics are those that {maker} makes",
        "rms": f"held: the RMS of the force; its harmonics are those that {maker} makes",
        "voltage": f"held: the amplitude of a sine of voltage{where}",
    }[force]
    return [held, *(f"input '{name}' is held at {value:g}" for name, value in (held_inputs or {}).items())]


def harmonics_notes(points: SteadyStates) -> list[str]:
    """Return notes on the harmonics of force and motion at the largest amplitude."""
    peak = int(np.argmax(np.abs(points.displacement_m[:, 1, 0])))
    row = motion_rows(points.output_channels)[0]
    order = MOTION_ORDER[points.output_channels[row].motion]
    h = np.arange(1, points.outputs.shape[1])
    motion, force = np.abs(points.outputs[peak, 1:, row]) / h**order, np.abs(points.force_n[peak, 1:])
    notes = [
        f"at the peak harmonics 2 to {h[-1]} are {100.0 * np.linalg.norm(motion[1:]) / motion[0]:.2g} % of the "
        "displacement's fundamental"
    ]
    if h.size > 1 and force[1] > 0.0:
        notes.append(f"at the peak F2/F1 is {force[1] / force[0]:.2g}")
    return notes if h.size > 1 else []


def loss_notes(points: SteadyStates) -> list[str]:
    """Return notes on losses of stability but folds."""
    notes = []
    for kind, what in (("period doubling", "the period doubles"), ("Neimark-Sacker", "the amplitude is modulated")):
        at = [hz for hz, loss in zip(points.frequency_hz.tolist(), points.loss, strict=True) if loss == kind]
        if at:
            notes.append(f"{kind}: from {min(at):.4g} to {max(at):.4g} Hz the vibration is unstable, {what}")
    return notes


def edge_notes(points: SteadyStates, low: float, high: float) -> list[str]:
    """Return a note if the largest amplitude is at an end of the band."""
    at_hz = points.frequency_hz[int(np.argmax(np.abs(points.displacement_m[:, 1, 0])))]
    return ["the largest amplitude is at an end of the band: widen it"] if at_hz in (low, high) else []
