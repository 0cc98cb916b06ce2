"""Harmonic balance of the rig of a subject, with errors of the simulators as errors of configuration."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rig.analysis.subject import Subject
from rig.errors import ConfigurationError
from simulators.analysis import PeriodicResponses, constant_force_response, forced_response, phase_resonance_backbone
from vibrolock.arrays import Float


@dataclass(frozen=True, eq=False)
class Balance:
    """Harmonic balance near the mode under test.

    Every method raises `ConfigurationError` for values that are not allowed, and `NotConvergedError` where no vibration is
    found.
    """

    subject: Subject
    """The rig."""
    harmonics: int
    """Number of harmonics."""

    @property
    def samples(self) -> int:
        """Samples per period for the nonlinear forces: 512 up to 15 harmonics, then in proportion."""
        return max(512, 32 * (self.harmonics + 1))

    def backbone(self, *, forces_n: Float | None = None, voltages_v: Float | None = None) -> PeriodicResponses:
        """Return the vibrations at phase resonance over levels of force or voltage."""
        with configuration_errors():
            return phase_resonance_backbone(
                self.subject.rig,
                forces_n=forces_n,
                voltages_v=voltages_v,
                near_hz=self.subject.near_hz,
                harmonics=self.harmonics,
                samples=self.samples,
            )

    def constant_force(self, force_n: float, lags_deg: Float) -> PeriodicResponses:
        """Return the vibrations at a force over phase lags."""
        rig, near_hz = self.subject.rig, self.subject.near_hz
        with configuration_errors():
            return constant_force_response(
                rig, force_n, lags_deg, near_hz=near_hz, harmonics=self.harmonics, samples=self.samples
            )

    def forced(self, voltage_v: float, grid_hz: Float) -> PeriodicResponses:
        """Return the vibrations at a voltage, followed in the order of the frequencies."""
        rig, near_hz = self.subject.rig, self.subject.near_hz
        with configuration_errors():
            return forced_response(
                rig, voltage_v, grid_hz, near_hz=near_hz, harmonics=self.harmonics, samples=self.samples
            )


@contextmanager
def configuration_errors() -> Iterator[None]:
    """Convert a `ValueError` of the simulators to a `ConfigurationError`."""
    try:
        yield
    except ValueError as error:
        raise ConfigurationError.of(error) from error
