"""What a user should know about a predicted response, one line each."""

from collections.abc import Mapping

import numpy as np

from identification.channels import MOTION_ORDER
from identification.pnlss.model import PnlssModel
from identification.pnlss.steady.states import SteadyStates, largest_use, motion_rows
from identification.prediction.exciter import Exciter

__all__ = ["notes_of"]


def notes_of(
    model: PnlssModel,
    points: SteadyStates,
    force: str,
    exciter: Exciter | None,
    held_inputs: Mapping[str, float] | None = None,
) -> tuple[str, ...]:
    """What was held, harmonics at the peak, use of the trained range, losses of stability other than folds."""
    constant = [f"input '{name}' is held at {value:g}" for name, value in (held_inputs or {}).items()]
    return (*_held(model, force, exciter), *constant, *_harmonics(points), *_range(points), *_losses(points))


def _held(model: PnlssModel, force: str, exciter: Exciter | None) -> list[str]:
    where = f" of the exciter{f' ({exciter.source})' if exciter.source else ''}" if exciter else " at the model's input"
    voltage_driven = exciter is None and not any(channel.role == "force" for channel in model.inputs)
    maker = "the exciter inside the model" if voltage_driven else "the exciter"
    return {
        "pure-sine": ["held: a force without harmonics"],
        "fundamental": [f"held: the force's fundamental; its harmonics are those that {maker} makes"],
        "rms": [f"held: the RMS of the force; its harmonics are those that {maker} makes"],
        "voltage": [f"held: the amplitude of a sine of voltage{where}"],
    }[force]


def _harmonics(points: SteadyStates) -> list[str]:
    """Harmonics of force and motion at the largest amplitude."""
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


def _range(points: SteadyStates) -> list[str]:
    notes = []
    for name, use in (("states", points.state_use), ("input", points.input_use)):
        largest = float(np.max(largest_use(use), initial=0.0))
        if np.isnan(largest):
            notes.append(f"the range of the {name} in the training data is unknown")
        elif largest > 1.0:
            notes.append(
                f"the {name} reach{'' if name == 'states' else 'es'} {largest:.2f} times the training data: extrapolated"
            )
    return notes


def _losses(points: SteadyStates) -> list[str]:
    notes = []
    for kind, what in (("period doubling", "the period doubles"), ("Neimark-Sacker", "the amplitude is modulated")):
        at = [hz for hz, loss in zip(points.frequency_hz.tolist(), points.loss, strict=True) if loss == kind]
        if at:
            notes.append(f"{kind}: from {min(at):.4g} to {max(at):.4g} Hz the vibration is unstable, {what}")
    return notes
