"""Set up the harmonic balance of a structured model, and find the resonance of its small vibrations."""

import numpy as np

from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.harmonic_balance.basis import Basis
from identification.harmonic_balance.setting_up import Held, drive_of, held_values
from identification.models.structured.model import StructuredModel
from identification.models.structured.steady.balance import StructuredBalance

_SAMPLES = 32
"""Samples of a period per harmonic. Chosen: dampers and springs have bends."""
_LEAST_SAMPLES = 256
"""Samples of a period at least. Chosen."""


def balance_of(
    model: StructuredModel,
    level: float,
    force: Held,
    exciter: Exciter | None,
    support: bool | None,
    harmonics: int,
    samples: int | None,
) -> StructuredBalance:
    """Return the equations; raise `IdentificationError` for too few samples or harmonics, and as `drive_of` does."""
    if harmonics < 1:
        raise IdentificationError(f"harmonics: is {harmonics}, needs at least 1")
    count = max(_SAMPLES * harmonics, _LEAST_SAMPLES) if samples is None else samples
    if count < 2 * harmonics + 1:
        raise IdentificationError(f"samples: is {count}, needs at least {2 * harmonics + 1} for {harmonics} harmonics")
    basis = Basis(harmonics, count)
    row, _ = held_values(model, None)
    supported = exciter is not None if support is None else support
    return StructuredBalance(model, drive_of(model, level, force, exciter, basis.size, row), basis, supported)


def resonance_hz(model: StructuredModel, near_hz: float | None = None) -> float:
    """Frequency of a mode of small vibrations: the nearest one, or that which moves most at the first input."""
    at_rest = model.linearised()
    if near_hz is not None:
        return float(at_rest.frequency_hz[np.argmin(np.abs(at_rest.frequency_hz - near_hz))])
    compliance = at_rest.input_shapes[:, 0] ** 2 / (at_rest.damping_ratio * at_rest.omega**2)
    return float(at_rest.frequency_hz[int(np.argmax(compliance))])
