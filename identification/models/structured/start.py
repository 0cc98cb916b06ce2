"""Initial values of a structured model: modes from a modal test, and linear regressions for the nonlinear elements."""

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from identification.channels import find_name
from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.fitting.bounded_steps import qr_r
from identification.linear.modes import LinearModes
from identification.models.structured.laws import Damper, Joint, Law, Spring
from identification.models.structured.model import StructuredModel
from identification.models.structured.nudging import LOWEST, modal_spectra
from identification.models.structured.regression import Regression, bounded_regression, law_force, with_regression
from vibrolock.arrays import Complex, Float

_HIGHEST = 6.0
"""Highest line of the regressions, relative to the frequency of the highest mode. Chosen."""
_ANGLES = np.pi * np.arange(1, 8) / 8.0
"""Angles of directions between two modes that are tried, rad. Chosen: between neighbours the residual changes little."""
_POSITIONS = np.linspace(-1.0, 1.0, 21)
"""Mean positions that are tried, relative to the RMS of the motion: sensors of acceleration do not show it."""
_RESIDUAL_DAMPING = 0.02
"""Damping ratio of the mode that stands for the residual. Chosen: it is far above the band, where it does not count."""
_HIGHEST_RESIDUAL, _OF_STEPS = 0.6, 0.35
"""Highest frequency of the residual's mode, relative to the sample rate and to the rate of the steps. Modes far above the band
may have none. A lower mode with the same static receptance has a larger mass, and an exciter is simulated more easily with it.
"""


def linear_start(modes: LinearModes, experiment: Experiment, steps: int) -> StructuredModel:
    """Return the linear model with the channels of ``experiment``.

    The residual of the modes above the band becomes one more mode, at the frequency that `LinearModes` gives for it,
    unless the steps are too long for that.
    Raises `IdentificationError` if an output is not among the channels of the modes.
    """
    rows = [find_name(modes.channels, channel.name) for channel in experiment.output_channels]
    drive = modes.drive_row
    shapes, upper = np.real(np.asarray(modes.shapes)), np.real(np.asarray(modes.upper))
    frequency, damping = np.asarray(modes.frequency_hz), np.asarray(modes.damping_ratio)
    inputs, outputs = shapes[drive], shapes[rows]
    if upper[drive] > 0.0:  # receptance upper = b c / w^2
        upper_hz = min(float(modes.upper_hz), min(_HIGHEST_RESIDUAL, _OF_STEPS * steps) * experiment.sample_rate_hz)
        omega = 2.0 * np.pi * upper_hz
        at_drive = omega * np.sqrt(upper[drive])
        frequency, damping = np.append(frequency, upper_hz), np.append(damping, _RESIDUAL_DAMPING)
        inputs = np.append(inputs, at_drive)
        outputs = np.column_stack([outputs, upper[rows] * omega**2 / at_drive])
    return StructuredModel(
        frequency_hz=frequency,
        damping_ratio=damping,
        input_shapes=inputs[:, None],
        output_shapes=outputs,
        direct=np.zeros((len(rows), 1)),
        elements=(),
        sample_rate_hz=experiment.sample_rate_hz,
        inputs=experiment.input_channels,
        outputs=experiment.output_channels,
        steps=steps,
        specimen=modes.specimen or experiment.specimen,
    )


class Start(NamedTuple):
    """A model with which a fit may begin."""

    model: StructuredModel
    residual: float
    """Norm of what its regression leaves; comparable between laws on the same data."""


def element_starts(
    linear: StructuredModel,
    experiments: Sequence[Experiment],
    measured_modes: int,
    laws: Sequence[Law],
    reach: float,
    held: int = 0,
) -> list[Start]:
    """Add an element along the mode that moves most: what is left of its equation of motion, by linear least squares.

    The modal coordinates of the periodic experiments come from their spectra. Sensors of acceleration do not show the mean
    position. A shift of it changes the coefficients of a polynomial, not the forces, so that the lines do not determine it.
    Static balance does: without a mean input the mean of mode and element is zero. Numbers in which a law is not linear are
    tried (`Law.tried`). Returned are the combinations with the least residual for each value of the first of these numbers,
    such as the slip of a joint, the least first: the regression does not always rank them as a fit does. The first ``held``
    laws keep the numbers in which they are not linear. Mean positions in balance beyond the largest RMS are not found. Without
    laws it is the model itself, and what is left without an element.
    Raises `IdentificationError` if no experiment is periodic.
    """
    periodic = periodic_of(experiments)
    coordinates = [modal_spectra(linear, experiment, measured_modes) for experiment in periodic]
    sizes = [np.sqrt(np.mean(np.abs(q) ** 2, axis=1)) for q, _, _ in coordinates]
    mode = int(np.argmax(np.max(sizes, axis=0)))
    shape = float(linear.input_shapes[mode, 0])
    times = [
        np.fft.irfft(q[mode], e.period_samples) * e.period_samples
        for (q, _, _), e in zip(coordinates, periodic, strict=True)
    ]
    scale = float(np.max(np.abs(np.concatenate(times)))) * abs(shape)
    parts = [_Equation(linear, mode, spectra, q, shape / scale) for spectra, q in zip(coordinates, times, strict=True)]
    places = _POSITIONS * float(np.sqrt(np.mean(np.concatenate(times) ** 2)))
    found = [
        _regression(parts, list(tried), places, linear.omega[mode], (shape, scale))
        for tried in _combinations(laws, held)
    ]
    if not laws:
        return [Start(linear, found[0].residual)]
    direction = np.zeros(len(linear.omega))
    direction[mode] = shape
    best = dict[tuple[float, ...], Regression]()
    for one in sorted(found, key=lambda one: one.residual):
        best.setdefault(tuple(getattr(law, next(iter(law.tried))) for law in one.laws if law.tried), one)
    return [Start(with_regression(linear, one, [mode], reach, (direction, ())), one.residual) for one in best.values()]


def _combinations(laws: Sequence[Law], held: int) -> Iterator[tuple[Law, ...]]:
    return product(*([law] if number < held else law.candidates() for number, law in enumerate(laws)))


def periodic_of(experiments: Sequence[Experiment]) -> list[Experiment]:
    """Return the periodic ones; raise `IdentificationError` if there is none."""
    found = [experiment for experiment in experiments if experiment.period_samples]
    IdentificationError.raise_if(
        not found, "none is periodic", field="experiments", allowed="one at least for the initial values"
    )
    return found


def _root(function: Callable[[float], float], places: Float) -> float:
    """Return the root nearest to zero between two of the places; without a change of sign the place of the least value.

    Places are asked from the middle on, and no more than needed.
    """
    from scipy.optimize import brentq  # only on use: it takes long to load

    value = cache(lambda number: function(float(places[number])))
    middles = np.abs(places[1:] + places[:-1])
    for at in np.argsort(middles, kind="stable").tolist():
        if np.sign(value(at)) != np.sign(value(at + 1)):
            return float(brentq(function, places[at], places[at + 1], rtol=1e-6))
    return float(places[min(range(len(places)), key=lambda number: abs(value(number)))])


class _Equation:
    """The equation of motion of one mode in one experiment, line by line."""

    def __init__(
        self,
        linear: StructuredModel,
        mode: int,
        spectra: tuple[Complex, Complex, Float],
        q: Float,
        phi: float,
    ) -> None:
        coordinates, inputs, omega = spectra
        own = linear.omega[mode]
        self.lines = (omega > LOWEST * own) & (omega < _HIGHEST * own)
        dynamic = own**2 - omega**2 + 2j * linear.damping_ratio[mode] * own * omega
        left = linear.input_shapes[mode] @ inputs - dynamic * coordinates[mode]
        self.left, self.phi, self.q = left[self.lines], phi, q
        self.rate = np.fft.irfft(1j * omega * coordinates[mode], q.size) * q.size
        self._known: dict[tuple[Law, float], Complex] = {}
        self.own = self._spectra([self.q, self.rate])

    def columns(self, law: Law, position: float) -> Complex:
        """Spectra of the forces of a law for each of its linear numbers at 1, per x: the mean, and the lines.

        A joint's do not depend on the position.
        """
        at = (law, 0.0 if isinstance(law, Joint) else position)
        if at not in self._known:
            x = self.phi * (self.q + position)
            self._known[at] = self._spectra([law_force(one, x, self.phi * self.rate) for one in law.basis()])
        return self._known[at]

    def _spectra(self, signals: list[Float]) -> Complex:
        kept = np.append(0, np.flatnonzero(self.lines))
        return np.asarray(np.fft.rfft(signals, axis=1)[:, kept] / self.q.size)


def _regression(
    parts: Sequence[_Equation], laws: list[Law], places: Float, omega: float, element: tuple[float, float]
) -> Regression:
    """Return the numbers in which ``laws`` are linear, at the mean position of static balance.

    ``element``: its displacement per coordinate of the mode, and its scale.
    """
    linear = [law for law in laws if law.linear]
    left = np.concatenate([part.left for part in parts])

    def solved(position: float) -> tuple[list[Float], Float, float, Float]:
        """Return the numbers as `bounded_regression`, and the mean forces in the first experiment."""
        forces = [
            part.phi * np.concatenate([part.own[:0], *(part.columns(law, position) for law in linear)])
            for part in parts
        ]
        rows = [np.concatenate([of, part.own])[:, 1:].T for part, of in zip(parts, forces, strict=True)]
        both = np.column_stack([np.concatenate(rows), left])
        triangle = qr_r(np.concatenate([both.real, both.imag]))  # the same norms, in few rows
        return *bounded_regression(laws, triangle[:, :-1], triangle[:, -1]), forces[0][:, 0].real

    def unbalanced(position: float) -> float:
        numbers, rest, _, means = solved(position)
        return float(means @ np.concatenate(numbers) + (omega**2 + rest[0]) * position)

    still = not any(isinstance(law, Spring) for law in linear)
    found, (stiffness, damping), residual, _ = solved(0.0 if still else _root(unbalanced, places))
    shape, scale = element
    return Regression(np.array([shape]), scale, laws, found, np.array([stiffness]), np.array([damping]), residual)


def with_further_element(
    model: StructuredModel,
    experiments: Sequence[Experiment],
    measured_modes: int,
    laws: Sequence[Law],
    between: tuple[str, ...],
    reach: float,
    held: int = 0,
) -> Start:
    """Add an element by linear least squares on what is left of the equations of motion of the measured modes.

    Coordinates come from the spectra of the periodic experiments, their means from a simulation. Each mode counts by its
    receptance, so that the residual is that of the outputs. Directions are those between the channels given, or tried:
    along every mode, between any two of them, and at every output. Numbers in which a law is not linear are tried
    (`Law.tried`), but those of the first ``held`` laws. Without laws it is the model itself, and what is left without a further
    element.
    """
    parts = [ModalMotion(model, one, measured_modes) for one in periodic_of(experiments)]
    shapes = model.output_shapes[:, :measured_modes]
    directions = [model.output_selector(between) @ shapes] if between else _directions(shapes)
    found = [
        _regression_of_modes(parts, direction, list(tried))
        for direction in directions
        for tried in _combinations(laws, held)
    ]
    best = min(found, key=lambda one: one.residual)
    if not laws:
        return Start(model, best.residual)
    direction = np.zeros(len(model.omega))
    direction[:measured_modes] = best.direction
    if between:
        direction = model.output_selector(between) @ model.output_shapes
    return Start(with_regression(model, best, range(measured_modes), reach, (direction, between)), best.residual)


def _directions(shapes: Float) -> list[Float]:
    modes = shapes.shape[1]
    found = [*np.eye(modes), *shapes]
    for i, j in combinations(range(modes), 2):
        for angle in _ANGLES:
            direction = np.zeros(modes)
            direction[[i, j]] = np.cos(angle), np.sin(angle)
            found.append(direction)
    size = float(np.max(np.abs(shapes)))
    return [np.asarray(size * one / np.max(np.abs(one))) for one in found if np.any(one)]


class ModalMotion:
    """Measured modal motion in one experiment, and the modal forces that the model leaves unexplained, weighted."""

    def __init__(self, model: StructuredModel, experiment: Experiment, modes: int) -> None:
        spectra, inputs, omega = modal_spectra(model, experiment, modes)
        n, own = experiment.period_samples, model.omega[:modes, None]
        counted = slice(experiment.counted_from, None)
        means = model.simulate_experiment(experiment).displacement[:modes, counted].mean(axis=1)
        self.q = np.fft.irfft(spectra, n, axis=1) * n + means[:, None]
        self.rate = np.fft.irfft(1j * omega * spectra, n, axis=1) * n
        self.lines = (omega > LOWEST * model.omega[0]) & (omega < _HIGHEST * np.max(own))
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


def _regression_of_modes(parts: Sequence[ModalMotion], direction: Float, laws: list[Law]) -> Regression:
    scale = max(float(np.max(np.abs(direction @ part.q))) for part in parts)
    basis = [one for law in laws for one in law.basis()]
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
    found, rest, residual = bounded_regression(laws, np.concatenate([a.real, a.imag]), np.concatenate([y.real, y.imag]))
    # a damper's numbers are N s/m, J s once they are multiplied by the squared scale
    found = [one * scale ** (2 if isinstance(law, Damper) else 1) for one, law in zip(found, laws, strict=True)]
    stiffness, damping = np.split(rest, 2)
    return Regression(direction, scale, laws, found, stiffness, damping, residual)
