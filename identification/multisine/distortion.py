"""Levels of nonlinear distortion: from odd and even detection lines, and from the scatter over realisations.

Pintelon and Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., section 4.3. The distortion of a
channel is the residual of its best linear approximation G from the input, ``E = Y - G X``, less the power of the noise. At
detection lines G is interpolated between the excited lines on either side.

With the voltage as input, X is zero at the detection lines, and E is the distortion of the whole *rig*, exciter and
structure. A force that the structure's own motion distorts appears as distortion of the force and, through the structure, of
every response. With the force as input, the contribution of the force at the detection lines is subtracted from the responses
to first order, ``Y - G F``. The residual is then the *structure's* own distortion under the actual force. The interpolation
of G limits this correction if the spacing of the lines is as large as the width of a resonance.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from identification.channels import Channel, find_name
from identification.errors import IdentificationError
from identification.multisine.best_linear_approximation import best_linear_approximation
from identification.multisine.spectra import PeriodicSpectra
from vibrolock.arrays import Bool, Float
from vibrolock.results import Result

Lines = Literal["excited", "odd", "even"]

_OTHER_DESIGN = 0.1  # amplitude of the instrument at detection lines against the excited ones


@dataclass(frozen=True, eq=False, kw_only=True)
class DistortionLevels(Result):
    """Power of signal, distortion and noise of every channel at every line of the band.

    A power is the mean square of the peak amplitude in the mean over periods of one realisation, in the square of the
    channel's unit. The power of the noise is subtracted from that of the distortion, which may therefore be below zero by
    chance. Average powers first and take the root afterwards, as `ratio` does.

    Parameters
    ----------
    channels
        All channels except the input and the instruments.
    input
        Name of the input, ``voltage`` (distortion of the rig) or a force (distortion of the structure).
    frequency_hz
        float[n_lines], every line of the band.
    excited, even
        bool[n_lines], whether a line is excited, and whether it is an even multiple of the resolution.
    signal, distortion, noise
        float[n_channels, n_lines], powers; ``distortion`` of excited lines is NaN with one realisation.
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
        """bool[n_lines]: selects the excited lines, or the ``odd`` or ``even`` detection lines."""
        IdentificationError.unless_one_of("lines", lines, get_args(Lines))
        return self.excited if lines == "excited" else ~self.excited & (self.even == (lines == "even"))

    def amplitude(self, channel: str, lines: Lines) -> tuple[Float, Float]:
        """float[n], float[n]: frequency of the lines, and peak amplitude of the distortion there (0 if not above noise)."""
        chosen = self.select(lines)
        power = self.distortion[find_name(self.channels, channel), chosen]
        return self.frequency_hz[chosen], np.sqrt(np.maximum(power, 0.0))

    def ratio(self, channel: str, lines: Lines, *, lowest_hz: float = 0.0, highest_hz: float = np.inf) -> float:
        """Root of the mean distortion power per line over the mean signal power per excited line in a band, 0 to about 1.

        NaN if there are no such lines or the distortion is unknown.
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
    """Estimate the distortion of every channel other than the input; the module describes the choice of input.

    Raises `IdentificationError` if there is only one period (noise is unknown), if the instrument has more than a
    tenth of its largest amplitude at a line that the design does not excite, and in the cases of
    `best_linear_approximation`.

    Parameters
    ----------
    spectra
        Spectra of a multisine test, of two periods or more.
    input
        Name of the channel that is taken as the input.
    instruments
        Names of the channels that serve as instruments: noise-free signals that drive the inputs.
    """
    realisations, periods = spectra.spectra.shape[:2]
    if periods < 2:
        raise IdentificationError(field="periods", value=1, allowed="2 or more to tell noise from distortion")
    _check_silence(spectra, instruments)
    outputs = [channel.name for channel in spectra.channels if channel.name not in {input, *instruments}]
    rows = [spectra.index(name) for name in outputs]
    found = best_linear_approximation(spectra, outputs=outputs, inputs=(input,), instruments=instruments)
    linear = np.array([np.interp(spectra.frequency_hz, found.frequency_hz, row) for row in found.value[:, :, 0].T])
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
    """Raise if an instrument has power at lines that the design does not excite: the design is then not what was played."""
    for name in instruments:
        amplitude = spectra.amplitude[spectra.index(name)]
        heard = np.where(spectra.excited, 0.0, amplitude)
        if np.max(heard) > _OTHER_DESIGN * np.max(amplitude):
            at = int(np.argmax(heard))
            raise IdentificationError(
                f"instrument '{name}': has {amplitude[at] / np.max(amplitude):.2g} of its largest amplitude at "
                f"{spectra.frequency_hz[at]:g} Hz, a line that the design does not excite; is the design what was played?"
            )
