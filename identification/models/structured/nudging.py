"""Simulations that are nudged to the measured motion, and the static force of the unseen support meanwhile.

A lightly damped model with wrong numbers soon moves in another phase, or on another branch, than the measurement, and the sum
of squares of a fit has many minima. With a force ``rate (measured velocity - velocity)`` on every mode it cannot: its memory is
as short as ``1 / rate``. A fit begins with a fast rate and ends without any.

Force sensors without response at 0 Hz show all of a periodic force but its mean. The exciter's suspension makes that mean, by
the mean displacement of the drive point. A filter that tells the mean from the lowest line of a long period would take many
periods to settle. The force is therefore held over a period, by the mean displacement of the one before: the mean over exactly
one period contains no line, and is known at its end.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from identification.channels import MOTION_ORDER
from identification.experiments.experiment import Experiment
from identification.models.structured.steps import System, nudged
from vibrolock.arrays import Complex, Float

LOWEST = 0.2
"""Lines below this share of the first frequency are left out: sensors of acceleration do not show such motion."""

_SETTLED, _LONGEST = 1e-2, 8
"""Share of the led motion's error that is left when a simulation counts, and most periods that this may take."""


class Modal(Protocol):
    """What is needed of a model."""

    @property
    def omega(self) -> Float:
        """float[n_modes], rad/s."""

    @property
    def input_shapes(self) -> Float:
        """float[n_modes, n_inputs]."""

    @property
    def output_shapes(self) -> Float:
        """float[n_outputs, n_modes]."""


def modal_spectra(linear: Modal, experiment: Experiment, modes: int) -> tuple[Complex, Complex, Float]:
    """Amplitudes (of the FFT over its length) of modal coordinates and input of the mean period, and frequencies in rad/s."""
    n = experiment.period_samples
    inputs, outputs = (
        np.fft.rfft(values.reshape(len(values), -1, n).mean(axis=1), axis=1) / n
        for values in (experiment.counted_inputs, experiment.counted_outputs)
    )
    omega = 2.0 * np.pi * np.fft.rfftfreq(n, 1.0 / experiment.sample_rate_hz)
    moving = np.zeros_like(outputs)
    moving[:, 1:] = [
        row[1:] / (1j * omega[1:]) ** MOTION_ORDER[channel.motion]
        for row, channel in zip(outputs, experiment.output_channels, strict=True)
    ]
    above = slice(modes, None)
    residual = linear.output_shapes[:, above] @ (linear.input_shapes[above] / linear.omega[above, None] ** 2)
    moving = moving - residual @ inputs
    q = np.linalg.pinv(linear.output_shapes[:, :modes]) @ moving
    q[:, omega < LOWEST * linear.omega[0]] = 0.0
    return q, inputs, np.asarray(omega, dtype=np.float64)


def measured_velocity(linear: Modal, experiment: Experiment, measured_modes: int) -> Float:
    """float[n_modes, n]: modal velocities of a periodic experiment in all its samples; zero for modes that are not measured."""
    q, _, omega = modal_spectra(linear, experiment, measured_modes)
    n = experiment.period_samples
    period = np.fft.irfft(1j * omega * q, n, axis=1) * n
    samples = (np.arange(experiment.inputs.shape[1]) - experiment.counted_from) % n
    velocity = np.zeros((len(linear.omega), samples.size))
    velocity[:measured_modes] = period[:, samples]
    return velocity


def settling_periods(experiment: Experiment, rate: float) -> int:
    """Periods in which a motion that decays with ``rate`` (rad/s) falls to `_SETTLED`."""
    seconds = experiment.period_samples / experiment.sample_rate_hz
    return min(int(np.ceil(np.log(1.0 / _SETTLED) / (rate * seconds))), _LONGEST)


def with_lead_in_periods(experiment: Experiment, periods: int) -> Experiment:
    """Return an experiment with more periods before those that count."""
    if not periods:
        return experiment
    inputs, outputs = (
        np.concatenate(
            [values[:, : experiment.counted_from], np.tile(one, periods), values[:, experiment.counted_from :]], axis=1
        )
        for values, one in (
            (experiment.inputs, experiment.counted_inputs[:, : experiment.period_samples]),
            (experiment.outputs, experiment.counted_outputs[:, : experiment.period_samples]),
        )
    )
    begins = experiment.counted_from + periods * experiment.period_samples
    return replace(experiment, inputs=inputs, outputs=outputs, counted_from=begins)


_RATIO = 0.05
"""Damping ratio of the nudging forces before the samples that count. Chosen."""
_WINDOW = ("kaiser", 8.0)
"""Window of the filter that gives the inputs between samples. Chosen."""


@dataclass(frozen=True, eq=False)
class Nudging:
    """Forces that nudge the modes."""

    before: Float
    rate: Float
    """float[n_modes], rates up to sample ``until`` and from there on, rad/s; 0 for a mode that is not nudged."""
    signals: Float
    """float[n_inputs + n_modes, n], inputs and measured modal velocities."""
    steps: int
    """Steps in a sample."""
    until: int
    """Number of samples that are nudged at the rate ``before``."""
    period: int
    """Samples of a period. Periods begin at ``until``."""

    @classmethod
    def of(cls, model: Modal, experiment: Experiment, measured: int, ratio: float, steps: int, until: int) -> "Nudging":
        """Return forces on the ``measured`` first modes in a periodic experiment, with a damping ratio from ``until`` on."""
        double = 2.0 * model.omega * (np.arange(len(model.omega)) < measured)
        signals = np.vstack([experiment.inputs, measured_velocity(model, experiment, measured)])
        return cls(_RATIO * double, ratio * double, signals, steps, until, experiment.period_samples)

    @cached_property
    def ends(self) -> Float:
        """float[n steps + 1, n_inputs + n_modes], the signals at the ends of all steps."""
        return ends_of_steps(self.signals, self.steps)

    def stretches(self, system: System) -> list[tuple[System, int, int]]:
        """Return the system that is nudged, and first and last sample, of every period or part of one."""
        systems = [frozen_support(nudged(system, self.before)), frozen_support(nudged(system, self.rate))]
        ends = zip(systems, (0, self.until), (self.until, self.signals.shape[1]), strict=True)
        return [(one, *at) for one, a, b in ends for at in periods_of(a, b, self.until, self.period)]


def not_led(derivatives: Float, system: System, rate: Float) -> Float:
    """Return derivatives ``[..., P]`` by omega at the damping ratios of the system that is not nudged.

    At a given damping ratio of its own, the damping ratio of the nudged mode falls with its frequency.
    """
    n, own = len(rate), derivatives.copy()
    own[..., :n] -= derivatives[..., n : 2 * n] * (0.5 * rate / system.omega**2)
    return np.asarray(own)


def frozen_support(system: System) -> System:
    """Return the system with a support whose force is held."""
    return system._replace(support=system.support * np.array([1.0, 0.0, 1.0]))


def periods_of(first: int, last: int, begin: int, period: int) -> Iterator[tuple[int, int]]:
    """Yield the stretches of samples ``first`` to ``last`` between the beginnings of periods, one of which is ``begin``."""
    while first < last:
        end = min(first + period - (first - begin) % period, last)
        yield first, end
        first = end


def update_support(system: System, length_s: float, state: Float, sens: Float | None = None) -> None:
    """Hold the force at the mean displacement over the last ``length_s``, and begin with the next mean.

    The mean m was measured while the force was that of the displacement z. A linear structure at the mean z' would move by
    ``c k (z' - z)`` less, with the static compliance c at the input and the stiffness k of the support. So
    ``z' = (m + c k z)/(1 + c k)`` is the mean displacement with its own force; a nonlinear structure takes some periods.

    ``length_s``: time since the last call. ``state``, float[`System.size`], of a system with `frozen_support`, and its
    derivatives ``sens``, float[`System.size`, P] (`run_with_sensitivities`), are changed.
    """
    n, inputs, stiffness = len(system.omega), system.inputs, float(system.support[0])
    b, omega = system.b[:, 0], system.omega
    compliance = float(np.sum((b / omega) ** 2))
    coupling, before = compliance * stiffness, float(state[2 * n])
    state[2 * n] = (state[-1] / length_s + coupling * before) / (1.0 + coupling)
    state[-1] = 0.0
    if sens is None:
        return
    by = np.zeros(sens.shape[1])
    by[:n] = -2.0 * stiffness * b**2 / omega**3
    by[2 * n : 2 * n + n * inputs : inputs] = 2.0 * stiffness * b / omega**2
    by[-1] = compliance
    sens[2 * n] = (sens[-1] / length_s + coupling * sens[2 * n] + (before - state[2 * n]) * by) / (1.0 + coupling)
    sens[-1] = 0.0


def ends_of_steps(inputs: Float | Sequence[Sequence[float]], steps: int) -> Float:
    """float[n steps + 1, n_inputs]: inputs between the samples, without what lies above half the sample rate."""
    from scipy.signal import resample_poly  # only on use: it takes a second to load

    u = np.asarray(inputs, dtype=np.float64)
    ends = u if steps == 1 else resample_poly(u, steps, 1, axis=1, window=_WINDOW, padtype="line")
    return np.ascontiguousarray(np.concatenate([ends, ends[:, -1:]], axis=1).T)
