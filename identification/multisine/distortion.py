"""Levels of nonlinear distortion: from detection lines, odd and even apart, and from the scatter over realisations.

Pintelon and Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., section 4.3. The distortion of a
channel is what its best linear approximation G from the input leaves, ``E = Y - G X``, less the power of the noise. At
detection lines G is interpolated between the excited ones on either side.

With the voltage as input, X is zero at the detection lines and E is all that the *rig* distorts, exciter and structure: a
force that is distorted by the structure's own motion shows as distortion of the force and, through the structure, of every
response. With the force as input, what the force has at the detection lines is taken out of the responses to first order,
``Y - G F``: what is left is the *structure's* own distortion under the force it got. The interpolation limits that where
lines are as far apart as a resonance is wide.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from identification.channels import Channel, find_name
from identification.errors import IdentificationError
from identification.multisine.best_linear_approximation import best_linear_approximation
from identification.multisine.spectra import PeriodicSpectra

__all__ = ["DistortionLevels", "Lines", "distortion_levels"]

Bool = NDArray[np.bool_]
Complex = NDArray[np.complex128]
Float = NDArray[np.float64]
Lines = Literal["excited", "odd", "even"]

_OTHER_DESIGN = 0.1  # amplitude of the instrument at detection lines against the excited ones


@dataclass(frozen=True, eq=False, kw_only=True)
class DistortionLevels:
    """Power of signal, distortion and noise of every channel at every line of the band.

    Powers are mean squares of peak amplitudes in the mean over periods of one realisation, in the square of the channel's
    unit. Those of the distortion have the noise's subtracted and are below zero where chance made it so: average first,
    take roots later, as `amplitude` and `ratio` do.

    Parameters
    ----------
    channels
        All but the input.
    input
        Name of the input, ``voltage`` (distortion of the rig) or a force (distortion of the structure).
    frequency_hz
        float[n_lines], every line of the band.
    excited, even
        bool[n_lines], whether a line is excited, and whether it is an even multiple of the resolution.
    signal, distortion, noise
        float[n_channels, n_lines]; ``distortion`` of excited lines is NaN with one realisation.
    """

    channels: tuple[Channel, ...]
    input: str
    frequency_hz: Float
    excited: Bool
    even: Bool
    signal: Float
    distortion: Float
    noise: Float

    def select(self, lines: Lines) -> Bool:
        """bool[n_lines]: the excited lines, or the ``odd`` or ``even`` detection lines."""
        if lines not in get_args(Lines):
            raise IdentificationError(f"lines: is '{lines}', allowed are {', '.join(get_args(Lines))}")
        return self.excited if lines == "excited" else ~self.excited & (self.even == (lines == "even"))

    def amplitude(self, channel: str, lines: Lines) -> tuple[Float, Float]:
        """float[n], float[n]: frequency of the lines, and peak amplitude of the distortion there (0 if not above noise)."""
        chosen = self.select(lines)
        power = self.distortion[find_name(self.channels, channel), chosen]
        return self.frequency_hz[chosen], np.sqrt(np.maximum(power, 0.0))

    def ratio(self, channel: str, lines: Lines, *, lowest_hz: float = 0.0, highest_hz: float = np.inf) -> float:
        """Distortion of a line against the signal of an excited line, root of the mean powers in a band, 0 to about 1.

        NaN where there are no such lines, or distortion is unknown.
        """
        row = find_name(self.channels, channel)
        band = (self.frequency_hz >= lowest_hz) & (self.frequency_hz <= highest_hz)
        chosen, excited = self.select(lines) & band, self.excited & band
        if not chosen.any() or not excited.any():
            return float("nan")
        power = self.distortion[row, chosen].mean() / self.signal[row, excited].mean()
        return float(np.sqrt(power if np.isnan(power) else max(power, 0.0)))


def distortion_levels(
    spectra: PeriodicSpectra, *, input: str = "voltage", instruments: Sequence[str] = ("voltage",)
) -> DistortionLevels:
    """Distortion of every channel but ``input``, by what is linear in the input; see the module for the choice of input.

    Raises
    ------
    IdentificationError
        With one period (noise is unknown), where the instrument has more than a tenth of its amplitude at lines that the
        design does not excite, and as `best_linear_approximation` does.
    """
    realisations, periods = spectra.spectra.shape[:2]
    if periods < 2:
        raise IdentificationError("periods: is 1, needs 2 or more to tell noise from distortion")
    _check_silence(spectra, instruments)
    outputs = [channel.name for channel in spectra.channels if channel.name not in {input, *instruments}]
    rows = [spectra.index(name) for name in outputs]
    found = best_linear_approximation(spectra, outputs=outputs, inputs=(input,), instruments=instruments)
    linear = _interpolated(spectra.frequency_hz, found.frequency_hz, found.value[:, :, 0].T)
    error = spectra.spectra[:, :, rows] - linear * spectra.spectra[:, :, [spectra.index(input)]]
    means = error.mean(axis=1)
    noise = np.sum(np.abs(error - means[:, None]) ** 2, axis=(0, 1)) / (realisations * periods * (periods - 1))
    unbiased = realisations / (realisations - 1) if realisations > 1 else np.nan
    scatter = np.mean(np.abs(means) ** 2, axis=0) * np.where(spectra.excited, unbiased, 1.0)
    return DistortionLevels(
        channels=tuple(spectra.channels[row] for row in rows),
        input=input,
        frequency_hz=spectra.frequency_hz,
        excited=spectra.excited,
        even=spectra.even,
        signal=np.mean(np.abs(spectra.mean[:, rows]) ** 2, axis=0),
        distortion=scatter - noise,
        noise=noise,
    )


def _check_silence(spectra: PeriodicSpectra, instruments: Sequence[str]) -> None:
    """Refuse instruments that are heard where the design is silent: then it is not what was played."""
    for name in instruments:
        amplitude = spectra.amplitude[spectra.index(name)]
        heard = np.where(spectra.excited, 0.0, amplitude)
        if np.max(heard) > _OTHER_DESIGN * np.max(amplitude):
            at = int(np.argmax(heard))
            raise IdentificationError(
                f"instrument '{name}': has {amplitude[at] / np.max(amplitude):.2g} of its largest amplitude at "
                f"{spectra.frequency_hz[at]:g} Hz, a line that the design does not excite; is the design what was played?"
            )


def _interpolated(at_hz: Float, frequency_hz: Float, values: Complex) -> Complex:
    """complex[n_channels, n], linear between the lines, constant beyond."""
    return np.array(
        [np.interp(at_hz, frequency_hz, row.real) + 1j * np.interp(at_hz, frequency_hz, row.imag) for row in values]
    )
