"""Harmonic balance of the equation of motion of a structured model.

``(w^2 D^2 + 2 Z W w D + W^2) Q + sum_e phi_e T^+ F_e(T phi_e . Q, w T D phi_e . Q) = B (U + S)``

with the Fourier coefficients Q of the modal coordinates, the angular frequency w and the derivative D of a Fourier series by
its phase. Forces of elements are evaluated over the phase (alternating frequency and time: Cameron and Griffin, J. Appl. Mech.
56, 1989). The frequencies are those of the model, not those of its time steps (`StructuredModel`).

Stability is that of a disturbance ``p(t) exp(s t)`` with periodic p (Hill): ``s^2 + s (2 w D + C) + J`` is singular there, with
the Jacobian J and the damping C. Its multipliers over a period are ``exp(2 pi s / w)``.
"""

import numpy as np
from numpy.typing import NDArray

from identification.harmonic_balance.basis import Basis, complex_product
from identification.harmonic_balance.driven import DrivenBalance, Period
from identification.harmonic_balance.drives import Drive
from identification.harmonic_balance.stability import by_centroid, distinct
from identification.models.structured.hysteresis import dry_friction, hysteresis_step
from identification.models.structured.kernels import damping_at, jenkins_step, spring_at
from identification.models.structured.model import StructuredModel
from identification.models.structured.steps import System
from vibrolock.arrays import Complex, Float
from vibrolock.compiled import inner_kernel, unlocked_kernel

CLOSING = 12  # periods at most in which Newton's method closes a loop
CLOSED = 1e-11  # what a loop misses when it is closed, relative to its largest force
LOSSLESS = 1e-9  # share of a change of force that a period takes, below which a hysteresis is a spring


DRY = 1e-3
"""Displacement x at which dry friction slips, about what a sample of a period moves next to its turning point. Chosen."""


def _is_dry(system: System) -> NDArray[np.bool_]:
    return np.asarray(system.tables.bends[:, 1] < 0.0)


def _with_soft_friction(system: System, slip: float) -> System:
    """Return the system with sliders that slip at a displacement in place of dry friction.

    Where it depends on the speed the row of its bend remains.
    """
    tables, dry = system.tables, _is_dry(system)
    sliders, bends = tables.sliders.copy(), tables.bends.copy()
    sliders[dry, 0] = sliders[dry, 1] / slip
    bends[dry & (bends[:, 2] == 0.0)] = 0.0
    return system._replace(tables=tables._replace(sliders=sliders, bends=bends))


class StructuredBalance(DrivenBalance):
    """Equations of a driven structured model; its states are the modal coordinates.

    ``support``: whether the support acts on the mean displacement. What its low-pass lets through of the fundamental always
    acts: it does work, which the damping found by a fit offsets. The multipliers do not include the memory of the filter.
    """

    beyond = "elements are beyond {:g} times their range"

    def __init__(self, model: StructuredModel, drive: Drive, basis: Basis, support: bool = True) -> None:
        modes, self.ranges = len(model.omega), len(model.elements)
        super().__init__(model, modes, drive, basis)
        self.model, self.order, self._system = model, 2 * modes, _with_soft_friction(model.system, DRY)
        self.kinks = len(self._system.tables.sliders) > 0
        self._range = np.array([element.largest or element.reach for element in model.elements])
        self._mean_supported = float(support)
        self._turning = basis.turned(0.0)[1]
        self._to_rate = basis.to_time @ self._turning
        phi = self._system.phi
        self._pairs = (phi[:, :, None] * phi[:, None, :]).reshape(len(phi), modes * modes)
        self._orders = np.array([int(order) for order in model.motions], float)
        turned = [np.linalg.matrix_power(self._turning, int(order)) for order in model.motions]
        self._motions_by = np.stack(
            [one[..., None] * shape for one, shape in zip(turned, model.output_shapes, strict=True)], axis=1
        )
        """Derivatives of the outputs' coefficients by those of the states at 1 rad/s [size, outputs, size, n]."""
        b, one = model.input_shapes, np.eye(basis.size)
        self._own_damping, self._stiffness = 2.0 * model.damping_ratio * model.omega, model.omega**2
        self._twice = self._turning @ self._turning
        self._by = np.zeros((3, basis.size, modes, basis.size, modes + b.shape[1]))
        """Derivatives of the residual of small vibrations by (x, u), times powers 0 to 2 of the frequency in rad/s."""
        for i in range(modes):
            self._by[:, :, i, :, i] = self._stiffness[i] * one, self._own_damping[i] * self._turning, self._twice
        for p in range(basis.size):
            self._by[0, p, :, p, modes:] = -b
        self._driven = np.outer(b[:, 0], b[:, 0])
        self._outputs_by = np.zeros((basis.size, len(self.outputs), basis.size, modes + b.shape[1]))
        for p in range(basis.size):
            self._outputs_by[p, :, p, modes:] = model.direct
        shape = (self.ranges, basis.samples)
        self._work = np.empty(shape), np.empty(shape), np.empty((*shape, basis.size))
        self._rows = np.empty((2, basis.size))

    def like(self, model: StructuredModel) -> "StructuredBalance":
        """Return the same equations of another model."""
        return StructuredBalance(model, self.drive, self.basis, self._mean_supported > 0.0)

    def in_phase(self, z: Float, frequency_hz: float, level: float) -> tuple[float, Float, float, float]:
        """Return the displacement at the first input in phase with the force, with its derivatives."""
        row = self._displacement_row(1)
        return float(row @ z), row, 0.0, 0.0

    @property
    def amplitude_row(self) -> Float:
        """Displacement at the first input that lags the force by 90 degrees, per unit of the unknowns."""
        return self._displacement_row(2)

    def _displacement_row(self, coefficient: int) -> Float:
        row = np.zeros((self.basis.size, self.n_states))
        row[coefficient] = self.model.input_shapes[:, 0]
        return np.concatenate([row.ravel(), np.zeros(self.drive.size)])

    def angle(self, frequency_hz: float) -> float:
        """Phase advance of a period, rad."""
        return 2.0 * np.pi

    def along(self, states: Float, inputs: Float, frequency_hz: float) -> Period:
        """Evaluate the model: the residual is the sum of all modal forces."""
        model, basis, n = self.model, self.basis, self.n_states
        w, phi, b = 2.0 * np.pi * frequency_hz, self._system.phi, model.input_shapes
        force, damping, by = self._elements(states, w)
        back = basis.to_coefficients
        turned, twice = (self._turning @ states) * self._own_damping, self._twice @ states
        residual = w**2 * twice + w * turned + states * self._stiffness
        residual += back @ force.T @ phi - inputs @ b.T
        by_w = 2.0 * w * twice + turned
        by_w += back @ (damping.T * (self._to_rate @ states @ phi.T)) @ phi

        residual_by = self._by[0] + w * self._by[1] + w**2 * self._by[2]
        linear = residual_by[..., :n]
        linear += self._between_modes(back @ by)
        if model.support_n_m > 0.0:
            reaction, reaction_by, reaction_by_w = self._support(states @ b[:, 0], w)
            residual += reaction[:, None] * b[:, 0]
            linear += reaction_by[:, None, :, None] * self._driven[:, None, :]
            by_w += reaction_by_w[:, None] * b[:, 0]

        outputs, outputs_by, outputs_by_w = self._outputs(states, inputs, w)
        to_hz = 2.0 * np.pi
        return Period(outputs, residual, outputs_by, residual_by, to_hz * outputs_by_w, to_hz * by_w)

    def _between_modes(self, parts: Float) -> Float:
        """Return what parts of the elements [e, p, q] are in modal coordinates [p, i, q, j], summed over the elements."""
        size, n = self.basis.size, self.n_states
        summed = parts.reshape(len(parts), size * size).T @ self._pairs
        return np.asarray(summed.reshape(size, size, n, n).transpose(0, 2, 1, 3))

    def _elements(self, states: Float, w: float) -> tuple[Float, Float, Float]:
        along = states @ self._system.phi.T
        x, rate = (np.ascontiguousarray((to @ along).T) for to in (self.basis.to_time, w * self._to_rate))
        along_period(self._system, x, rate, self.basis.to_time, w * self._to_rate, self._rows, *self._work)
        return self._work

    def _support(self, displacement: Float, w: float) -> tuple[Float, Float, Float]:
        """Coefficients of the support's reaction to the displacement of the first input, and derivatives by it and by w."""
        model, basis = self.model, self.basis
        h, corner = np.arange(1, basis.harmonics + 1), 2.0 * np.pi * model.support_corner_hz
        low_pass, slope = np.zeros((2, basis.size, basis.size))
        low_pass[0, 0] = self._mean_supported
        stage = np.asarray(1.0 / (1.0 + 1j * h * w / corner), dtype=np.complex128)
        pairs = (2 * h - 1)[:, None] + np.arange(2)
        blocks = pairs[:, :, None], pairs[:, None, :]
        low_pass[blocks] = complex_product(stage**2)
        slope[blocks] = complex_product(-2j * h / corner * stage**3)
        most = model.support_largest_n
        bounded = np.tanh(model.support_n_m / most * (basis.to_time @ low_pass @ displacement))
        stiffness = (basis.to_coefficients * (model.support_n_m * (1.0 - bounded**2))) @ basis.to_time
        return basis.to_coefficients @ (most * bounded), stiffness @ low_pass, stiffness @ slope @ displacement

    def _outputs(self, states: Float, inputs: Float, w: float) -> tuple[Float, Float, Float]:
        """Coefficients of the outputs, and derivatives by those of (x, u) and by w."""
        n, (size, count) = self.n_states, self._outputs_by.shape[:2]
        by = self._outputs_by.copy()
        by[..., :n] = self._motions_by * w ** self._orders[:, None, None]
        moved = (by[..., :n].reshape(size * count, size * n) @ states.ravel()).reshape(size, count)
        return moved + inputs @ self.model.direct.T, by, moved * self._orders / w

    def _at_rest(self, frequency_hz: float) -> Period:
        size = self.basis.size
        return self.along(np.zeros((size, self.n_states)), np.zeros((size, len(self.inputs))), frequency_hz)

    def linear_response(self, frequency_hz: float, row: int) -> tuple[Complex, Complex]:
        """Return modal coordinates and outputs of small vibrations."""
        at, n, count = self._at_rest(frequency_hz), self.n_states, self.state_unknowns
        pushed = -at.residual_by[:, :, 1, n + row].ravel()
        states = np.linalg.solve(at.residual_by[..., :n].reshape(count, count), pushed).reshape(-1, n)
        outputs = np.tensordot(at.outputs_by[..., :n], states, axes=2) + at.outputs_by[:, :, 1, n + row]
        return states[1] - 1j * states[2], outputs[1] - 1j * outputs[2]

    def static(self, inputs: Float) -> Float:
        """Return the displacement under small constant forces."""
        by = self._at_rest(1.0).residual_by[0, :, 0]
        return np.asarray(np.linalg.solve(by[:, : self.n_states], -by[:, self.n_states :] @ inputs))

    def multipliers(self, states: Float, inputs: Float, at: Period, frequency_hz: float) -> Complex:
        """complex[2 n_modes]: multipliers over a period."""
        n, count, w = self.n_states, self.state_unknowns, 2.0 * np.pi * frequency_hz
        stiffness = at.residual_by[..., :n]
        damping = self._elements(states, w)[1]
        parts = np.array([(self.basis.to_coefficients * row) @ self.basis.to_time for row in damping])
        own_damping = np.zeros((self.basis.size, n, self.basis.size, n))
        if len(parts):
            own_damping += self._between_modes(parts)
        for i in range(n):
            own = 2.0 * self.model.damping_ratio[i] * self.model.omega[i]
            own_damping[:, i, :, i] += own * np.eye(self.basis.size) + 2.0 * w * self._turning
        first = np.zeros((2 * count, 2 * count))
        first[:count, count:] = np.eye(count)
        first[count:, :count] = -stiffness.reshape(count, count) / w**2
        first[count:, count:] = -own_damping.reshape(count, count) / w
        values, vectors = np.linalg.eig(first)
        order = by_centroid(vectors[:count].reshape(self.basis.size, n, -1), self.basis)
        return distinct(np.exp(2.0 * np.pi * values[order]), self.order, 1.0)

    def state_use(self, z: Float, to_time: Float) -> Float:
        """float[n_elements]: largest displacement of each element over that in training, or its reach if that is unknown."""
        x = np.abs(to_time @ self.states(z) @ self._system.phi.T)
        return np.asarray(np.max(x, axis=0, initial=0.0) / self._range)

    def input_use(self, inputs: Float, to_time: Float) -> Float:
        """NaN: a structured model does not know the range of its inputs."""
        return np.full(inputs.shape[1], np.nan)


@inner_kernel
def add_slider(
    slider: np.ndarray,
    sliding: float,
    scale: float,
    x: np.ndarray,
    rate: np.ndarray,
    to_time: np.ndarray,
    to_rate: np.ndarray,
    force: np.ndarray,
    damping: np.ndarray,
    by: np.ndarray,
) -> None:
    """Add the force of a slider in the second of two periods that begin at rest, and its derivatives.

    After one period both extremes of x have passed, and the loop is closed. A slider that sticks has moved from where it last
    slipped, sample ``slipped``, or from rest (-1), so that its force changes with ``x(k) - x(slipped)``. That of dry friction
    that depends on the speed (``sliding``, ``scale``: `dry_friction`) is taken times its size over that at rest; ``damping``
    gets its derivative by the rate.
    """
    stiffness, strength = slider[0], slider[1]
    r, last, slipped = 0.0, 0.0, -1
    for repeat in range(2):
        for k in range(x.size):
            _, r, _, sticking = jenkins_step(r, stiffness, strength, x[k] - last)
            last = x[k]
            if sticking < 1.0:
                slipped = k
            if repeat == 0:
                continue
            share = 1.0
            if scale > 0.0:
                size, slope = dry_friction(strength, sliding, scale, abs(rate[k]))
                share = size / strength
                steep = r / strength * (slope if rate[k] >= 0.0 else -slope)
                damping[k] += steep
                for c in range(to_time.shape[1]):
                    by[k, c] += steep * to_rate[k, c]
            force[k] += share * r
            if slipped != k:
                for c in range(to_time.shape[1]):
                    begin = to_time[slipped, c] if slipped >= 0 else 0.0
                    by[k, c] += share * stiffness * (to_time[k, c] - begin)


@inner_kernel
def period_of(
    r: float,
    last: float,
    slider: np.ndarray,
    bend: np.ndarray,
    x: np.ndarray,
    to_time: np.ndarray,
    begin: int,
    own: np.ndarray,
) -> tuple[float, float]:
    """Move a hysteresis through a period from the force ``r`` at the displacement ``last``.

    That is the displacement of the last sample, or 0 if ``begin`` is 0. Return the force at the end and its derivative by
    ``r``; ``own`` gets the derivatives of the end by the coefficients of x, those of ``r`` taken as what is in it at first.
    """
    total, previous = 1.0, x.size - 1
    for k in range(x.size):
        _, r, _, _, by_way, by_r = hysteresis_step(r, slider[0], slider[1], bend[0], bend[1], bend[2], x[k] - last)
        total *= by_r
        for c in range(own.size):
            before = to_time[previous, c] if k + begin > 0 else 0.0
            own[c] = by_r * own[c] + by_way * (to_time[k, c] - before)
        last, previous = x[k], k
    return r, total


@inner_kernel
def add_hysteresis(
    slider: np.ndarray,
    bend: np.ndarray,
    x: np.ndarray,
    to_time: np.ndarray,
    rows: np.ndarray,
    force: np.ndarray,
    by: np.ndarray,
) -> None:
    """Add the force of a hysteresis whose loop is closed, and its derivatives.

    A loop closes in many periods if it is small. The force with which a period ends as it has begun is therefore found by
    Newton's method, from the end of a period that began at rest; a loop of which hardly anything is lost keeps that.
    """
    own, before = rows[0], rows[1]
    own[:] = 0.0
    last = x[x.size - 1]
    r, kept = period_of(0.0, 0.0, slider, bend, x, to_time, 0, own)
    for _ in range(CLOSING):
        before[:] = 0.0
        end, kept = period_of(r, last, slider, bend, x, to_time, 1, before)
        if 1.0 - kept < LOSSLESS:
            break
        change = (end - r) / (1.0 - kept)
        r += change
        for c in range(own.size):
            own[c] = before[c] / (1.0 - kept)
        if abs(change) <= CLOSED * slider[1]:
            break
    previous = x.size - 1
    for k in range(x.size):
        _, r, _, _, by_way, by_r = hysteresis_step(r, slider[0], slider[1], bend[0], bend[1], bend[2], x[k] - last)
        force[k] += r
        for c in range(own.size):
            own[c] = by_r * own[c] + by_way * (to_time[k, c] - to_time[previous, c])
            by[k, c] += own[c]
        last, previous = x[k], k


@unlocked_kernel
def along_period(
    system: System,
    x: np.ndarray,
    rate: np.ndarray,
    to_time: np.ndarray,
    to_rate: np.ndarray,
    rows: np.ndarray,
    force: np.ndarray,
    damping: np.ndarray,
    by: np.ndarray,
) -> None:
    """Write force and damping of every element at all samples of a period, float[n_elements, samples], J and J s.

    ``x`` and ``rate``, float[n_elements, samples], are displacements and their derivatives by time, which ``to_time`` and
    ``to_rate``, float[samples, size], give from Fourier coefficients. ``by``, float[n_elements, samples, size]: derivatives
    of the force by the coefficients of x. ``rows``: work, float[2, size].
    """
    tables = system.tables
    for e in range(x.shape[0]):
        for k in range(x.shape[1]):
            spring, slope, _ = spring_at(x[e, k], tables.springs[e], tables.limits[e])
            damping[e, k], steep = damping_at(x[e, k], tables.dampers[e], tables.limits[e, 0])
            force[e, k] = spring + damping[e, k] * rate[e, k]
            slope += steep * rate[e, k]
            for c in range(to_time.shape[1]):
                by[e, k, c] = slope * to_time[k, c] + damping[e, k] * to_rate[k, c]
        for s in range(tables.first[e], tables.first[e + 1]):
            bend = tables.bends[s]
            if bend[1] <= 0.0:
                scale = bend[2] / system.step_s if bend[1] < 0.0 else 0.0
                add_slider(
                    tables.sliders[s],
                    bend[0],
                    scale,
                    x[e],
                    rate[e],
                    to_time,
                    to_rate,
                    force[e],
                    damping[e],
                    by[e],
                )
            else:
                add_hysteresis(tables.sliders[s], tables.bends[s], x[e], to_time, rows, force[e], by[e])
