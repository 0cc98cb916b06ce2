"""Shifts of a model's linear part along its modes, and of its gain, as a run may have them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment, excited_band
from identification.models.pnlss.model import PnlssModel
from identification.models.structured.model import StructuredModel
from vibrolock.arrays import Complex, Float

Scattered = StructuredModel | PnlssModel

KINDS = ("frequency", "damping", "gain")


@dataclass(frozen=True)
class Effect:
    """What shifts: the natural ``frequency`` or the ``damping`` ratio of a mode, or the ``gain`` of all outputs.

    A shift s multiplies it by ``exp(s)``, so that a small one is relative.
    """

    kind: str
    mode: int = 0
    """From 0, in rising order of frequency; without meaning for the gain."""

    def __str__(self) -> str:
        return self.kind if self.kind == "gain" else f"{self.kind} {self.mode + 1}"


def modes_of(model: Scattered) -> Complex:
    """complex[n]: poles (rad/s, above the real axis) of the linear part, in rising order of frequency."""
    if isinstance(model, StructuredModel):
        zeta = model.damping_ratio
        return np.asarray(2.0 * np.pi * model.frequency_hz * (-zeta + 1j * np.sqrt(1.0 - zeta**2)))
    found = np.log(np.linalg.eigvals(model.a).astype(np.complex128)) * model.sample_rate_hz
    found = found[found.imag > 1e-9 * np.abs(found)]
    return np.asarray(found[np.argsort(np.abs(found))])


def effects_of(
    model: Scattered, experiments: Sequence[Experiment], kinds: Sequence[str] = ("frequency", "damping")
) -> tuple[Effect, ...]:
    """Return the effects of ``kinds`` for all modes within the excited band.

    Raises `IdentificationError` if a kind is unknown, or there is no such mode.
    """
    wrong = [kind for kind in kinds if kind not in KINDS]
    if wrong or not kinds:
        raise IdentificationError(f"are {', '.join(kinds) or 'none'}", field="kinds", allowed=KINDS)
    band = excited_band(experiments) or (0.0, np.inf)
    frequency = np.abs(modes_of(model)) / (2.0 * np.pi)
    modes = [mode for mode, f in enumerate(frequency) if band[0] <= f <= band[1]]
    if not modes and set(kinds) != {"gain"}:
        found = ", ".join(f"{f:.4g}" for f in frequency) or "none"
        reason = f"the model has modes at {found} Hz, none in the excited band of {band[0]:g} to {band[1]:g} Hz"
        raise IdentificationError(reason, field="scatter")
    of_modes = [Effect(kind, mode) for kind in kinds if kind != "gain" for mode in modes]
    return (*of_modes, *[Effect("gain")] * ("gain" in kinds))


def shifted(model: Scattered, effects: Sequence[Effect], shift: Float) -> Scattered:
    """Return the model of a run with shifts (float[n_effects]) of its linear part.

    In a PNLSS model the eigenvalues of A move and all else stays: input and output matrices change by the shift itself, a
    response at resonance by the shift over the damping ratio.
    """
    moves = np.zeros((2, len(modes_of(model))))
    gain = 0.0
    for effect, size in zip(effects, shift, strict=True):
        if effect.kind == "gain":
            gain += float(size)
        else:
            moves[KINDS.index(effect.kind), effect.mode] += size
    factor = np.exp(gain)
    if isinstance(model, StructuredModel):
        frequency, damping = np.exp(moves)
        return replace(
            model,
            frequency_hz=model.frequency_hz * frequency,
            damping_ratio=model.damping_ratio * damping,
            output_shapes=factor * model.output_shapes,
            direct=factor * model.direct,
        )
    moved = _pnlss(model, *moves) if np.any(moves) else model
    return replace(moved, c=factor * moved.c, d=factor * moved.d, f=factor * moved.f)


def _pnlss(model: PnlssModel, frequency: Float, damping: Float) -> PnlssModel:
    values, vectors = np.linalg.eig(model.a)
    poles = np.log(values.astype(np.complex128)) * model.sample_rate_hz
    new = values.astype(np.complex128)
    for own, by_frequency, by_damping in zip(modes_of(model), frequency, damping, strict=True):
        if not by_frequency and not by_damping:
            continue
        omega, zeta = abs(own) * np.exp(by_frequency), -own.real / abs(own) * np.exp(by_damping)
        pole = omega * (-zeta + 1j * np.sqrt(max(1.0 - zeta**2, 0.0)))
        at = int(np.argmin(np.abs(poles - own)))
        new[at] = np.exp(pole / model.sample_rate_hz)
        new[int(np.argmin(np.abs(poles - own.conjugate())))] = new[at].conjugate()
    a = np.linalg.solve(vectors.T, (vectors * new).T).T
    return replace(model, a=np.ascontiguousarray(a.real))
