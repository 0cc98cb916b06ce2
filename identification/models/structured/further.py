"""Initial values of an element at a given place, or beside others: what is left of the equations of motion of all modes."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.models.structured.laws import Damper, Law, PolynomialDamper, PolynomialSpring
from identification.models.structured.modal_motion import LOWEST, modal_spectra
from identification.models.structured.model import StructuredModel
from identification.models.structured.regression import (
    Regression,
    bounded_regression,
    by_law,
    law_force,
    linear_in,
    with_regression,
)
from identification.models.structured.start import HIGHEST
from vibrolock.arrays import Complex, Float

_ANGLES = np.pi * np.arange(1, 8) / 8.0
"""Angles of directions between two modes that are tried, rad. Chosen: between neighbours the residual changes little."""


@dataclass(frozen=True)
class ElementPlan:
    """An element to be fitted.

    Parameters
    ----------
    laws
        Its laws.
    between
        Names of output channels: one for the displacement there, two for that of the first relative to the second. Empty: the
        direction is found.

    Raises
    ------
    IdentificationError
        If there are no laws, or more than two channels.
    """

    laws: tuple[Law, ...] = (PolynomialSpring(), PolynomialDamper())
    between: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("laws", "between"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        IdentificationError.raise_if(not self.laws, "is empty", field="laws", allowed="one at least")
        if len(self.between) > 2 or len(set(self.between)) < len(self.between):
            raise IdentificationError(
                f"is {', '.join(self.between)}", field="between", allowed="one or two different outputs"
            )


def with_further_element(
    model: StructuredModel, experiments: Sequence[Experiment], measured_modes: int, plan: ElementPlan, reach: float
) -> StructuredModel:
    """Add an element by linear least squares on what is left of the equations of motion of the measured modes.

    Coordinates come from the spectra of the periodic experiments, their means from a simulation. Each mode counts by its
    receptance, so that the residual is that of the outputs. Directions are those between the channels of the plan, or tried:
    along every mode, between any two of them, and at every output. Numbers in which a law is not linear are tried
    (`Law.tried`).
    """
    parts = [_Motion(model, one, measured_modes) for one in experiments if one.period_samples]
    IdentificationError.raise_if(
        not parts, "none is periodic", field="experiments", allowed="one at least for the initial values"
    )
    shapes = model.output_shapes[:, :measured_modes]
    directions = [model.place_of(plan.between) @ shapes] if plan.between else _directions(shapes)
    found = [
        _regression(parts, direction, list(tried))
        for direction in directions
        for tried in product(*(law.candidates() for law in plan.laws))
    ]
    best = min(found, key=lambda one: one.residual)
    direction = np.zeros(len(model.omega))
    direction[:measured_modes] = best.direction
    if plan.between:
        direction = model.place_of(plan.between) @ model.output_shapes
    return with_regression(model, best, range(measured_modes), reach, (direction, plan.between))


def _directions(shapes: Float) -> list[Float]:
    """Return the directions that are tried, as large as the largest shape."""
    modes = shapes.shape[1]
    found = [*np.eye(modes), *shapes]
    for i, j in combinations(range(modes), 2):
        for angle in _ANGLES:
            direction = np.zeros(modes)
            direction[[i, j]] = np.cos(angle), np.sin(angle)
            found.append(direction)
    size = float(np.max(np.abs(shapes)))
    return [np.asarray(size * one / np.max(np.abs(one))) for one in found if np.any(one)]


class _Motion:
    """Measured modal motion in one experiment, and the modal forces that the model leaves unexplained, weighted."""

    def __init__(self, model: StructuredModel, experiment: Experiment, modes: int) -> None:
        spectra, inputs, omega = modal_spectra(model, experiment, modes)
        n, own = experiment.period_samples, model.omega[:modes, None]
        counted = slice(experiment.counted_from, None)
        means = model.simulate_experiment(experiment).displacement[:modes, counted].mean(axis=1)
        self.q = np.fft.irfft(spectra, n, axis=1) * n + means[:, None]
        self.rate = np.fft.irfft(1j * omega * spectra, n, axis=1) * n
        self.lines = (omega > LOWEST * model.omega[0]) & (omega < HIGHEST * np.max(own))
        dynamic = own**2 - omega**2 + 2j * model.damping_ratio[:modes, None] * own * omega
        size = np.linalg.norm(model.output_shapes[:, :modes], axis=0)[:, None]
        self.weight = (size * np.abs(omega) ** 2 / np.abs(dynamic))[:, self.lines]
        left = model.input_shapes[:modes] @ inputs - dynamic * spectra
        for element in model.elements:
            phi = element.phi[:modes]
            force = sum(law_force(law, phi @ self.q, element.scale_m * phi @ self.rate) for law in element.laws)
            left = left - element.scale_m * phi[:, None] * (np.fft.rfft(force) / n)
        self.left = left[:, self.lines]

    def column(self, direction: Float, force: Float) -> Complex:
        """Weighted spectra of the modal forces of a force along a direction, mode after mode."""
        spectrum = np.fft.rfft(force)[self.lines] / force.size
        return np.asarray(np.ravel(self.weight * direction[:, None] * spectrum))


def _regression(parts: Sequence[_Motion], direction: Float, laws: list[Law]) -> Regression:
    """Return the numbers in which ``laws`` are linear."""
    scale = max(float(np.max(np.abs(direction @ part.q))) for part in parts)
    basis = [one for law in linear_in(laws) for one in law.basis()]
    modes = np.eye(direction.size)
    rows = []
    for part in parts:
        x, speed = direction @ part.q / scale, direction @ part.rate
        columns = [part.column(direction, law_force(one, x, speed)) for one in basis]
        columns += [
            part.column(mode, of) for motion in (part.q, part.rate) for mode, of in zip(modes, motion, strict=True)
        ]
        rows.append(np.array(columns).T)
    a, y = np.concatenate(rows), np.concatenate([np.ravel(part.weight * part.left) for part in parts])
    numbers, residual = bounded_regression(laws, np.concatenate([a.real, a.imag]), np.concatenate([y.real, y.imag]))
    found, rest = by_law(laws, numbers)
    # a damper's numbers are N s/m, J s once they are multiplied by the squared scale
    found = [one * scale ** (2 if isinstance(law, Damper) else 1) for one, law in zip(found, laws, strict=True)]
    stiffness, damping = np.split(rest, 2)
    return Regression(direction, scale, laws, found, stiffness, damping, residual)
