"""The phase-locked loop: all settings of a law that controls the frequency."""

import math
from typing import Self

import numpy as np
from pydantic import model_validator

from controller.amplitude import AmplitudeLaw, AmplitudeSettings
from controller.delay import LARGEST_TURN_DEG, highest_crossover_rad_s, longest_delay_s
from controller.detector import DetectorSettings
from controller.frequency import GAINS, FrequencySettings
from controller.law import LawSettings
from controller.lock import LockRule
from controller.rest import RestSettings
from vibrolock.errors import InputError


class PhaseLockedLoop(LawSettings, FrequencySettings, RestSettings, DetectorSettings, AmplitudeSettings):
    """Gains and bounds of the loop; `build` turns them into the record that the kernels read."""

    lock: LockRule = LockRule()
    """When a lock counts as gained and as lost."""

    @model_validator(mode="after")
    def _detector_suffices(self) -> Self:
        if self.detector == "sign" and self.phase_lag_deg != -90.0:
            reason = "the sign detector knows phase resonance only"
            raise InputError(reason, field="phase_lag_deg", value=self.phase_lag_deg, allowed="-90")
        if self.detector == "sign" and self.frequency_law == "frequency-error":
            reason = "the frequency-error law needs amplitudes"
            raise InputError(reason, field="detector", value="sign", allowed="two-phase or adaptive")
        return self

    @property
    def highest_frequency_hz(self) -> float:
        """Highest frequency of the window, Hz."""
        return self.frequency_window_hz[1]

    def proportional_and_integral(self) -> tuple[float, float]:
        """Return ``(kp, ki)`` of the PI law.

        The units are 1/s and 1/s^2 for a phase error in rad, and 1 and 1/s for a frequency error in rad/s.
        """
        if self.detector == "sign":  # the phase law alone works with it, in the paper's own parameters
            kp = 2.0 / math.pi * self.k2 / self.low_pass_rad_s
            return kp, self.k1 * kp
        kp, ki = (float(getattr(self, name)) for name in GAINS[self.frequency_law])
        return kp, ki

    def check_delay(self, delay_s: float, amplitude_law: AmplitudeLaw) -> None:
        """Raise ValueError if gains do not bear ``delay_s`` from an output to the input that shows it; the plant is unknown.

        The rule: `controller.delay`. The paper's linear force loop has gains in V/N and is not judged without a plant.
        """
        for names, crossover in self._crossovers(amplitude_law):
            longest_s = longest_delay_s(crossover)
            if delay_s > longest_s:
                given = ", ".join(f"{name} = {getattr(self, name):g}" for name in names)
                raise InputError(
                    f"{1000.0 * delay_s:.3g} ms from output to input may take "
                    f"{math.degrees(delay_s * crossover):.0f} deg of its phase at {crossover:.3g} rad/s",
                    field=given,
                    allowed=f"{LARGEST_TURN_DEG:g} deg, which is up to {1000.0 * longest_s:.3g} ms, or smaller gains",
                )

    def longest_delay_s(self, amplitude_law: AmplitudeLaw) -> float:
        """Return the longest delay that `check_delay` allows, s."""
        return min(longest_delay_s(crossover) for _, crossover in self._crossovers(amplitude_law))

    def _crossovers(self, amplitude_law: AmplitudeLaw) -> list[tuple[tuple[str, ...], float]]:
        """Return, for each loop, the settings that are its gains, and its highest crossover, rad/s."""
        return [
            (names, highest_crossover_rad_s(*gains, self.low_pass_rad_s, integrates=integrates))
            for names, gains, integrates in self._judged_gains(amplitude_law)
        ]

    def gain_names(self, amplitude_law: AmplitudeLaw) -> tuple[str, ...]:
        """Return the settings that are gains of the loops in use."""
        return tuple(name for names, _, _ in self._judged_gains(amplitude_law) for name in names)

    def _judged_gains(self, amplitude_law: AmplitudeLaw) -> list[tuple[tuple[str, ...], tuple[float, float], bool]]:
        """Return, for each loop, the settings that are its gains, ``(kp, ki)``, and whether its plant integrates."""
        phase = self.frequency_law == "phase"
        out: list[tuple[tuple[str, ...], tuple[float, float], bool]] = [
            (GAINS[self.frequency_law], self.proportional_and_integral(), phase)
        ]
        force = amplitude_law in (AmplitudeLaw.FORCE, AmplitudeLaw.FORCE_RMS)
        if force and self.force_loop == "logarithmic":
            names = "force_proportional", "force_integral_per_s"
            out.append((names, (self.force_proportional, self.force_integral_per_s), False))
        if amplitude_law is AmplitudeLaw.RESPONSE or (force and self.force_loop == "through-response"):
            out.append((("response_integral_per_s",), (0.0, self.response_integral_per_s), False))
        return out

    def build_feedback(self, out: np.ndarray, sample_rate_hz: float, drive_mode_shape: float | None) -> None:
        """Write the parameters of lock, frequency law and estimator of the rest into a record of `controller.law.LAW`."""
        shape = self.drive_mode_shape or drive_mode_shape
        out["frequency"] = self.build_frequency(sample_rate_hz, shape, self.proportional_and_integral())
        out["rest"] = self.build_rest(sample_rate_hz, shape)
        out["lock"] = self.lock.build()
