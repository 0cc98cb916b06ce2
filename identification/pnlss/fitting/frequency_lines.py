"""Errors of periodic experiments by frequency line: their weights, and the Jacobian of the lines."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.pnlss.fitting.records import Record
from identification.pnlss.fitting.settings import FitSettings

__all__ = ["transformed", "with_lines"]

Float = NDArray[np.float64]

_COLUMNS = 64
"""Number of columns transformed at a time, so that a transform needs little memory besides the Jacobian."""


def with_lines(records: Sequence[Record], settings: FitSettings, sample_rate_hz: float) -> list[Record]:
    """Return the records with line weights if the settings require them.

    Raises `IdentificationError` for a record that is not periodic or has no line that counts.
    """
    if not settings.by_frequency:
        return list(records)
    found = []
    for record in records:
        if not record.period:
            raise IdentificationError(
                f"{record.name}: is not periodic and cannot be weighted over frequency; "
                "leave band_hz and line_weights out, or it"
            )
        lines = _line_weights(settings, record, sample_rate_hz)
        if not np.any(lines):
            raise IdentificationError(
                f"{record.name}: has no frequency line that counts; its lines are {sample_rate_hz / record.period:g} Hz apart"
            )
        found.append(replace(record, lines=lines))
    return found


def _line_weights(settings: FitSettings, record: Record, sample_rate_hz: float) -> Float:
    """float[n_outputs, n_lines]: weights with which squared lines add up to the squares of all counted samples (Parseval)."""
    outputs, period = record.y.shape[1], record.period
    frequencies_hz = np.fft.rfftfreq(period, 1.0 / sample_rate_hz)
    double = np.full(frequencies_hz.size, 2.0)
    double[0] = 1.0
    if period % 2 == 0:
        double[-1] = 1.0
    periods = (len(record.u) - record.counted_from) / period
    scale = np.sqrt(double * periods / period)
    if settings.band_hz is not None:
        scale = scale * ((frequencies_hz >= settings.band_hz[0]) & (frequencies_hz <= settings.band_hz[1]))
    rows = np.tile(scale, (outputs, 1))
    if settings.line_weights:
        given = np.array(settings.line_weights)
        if given.shape[1] not in (2, 1 + outputs):
            raise IdentificationError(
                f"line_weights: have {given.shape[1] - 1} weights beside each frequency, "
                f"needs 1 or one for each of {outputs} outputs"
            )
        for output, row in enumerate(rows):
            of = given[:, 1 + min(output, given.shape[1] - 2)]
            row *= np.interp(frequencies_hz, given[:, 0], of, left=0.0, right=0.0)
    return rows


def transformed(
    record: Record, lines: Float, blocks: Iterable[tuple[Float, Float, Float]]
) -> Iterator[tuple[Float, Float, Float]]:
    """Yield for each output the Jacobian float[2 n_used, n_columns] of its lines, rows float[2 n_used, n_own] and errors.

    Errors are float[2 n_used, n_outputs]. Periods are averaged first; real parts stand above imaginary ones, all weighted.
    """
    periods = (len(record.u) - record.counted_from) // record.period
    means: list[Float] = []
    at = 0
    for block in blocks:
        if not means:
            means = [np.zeros((*part.shape[:-2], record.period, part.shape[-1])) for part in block]
        n = block[0].shape[1]
        place = slice(at % record.period, at % record.period + n)
        for mean, part in zip(means, block, strict=True):
            mean[..., place, :] += part / periods
        at += n
    rows, errors = (np.fft.rfft(mean, axis=0) for mean in means[1:])
    for mine, weight in zip(means[0], lines, strict=True):
        used = np.flatnonzero(weight)
        by = weight[used, None]
        out = np.empty((2 * used.size, mine.shape[1]))
        for begin in range(0, mine.shape[1], _COLUMNS):
            part = np.fft.rfft(mine[:, begin : begin + _COLUMNS], axis=0)[used] * by
            out[: used.size, begin : begin + _COLUMNS] = part.real
            out[used.size :, begin : begin + _COLUMNS] = part.imag
        yield out, _stacked(rows[used] * by), _stacked(errors[used] * by)


def _stacked(lines: NDArray[np.complex128]) -> Float:
    return np.concatenate([lines.real, lines.imag])
