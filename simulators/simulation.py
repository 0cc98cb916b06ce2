"""A virtual rig driven with a given voltage, for those who want time series and nothing else."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simulators.layout import Flag, RigArrays, RigState
from simulators.plant.compilation import pad
from simulators.stepping import run_observed
from simulators.virtual_rig import VirtualRig
from vibrolock.errors import InputError


@dataclass(frozen=True, eq=False)
class TimeSeries:
    """What a simulation gives, one entry per sample."""

    time_s: NDArray[np.float64]
    """Instants [n]."""
    voltage_v: NDArray[np.float64]
    """Voltage asked for, on the converter from each instant to the next [n]."""
    measured: dict[str, NDArray[np.float64]]
    """Channels as a test sees them, in N and m/s^2: sensor, noise and converter included."""
    force_n: NDArray[np.float64]
    """True stinger force."""
    displacement_m: dict[str, NDArray[np.float64]]
    """True displacement of every named point that a sensor, an element or the stinger sits on."""
    flags: NDArray[np.int64]
    """`Flag` bits of each sample."""

    @property
    def flag(self) -> Flag:
        """All flags, or-ed."""
        return Flag(int(np.bitwise_or.reduce(self.flags)))


class Simulation:
    """A run of a virtual rig that can be continued: each call of `run` starts where the last one ended."""

    def __init__(self, rig: VirtualRig, *, seed: int | None = None) -> None:
        self.rig = rig
        self.arrays: RigArrays
        self.state: RigState
        self._realised = rig.realised(seed)
        self.arrays, self.state = self._realised.build(seed)
        self._points = tuple(dict.fromkeys(_points(rig)))
        rows = [rig.plant.force_row(), *(rig.plant.displacement_row(rig.shape(at)) for at in self._points)]
        self._observe = pad(np.array(rows).T)

    def run(self, voltages: ArrayLike) -> TimeSeries:
        """Drive with ``voltages`` [n] (V), one per sample; `ValueError` where they are not one row of numbers."""
        voltage_v = np.ascontiguousarray(voltages, dtype=np.float64)
        if voltage_v.ndim != 1 or voltage_v.size == 0:
            raise InputError(f"shape {voltage_v.shape}", field="voltages", allowed="one row of at least one number")
        first = int(self.state.counter[0])
        readings_v = np.empty((voltage_v.size, len(self.rig.sensors)))
        truth = np.empty((voltage_v.size, self._observe.shape[1]))
        flags = np.empty(voltage_v.size, np.int64)
        for arrays, part in self._realised.pieces(self.arrays, first, voltage_v.size):
            self.arrays = arrays
            run_observed(
                self.arrays, self.state, self._observe, voltage_v[part], readings_v[part], truth[part], flags[part]
            )
        measured = (readings_v / self.rig.sensitivities_v_per_unit).T
        return TimeSeries(
            time_s=(first + np.arange(voltage_v.size)) / self.rig.converter.sample_rate_hz,
            voltage_v=voltage_v,
            measured=dict(zip(self.rig.channel_names, measured, strict=True)),
            force_n=truth[:, 0],
            displacement_m={at: truth[:, 1 + k] for k, at in enumerate(self._points)},
            flags=flags,
        )


def _points(rig: VirtualRig) -> Sequence[str]:
    return [
        rig.stinger.at,
        *(point for element in rig.elements for point in (element.at, element.to) if point is not None),
        *(sensor.at for sensor in rig.sensors if sensor.at is not None),
    ]
