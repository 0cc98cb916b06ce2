"""How far an input drives a structure, over the range of the training data.

The model's own motion does not tell how far a prediction goes: a model that is too stiff or too damped there moves too little.
The input does: over the one that moves the structure through the range of the training data, with the stiffness and the damping
that the elements have there (`secant`).
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from identification.models.structured.elements import NonlinearElement
from identification.models.structured.hysteresis import joint_forces
from vibrolock.arrays import Complex, Float

_PHASES = 512
"""Samples of the period over which an element's stiffness and damping are averaged. Chosen."""
_AROUND = np.linspace(-2.0, 2.0, 41)
"""Distances from a resonance at which the response is looked for, over half its bandwidth. Chosen."""


class Structure(Protocol):
    """What is asked of a structured model here."""

    @property
    def omega(self) -> Float:
        """float[n], rad/s."""

    @property
    def damping_ratio(self) -> Float:
        """float[n]."""

    @property
    def input_shapes(self) -> Float:
        """float[n, n_inputs], kg^-1/2."""

    @property
    def elements(self) -> Sequence[NonlinearElement]:
        """The nonlinear elements."""

    @property
    def sample_rate_hz(self) -> float:
        """Samples per second."""


class _Secants(NamedTuple):
    """The structure with the secant stiffness and damping of its elements, in modal coordinates."""

    phi: Float
    stiffness: Complex
    rates: Float
    pushed: Float
    largest: Float
    """float[n_elements]: largest displacement of each element in the training data."""

    def moved(self, omega: Float) -> Complex:
        """complex[n, n_elements]: displacements of the elements per newton, over their largest."""
        omega = np.asarray(omega)[:, None, None]
        dynamic = self.stiffness - omega**2 * np.eye(len(self.pushed)) + 1j * omega * self.rates
        found = np.linalg.solve(dynamic, self.pushed.astype(complex)[None, :, None])[..., 0]
        return np.asarray(found @ self.phi.T / self.largest)


def secant(element: NonlinearElement) -> tuple[float, float, float]:
    """Return stiffness (J), loss per cycle as an imaginary stiffness (J) and damping (J s) of a sine over the trained range.

    Those of the first harmonic of the force. The range is that of the laws where that of the training is unknown.
    """
    x = float(element.largest or element.reach)
    theta = 2.0 * np.pi * np.arange(_PHASES) / _PHASES
    along = x * np.sin(theta)  # from rest at 0: a hysteresis remembers where it began
    force = np.interp(along, element.nodes, element.spring(element.laws)[0])
    sliding = np.zeros(_PHASES)
    joint_forces(element.sliders(element.laws), element.bends(element.laws), along, sliding)
    whole = (2.0 / (_PHASES * x)) * np.sum((force + sliding) * (np.sin(theta) + 1j * np.cos(theta)))
    damping = np.interp(along, element.nodes, element.damper(element.laws))
    return float(whole.real), float(whole.imag), float(2.0 * np.mean(damping * np.cos(theta) ** 2))


def _secants(model: Structure) -> _Secants | None:
    if not model.elements or not all(one.largest for one in model.elements):
        return None
    phi = np.array([one.phi for one in model.elements])
    stiff, loss, damping = np.array([secant(one) for one in model.elements]).T
    return _Secants(
        phi=phi,
        stiffness=np.diag(model.omega**2) + (phi.T * (stiff + 1j * loss)) @ phi,
        rates=np.diag(2.0 * model.damping_ratio * model.omega) + (phi.T * damping) @ phi,
        pushed=model.input_shapes[:, 0],
        largest=np.array([float(one.largest or 1.0) for one in model.elements]),
    )


def trained_force_n(model: Structure, lowest_hz: float, highest_hz: float) -> float:
    """Return the peak of a sine that moves an element through its trained range at a resonance in a band; NaN if there is none.

    By the equation of motion with the stiffness and damping of `secant`.
    """
    known = _secants(model)
    if known is None:
        return float("nan")
    squares, shapes = np.linalg.eigh(known.stiffness.real)
    least = np.inf
    for square, shape in zip(squares, shapes.T, strict=True):
        if square <= 0.0 or not lowest_hz <= (at := float(np.sqrt(square))) / (2.0 * np.pi) <= highest_hz:
            continue
        half = 0.5 * (float(shape @ known.rates @ shape) + float(shape @ known.stiffness.imag @ shape) / at)
        least = min(least, 1.0 / float(np.max(np.abs(known.moved(at + half * _AROUND)))))
    return least if np.isfinite(least) else float("nan")


def driven_displacements(model: Structure, force_n: Float, *, settled: bool) -> Float:
    """float[n_elements]: how far a force moves each element with `secant`, over its largest displacement in training.

    NaN where the training is unknown. On seven structures it was within 15 % of how far the structures themselves went, up to
    twice the training, and up to a third above where an element stiffens.

    Parameters
    ----------
    model
        The model.
    force_n
        float[n], force at the model's sample rate.
    settled
        Whether it is whole periods of a settled vibration; else the structure begins at rest.
    """
    known = _secants(model)
    if known is None:
        return np.full(len(model.elements), np.nan)
    n = (
        force_n.size if settled else 2 * force_n.size
    )  # at rest behind the record: what rings there comes round to its begin
    spectrum = np.fft.rfft(force_n, n)
    moved = known.moved(np.asarray(2.0 * np.pi * np.fft.rfftfreq(n, 1.0 / model.sample_rate_hz), dtype=np.float64))
    along = np.fft.irfft(moved * spectrum[:, None], n, axis=0)[: force_n.size]
    return np.asarray(np.max(np.abs(along), axis=0))


def input_use(model: Structure, force_n: Float, *, settled: bool) -> float:
    """Return how far a force goes beyond the training data, whatever the model does: above one it does; NaN if unknown.

    The largest of `driven_displacements`; where the forces of the training themselves exceed 1 there, over theirs.
    """
    found = driven_displacements(model, force_n, settled=settled)
    return (
        float(np.max(found / [max(one.driven or 1.0, 1.0) for one in model.elements], initial=0.0))
        if found.size
        else float("nan")
    )
