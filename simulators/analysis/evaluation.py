"""Responses of the rig from solutions of its harmonic balance."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from simulators.analysis.balance import Balance, Solution
from simulators.analysis.condensed import CondensedStructure
from simulators.analysis.responses import PeriodicResponses
from simulators.analysis.site_forces import Series
from simulators.layout import Flag
from simulators.virtual_rig import VirtualRig
from vibrolock.arrays import Complex, Float


class Evaluation:
    """Converts solutions of a balance to `PeriodicResponses`; modal quantities refer to the linear mode ``mode`` (from 0)."""

    def __init__(self, rig: VirtualRig, balance: Balance, mode: int) -> None:
        self.rig, self.balance, self.mode = rig, balance, mode
        self.points = rig.structure.points
        self.rows = np.array(
            [
                rig.plant.force_row(),
                rig.plant.displacement_row(rig.shape(rig.stinger.at)),
                *(rig.output_row(sensor) for sensor in rig.sensors),
                *(rig.plant.displacement_row(rig.shape(at)) for at in self.points),
            ]
        )

    def __call__(self, solutions: Sequence[Solution]) -> PeriodicResponses:
        """Return one point per solution (at least one), in the order of the solutions."""
        omega, voltage = np.array([solution.unknowns[-2:] for solution in solutions]).T
        imposed = isinstance(self.balance.linear, CondensedStructure)
        coordinates, inputs, outputs, neglected, beyond = zip(*(self._point(one) for one in solutions), strict=True)
        voltages = None if imposed else np.array(inputs)[:, -1]
        if imposed:
            voltage = np.full(voltage.size, np.nan)
        harmonics = np.transpose(np.array(outputs), (1, 0, 2))
        sensors, points = harmonics[2 : 2 + len(self.rig.sensors)], harmonics[2 + len(self.rig.sensors) :]
        flags = self._flags(np.array(beyond), voltages, sensors)
        return PeriodicResponses(
            frequency_hz=omega / (2.0 * np.pi),
            voltage_v=voltage,
            **self._modal(omega, harmonics[0], harmonics[1]),
            force_harmonics_n=harmonics[0],
            drive_harmonics_m=harmonics[1],
            sensor_harmonics=dict(zip(self.rig.channel_names, sensors, strict=True)),
            point_harmonics_m=dict(zip(self.points, points, strict=True)),
            site_harmonics=np.array(coordinates),
            site_force_harmonics=np.array(inputs)[:, :-1],
            neglected_share=np.array(neglected),
            flags=flags,
            voltage_harmonics_v=voltages,
            stable=np.array([one.stable() for one in solutions]),
            stable_under_voltage=None if imposed else np.array([one.stable(under_voltage=True) for one in solutions]),
            level_slope=None if imposed else np.array([one.held_by_voltage() for one in solutions]),
        )

    def _point(self, solution: Solution) -> tuple[Complex, Complex, Complex, float, bool]:
        """Return site coordinates, inputs and outputs of one point, the neglected share, and whether a site is beyond.

        The inputs are those of `Balance.inputs`. A site is beyond if it leaves the range in which its law holds.
        """
        balance, series = self.balance, self.balance.series
        omega = solution.unknowns[-2]
        coefficients = balance.coefficients(solution.unknowns)
        waves = balance.sites(series, coefficients)
        inputs = balance.inputs(solution.unknowns, waves)
        states = balance.linear.states(omega, inputs)
        outputs = self.rows @ np.vstack([states.T, inputs[-1:], inputs[:-1]])
        neglected = self._neglected(omega, waves.forces) / abs(outputs[0, 1])
        return series.to_complex(coefficients), inputs, outputs, neglected, waves.beyond

    def _neglected(self, omega: float, forces: Float) -> float:
        """Return the RMS over harmonics H + 1 to 2 H + 1 of the stinger force (N) that the sites' forces cause."""
        series = self.balance.series
        above = np.arange(series.harmonics + 1, 2 * series.harmonics + 2)
        spectrum = np.fft.rfft(forces, axis=1)[:, above] * (2.0 / series.samples)
        transfer = self.balance.linear.transfer(omega, above)[0][:, self.balance.n_site, :-1]
        return float(np.linalg.norm(np.einsum("hi,ih->h", transfer, spectrum)))

    def _modal(self, omega: Float, force: Complex, drive: Complex) -> dict[str, Float]:
        """Return fundamentals, modal frequency and damping of every point; conventions of `PeriodicResponses`."""
        shape = float(self.rig.linear_modes.drive_shape[self.mode])
        amplitude = np.abs(drive[:, 1])
        q = amplitude / shape
        # phi_d F / Q = w^2 - W^2 + 2 i W w z, Q = X_d / phi_d.
        modal = np.sqrt(np.maximum(omega**2 + np.real(shape**2 * force[:, 1] / drive[:, 1]), 0.0))
        speeds = 1j * np.outer(omega, np.arange(force.shape[1])) * drive
        powers = 0.5 * np.real(force * np.conj(speeds))
        scale = omega**2 * modal * q**2
        with np.errstate(divide="ignore", invalid="ignore"):
            fundamental, total = powers[:, 1] / scale, powers[:, 1:].sum(axis=1) / scale
        real = modal > 0.0
        return {
            "force_n": np.abs(force[:, 1]),
            "amplitude_m": amplitude,
            "phase_lag_deg": np.degrees(np.angle(-force[:, 1] / drive[:, 1])),
            "modal_frequency_hz": np.where(real, modal, np.nan) / (2.0 * np.pi),
            "modal_amplitude": q,
            "damping_ratio": np.where(real, fundamental, np.nan),
            "damping_ratio_total_power": np.where(real, total, np.nan),
        }

    def _flags(self, beyond: NDArray[np.bool_], voltages: Complex | None, sensors: Complex) -> NDArray[np.int64]:
        rig, series = self.rig, Series(self.balance.series.harmonics, 128)
        converter = rig.converter
        flags = np.where(beyond, int(Flag.LAW_RANGE), 0)
        if voltages is not None:
            voltage = np.max(np.abs(series.waveforms(voltages)), axis=1)
            flags |= np.where(voltage > converter.dac_range_v, int(Flag.DAC_CLIPPED), 0)
            flags |= np.where(voltage > rig.exciter.input_limit_v, int(Flag.AMPLIFIER_CLIPPED), 0)
        for sensor, harmonics in zip(rig.sensors, sensors, strict=True):
            peak_v = np.max(np.abs(series.waveforms(harmonics)), axis=1) * sensor.sensitivity_v_per_unit
            clipped = peak_v > min(sensor.range_v, converter.adc_range_v)
            flags |= np.where(clipped, int(Flag.SENSOR_CLIPPED), 0)
        return flags.astype(np.int64)
