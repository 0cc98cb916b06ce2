"""Modal coordinates of a measured steady vibration, from the spectra of its outputs."""

from dataclasses import replace
from typing import Protocol

import numpy as np

from identification.channels import MOTION_ORDER
from identification.experiments.experiment import Experiment
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


def prolonged(experiment: Experiment, periods: int) -> Experiment:
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
