"""Frequency responses of time records: the best linear approximation of periodic ones, a regression over others."""

from dataclasses import replace

import numpy as np

from identification.channels import chosen_rows, find_role
from identification.errors import IdentificationError
from identification.experiments.periodicity import check_periods
from identification.experiments.time_records import TimeRecords
from identification.linear.auto_regression import regressed_responses
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.multisine.best_linear_approximation import best_linear_approximation
from identification.multisine.estimators import Estimator
from identification.multisine.spectra import PeriodicSpectra

_EXCITED = 1e-2
"""A line counts as excited above this share of the strongest line of the force, or of the instrument."""


def time_responses(records: TimeRecords, *, estimator: Estimator = "instrument") -> FrequencyResponseMatrix:
    """Return the frequency responses from the force to every motion, with their covariance.

    Raises `IdentificationError` without exactly one force, without a motion, or if the records are too short or no
    line is excited.

    Parameters
    ----------
    records
        Records of one level (`TimeRecords.levels`).
    estimator
        Of periodic records: ``instrument``, which is H1 if there is no instrument, ``H1`` or ``H2``. Others are evaluated by a
        regression (`identification.linear.auto_regression`), whatever the estimator.
    """
    find_role(records.channels, "force")
    if records.period_samples:
        return _periodic(records, estimator)
    into, out = chosen_rows(records.channels, ("force",), None)
    return regressed_responses(
        [(record.samples[list(into)], record.samples[list(out)]) for record in records.records],
        sample_rate_hz=records.sample_rate_hz,
        inputs=[records.channels[row] for row in into],
        outputs=[records.channels[row] for row in out],
        band_hz=records.excited_hz,
        specimen=records.specimen,
    )


def _periodic(records: TimeRecords, estimator: Estimator) -> FrequencyResponseMatrix:
    spectra = time_spectra(records)
    if estimator != "instrument":
        return best_linear_approximation(spectra, estimator=estimator, specimen=records.specimen)
    if records.instrument:
        return best_linear_approximation(spectra, instruments=(records.instrument,), specimen=records.specimen)
    found = best_linear_approximation(spectra, estimator="H1", specimen=records.specimen)
    note = "no instrument: estimated as H1, which noise in the force biases (key `instrument` of the mapping)"
    return replace(found, notes=(*found.notes, note))


def time_spectra(records: TimeRecords) -> PeriodicSpectra:
    """Return the spectra of periodic records, every period of every record, in the excited band.

    Records with more periods than others lose the first ones. Raises `IdentificationError` if the records are not periodic,
    their periods differ, or no line is excited.
    """
    size = records.period_samples
    IdentificationError.raise_if(
        not size, "the records are not periodic and have no spectra by periods", field="period_samples", value=0
    )
    check_periods(records)
    periods = min(record.samples.shape[1] for record in records.records) // size
    kept = [
        record.samples[:, -periods * size :].reshape(len(record.samples), periods, size) for record in records.records
    ]
    lines = np.array([np.moveaxis(np.fft.rfft(one, axis=-1) * (2.0 / size), 0, 1) for one in kept])  # peak amplitudes
    frequency = np.arange(lines.shape[-1]) * records.sample_rate_hz / size
    names = [channel.name for channel in records.channels]
    row = names.index(records.instrument) if records.instrument else find_role(records.channels, "force")
    amplitude = np.sqrt(np.mean(np.abs(lines[:, :, row].mean(axis=1)) ** 2, axis=0))
    low, high = (0.0, np.inf) if records.excited_hz is None else records.excited_hz
    inside = (frequency > 0.0) & (frequency >= low * (1.0 - 1e-9)) & (frequency <= high * (1.0 + 1e-9))
    inside[-1] &= size % 2 == 1  # at half the sample rate a line has no phase
    excited = inside & (amplitude >= _EXCITED * np.max(amplitude * inside, initial=0.0)) & (amplitude > 0.0)
    if not excited.any():
        raise IdentificationError(f"channel '{names[row]}': has no power at any line in {low:g} to {high:g} Hz")
    band = slice(int(np.argmax(excited)), excited.size - int(np.argmax(excited[::-1])))
    return PeriodicSpectra(
        channels=records.channels,
        frequency_hz=frequency[band],
        excited=excited[band],
        spectra=lines[..., band],
        notes=records.notes,
    )
