"""Spectra of multisine recordings period by period, and the frequency response with the voltage as instrument.

Near resonance the structure determines most of the force. Noise and harmonics in the force are then correlated with the
response, and ``H1 = S_yF / S_FF`` is biased. The voltage is noise-free and drives both force and response, so that
``H = S_yV / S_FV`` is unbiased (Pintelon and Schoukens, 2nd ed., section 2.6: instrumental variables). The scatter over
periods is noise; the scatter over realisations is noise and nonlinear distortion.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.channels import Channel, find_name, find_role
from identification.errors import IdentificationError
from identification.multisine.design import MultisineDesign
from identification.multisine.estimators import estimated_responses
from identification.validation import convert_fields, finite_array
from vibrolock.arrays import Complex, Float
from vibrolock.results import Result

_LOW_DEGREE = 3  # highest degree of the products that a weak nonlinearity mainly generates


@dataclass(frozen=True, eq=False)
class InstrumentResponse:
    """Frequency response between two channels at the excited lines.

    Parameters
    ----------
    frequency_hz
        float[n_lines].
    value
        complex[n_lines], output over input, in the units of the channels.
    noise_std
        float[n_lines], standard deviation of ``value`` from noise: ``sqrt(E|value - E value|^2)``; NaN with one period.
    total_std
        float[n_lines], standard deviation from the scatter over realisations, which includes nonlinear distortion; NaN with
        one realisation.
    unit
        Unit of ``value``.
    """

    frequency_hz: Float
    value: Complex
    noise_std: Float
    total_std: Float
    unit: str


@dataclass(frozen=True, eq=False)
class PeriodicSpectra(Result):
    """Spectra of every channel in every settled period of every realisation.

    Raises `IdentificationError` if values are NaN or infinite, or shapes do not agree.

    Parameters
    ----------
    channels
        At least one of role ``force``; the voltage is a channel of role ``monitor``.
    frequency_hz
        float[n_lines], every line of the band, excited or not: neighbouring multiples of the resolution.
    excited
        bool[n_lines], whether the design excites the line.
    spectra
        complex[n_realisations, n_periods, n_channels, n_lines], peak, in the unit of each channel: ``y = Re sum Y_k
        exp(2 pi i f_k t)`` with t from the start of the period.
    notes
        Notes for the user, one line each.
    """

    channels: tuple[Channel, ...]
    frequency_hz: Float
    excited: NDArray[np.bool_]
    spectra: Complex
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        convert_fields(self, tuple, "channels", "notes")
        if all(channel.role != "force" for channel in self.channels):
            find_role(self.channels, "force")
        object.__setattr__(self, "frequency_hz", finite_array("frequency_hz", self.frequency_hz, np.float64, 1))
        object.__setattr__(self, "excited", finite_array("excited", self.excited, np.bool_, 1))
        object.__setattr__(self, "spectra", finite_array("spectra", self.spectra, np.complex128, 4))
        expected = (len(self.channels), self.frequency_hz.size)
        if self.spectra.shape[2:] != expected or not self.spectra.size or self.excited.size != self.frequency_hz.size:
            reason = f"shape {self.spectra.shape} with {self.excited.size} values of excited"
            allowed = f"(realisations, periods, {expected[0]} channels, {expected[1]} lines)"
            raise IdentificationError(reason, field="spectra", allowed=allowed)

    def index(self, name: str) -> int:
        """Row of the channel called ``name``."""
        return find_name(self.channels, name)

    @property
    def even(self) -> NDArray[np.bool_]:
        """bool[n_lines], whether a line is an even multiple of the resolution."""
        steps = np.diff(self.frequency_hz)
        if not steps.size or np.ptp(steps) > 1e-6 * steps[0]:
            allowed = "two lines or more, all neighbours equally far apart"
            raise IdentificationError(field="frequency_hz", allowed=allowed)
        lines = self.frequency_hz / steps.mean()
        if np.any(np.abs(lines - np.round(lines)) > 1e-3):
            raise IdentificationError(f"lines {steps[0]:g} Hz apart are no multiples of that", field="frequency_hz")
        return np.asarray(np.round(lines) % 2 == 0)

    @property
    def mean(self) -> Complex:
        """complex[n_realisations, n_channels, n_lines]: mean over periods."""
        return np.asarray(self.spectra.mean(axis=1))

    @property
    def noise_variance(self) -> Float:
        """float[n_realisations, n_channels, n_lines]: variance of one period about the mean; NaN with one period."""
        periods = self.spectra.shape[1]
        scatter = np.sum(np.abs(self.spectra - self.mean[:, None]) ** 2, axis=1)
        return np.asarray(scatter / (periods - 1) if periods > 1 else np.full(scatter.shape, np.nan))

    @property
    def amplitude(self) -> Float:
        """float[n_channels, n_lines]: root of the mean square, over realisations, of the mean's peak amplitude."""
        return np.asarray(np.sqrt(np.mean(np.abs(self.mean) ** 2, axis=0)))

    @property
    def noise_std(self) -> Float:
        """float[n_channels, n_lines]: standard error, from noise, of the mean over periods of one realisation."""
        return np.asarray(np.sqrt(self.noise_variance.mean(axis=0) / self.spectra.shape[1]))

    def rms(self, name: str) -> float:
        """RMS of a channel within the band, over all periods and realisations."""
        power = np.abs(self.spectra[:, :, self.index(name)]) ** 2
        return float(np.sqrt(0.5 * power.sum(axis=-1).mean()))

    def frequency_response(
        self, output: str, input: str | None = None, *, instrument: str = "voltage"
    ) -> InstrumentResponse:
        """Estimate the frequency response from ``input`` (the force if None) to ``output`` by ``S_yV / S_FV``.

        This is one path of `best_linear_approximation`. Raises `IdentificationError` if a channel is missing or the
        instrument does not excite the input at a line.
        """
        force = input if input is not None else self.channels[find_role(self.channels, "force")].name
        found = estimated_responses(
            self.channels,
            self.frequency_hz[self.excited],
            self.spectra[..., self.excited],
            outputs=(output,),
            inputs=(force,),
            estimator="instrument",
            instruments=(instrument,),
        )
        return InstrumentResponse(
            frequency_hz=found.frequency_hz,
            value=found.path(output),
            noise_std=found.noise_std[:, 0, 0],
            total_std=found.total_std[:, 0, 0],
            unit=f"{found.outputs[0].unit}/{found.inputs[0].unit}",
        )


def periodic_spectra(
    records: Sequence[ArrayLike], channels: Sequence[Channel], design: MultisineDesign, *, transient_periods: int = 0
) -> PeriodicSpectra:
    """Compute the spectra of a multisine recording.

    Raises `IdentificationError` if values are NaN or infinite, records are not whole periods, or no period is left.

    Parameters
    ----------
    records
        One per realisation, float[n_channels, n], SI, all of the same whole number of periods.
    channels
        The channels, one per row.
    design
        Design of the played multisine.
    transient_periods
        Periods at the beginning of every record that had not settled and are left out.
    """
    IdentificationError.raise_if(not len(records), "is empty", field="records", allowed="at least one realisation")
    IdentificationError.unless_at_least("transient_periods", transient_periods, 0)
    size, spectra = design.period_samples, []
    for number, record in enumerate(records):
        data = finite_array(f"records[{number}]", record, np.float64, 2)
        periods, left = divmod(data.shape[1], size)
        if data.shape[0] != len(channels) or left:
            allowed = f"{len(channels)} channels by whole periods of {size} samples"
            raise IdentificationError(f"shape {data.shape}", field=f"records[{number}]", allowed=allowed)
        if periods <= transient_periods:
            allowed = f"more than transient_periods = {transient_periods}"
            raise IdentificationError(f"has {periods} periods", field=f"records[{number}]", allowed=allowed)
        kept = data.reshape(len(channels), periods, size)[:, transient_periods:]
        lines = np.fft.rfft(kept, axis=-1)[..., design.band_lines] * (2.0 / size)
        spectra.append(np.moveaxis(lines, 0, 1))
    if len({spectrum.shape for spectrum in spectra}) > 1:
        counts = ", ".join(str(spectrum.shape[0]) for spectrum in spectra)
        raise IdentificationError(f"have {counts} settled periods, need the same number", field="records")
    return PeriodicSpectra(
        channels=tuple(channels),
        frequency_hz=np.asarray(design.band_lines * design.resolution_hz, dtype=np.float64),
        excited=np.isin(design.band_lines, design.lines[design.amplitudes > 0.0]),
        spectra=np.array(spectra),
        notes=_folding(design),
    )


def _folding(design: MultisineDesign) -> tuple[str, ...]:
    """Return a note if products of low degree alias into the band when sampled without an anti-aliasing filter."""
    degree = design.folding_degree
    if degree > _LOW_DEGREE:
        return ()
    return (
        f"sampled at {design.sample_rate_hz:g} Hz, products of degree {degree} of a band up to {design.highest_hz:g} Hz fold "
        "back into it unless a filter removes them: they may be part of the distortion",
    )
