"""Subject of an analysis: the virtual rig behind a bench, the mode under test, and the limits of the bench."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.analysis.plausible_sizes import implausible_sizes
from rig.bench import Bench, load_bench
from rig.drivers.virtual import VirtualDAQ
from rig.errors import ConfigurationError
from simulators import VirtualRig
from simulators.analysis import PeriodicResponses
from simulators.kernels import Flag
from vibrolock.arrays import Float

_TOLERANCE = 1.0 + 1e-6  # factor by which a value may exceed a limit; chosen: rounding errors of harmonic balance

_FLAG_WORDS = {
    Flag.LAW_RANGE: "a magnet or the force factor is beyond the range in which its law holds",
    Flag.SENSOR_CLIPPED: "a sensor would clip",
    Flag.DAC_CLIPPED: "the voltage is beyond the output converter",
}


@dataclass(frozen=True, eq=False)
class LimitedQuantity:
    """A quantity that the bench limits, with its values over the points of an analysis."""

    name: str
    values: Float
    """Largest value at each point [n]."""
    limit: float
    unit: str
    whose: str = "the bench's"


@dataclass(frozen=True, eq=False)
class Subject:
    """A bench and its virtual rig. If the rig has scatter, the nominal rig is used."""

    bench: Bench
    rig: VirtualRig
    remarks: tuple[str, ...]
    near_hz: float
    """The linear mode nearest to this frequency is the one under test."""

    @cached_property
    def mode(self) -> int:
        """Index of the mode under test among the linear modes of the structure."""
        return self.rig.linear_modes.nearest(self.near_hz)

    @property
    def frequency_hz(self) -> float:
        """Linear frequency of the mode under test, Hz."""
        return float(self.rig.linear_modes.frequency_hz[self.mode])

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks that apply to every analysis of this bench."""
        scatter = ("the specimen scatters from run to run or by assembly; this is the nominal one, without scatter",)
        wear = ("the specimen wears within a run; this is the one that a run begins with",)
        sizes = implausible_sizes(self.rig, self.frequency_hz, self.bench.sample_rate_hz)
        return (*(scatter if self.rig.scatters else ()), *(wear if self.rig.wear.wears else ()), *sizes, *self.remarks)

    def limited_quantities(self, responses: PeriodicResponses) -> list[LimitedQuantity]:
        """Return the limited quantities at the points, with their limits."""
        limits, omega = self.bench.limits, 2.0 * np.pi * responses.frequency_hz
        moving = [
            responses.sensor_harmonics[channel.name]
            for channel in self.bench.channels
            if channel.role in ("drive", "response")
        ]
        peaks = np.max([peak(harmonics) for harmonics in moving], axis=0)
        travel = np.max([np.abs(harmonics[:, 1]) / omega**2 for harmonics in moving], axis=0)
        return [
            LimitedQuantity("voltage", responses.voltage_v, limits.voltage_v, "V"),
            LimitedQuantity("voltage", responses.voltage_v, self.rig.exciter.input_limit_v, "V", "the amplifier's"),
            LimitedQuantity("force", peak(responses.force_harmonics_n), limits.force_n, "N"),
            LimitedQuantity("acceleration", peaks, limits.acceleration_m_s2, "m/s^2"),
            LimitedQuantity("displacement", travel, limits.displacement_m, "m"),
        ]

    def within(self, responses: PeriodicResponses) -> NDArray[np.bool_]:
        """Return which points [n] lie within the limits and raise no flag."""
        inside = [quantity.values <= _TOLERANCE * quantity.limit for quantity in self.limited_quantities(responses)]
        low, high = self.bench.limits.frequency_hz
        frequency = (responses.frequency_hz >= low) & (responses.frequency_hz <= high)
        return np.asarray(np.all(inside, axis=0) & frequency & (responses.flags == 0))

    def limit_violations(self, responses: PeriodicResponses, of: str = "points") -> tuple[str, ...]:
        """Describe where points leave the valid range of the rig or the limits of the bench, one line each."""
        total = responses.frequency_hz.size
        lines = [
            f"{text} in {count} of {total} {of}"
            for flag, text in _FLAG_WORDS.items()
            if (count := int(np.count_nonzero(responses.flags & int(flag))))
        ]
        for quantity in self.limited_quantities(responses):
            if count := int(np.count_nonzero(quantity.values > _TOLERANCE * quantity.limit)):
                lines.append(
                    f"{quantity.name} reaches {np.max(quantity.values):.4g} {quantity.unit} and is in {count} of {total} {of} "
                    f"above {quantity.whose} limit of {quantity.limit:g} {quantity.unit}"
                )
        return tuple(lines)


def subject_of(bench: Bench | str | Path, near_hz: float | None = None) -> Subject:
    """Return the virtual rig of a bench, which is given as an object, by name or as a TOML file.

    The mode under test is the one nearest to ``near_hz``, by default to the linear frequency that the bench states. Raises
    `ConfigurationError` for a bench that is not allowed or whose driver is not the virtual one.
    """
    loaded = bench if isinstance(bench, Bench) else load_bench(bench)
    if loaded.driver.name != "virtual":
        raise ConfigurationError(
            f"driver.name = {loaded.driver.name!r} in bench {loaded.name}: allowed is 'virtual', nothing else can be analysed"
        )
    daq = VirtualDAQ(loaded)
    near = loaded.specimen.linear_frequency_hz if near_hz is None else positive("near_hz", near_hz)
    remarks = tuple(line for line in daq.remarks if line.startswith("specimen.") and near_hz is None)
    return Subject(loaded, daq.rig, remarks, near)


def positive(name: str, value: float) -> float:
    """Return ``value`` if it is a finite number above zero; raise `ConfigurationError` otherwise."""
    ConfigurationError.raise_if(not 0.0 < value < np.inf, field=name, value=value, allowed="a number above 0")
    return value


def peak(harmonics: NDArray[np.complex128], samples: int = 256) -> Float:
    """Return the largest absolute value over a period [n] of signals with harmonics [n, H + 1]."""
    theta = 2.0 * np.pi * np.arange(samples) / samples
    waves = np.exp(1j * np.outer(np.arange(harmonics.shape[1]), theta))
    return np.asarray(np.max(np.abs(np.einsum("nh,ht->nt", harmonics, waves).real), axis=1))
