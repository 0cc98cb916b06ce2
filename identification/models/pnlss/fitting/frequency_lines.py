"""Errors of periodic experiments by frequency line: their weights, and the Jacobian of the lines."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.models.pnlss.fitting.blocks import Blocks
from identification.models.pnlss.fitting.records import Record
from identification.models.pnlss.fitting.result import FitSettings
from vibrolock.arrays import Float

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
                "is not periodic and cannot be weighted over frequency; leave band_hz and line_weights out, or it",
                where=record.name,
            )
        lines = _line_weights(settings, record, sample_rate_hz)
        if not np.any(lines):
            raise IdentificationError(
                f"has no frequency line that counts; its lines are {sample_rate_hz / record.period:g} Hz apart",
                where=record.name,
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
                f"have {given.shape[1] - 1} weights beside each frequency",
                field="line_weights",
                allowed=f"1 or one for each of {outputs} outputs",
            )
        for output, row in enumerate(rows):
            of = given[:, 1 + min(output, given.shape[1] - 2)]
            row *= np.interp(frequencies_hz, given[:, 0], of, left=0.0, right=0.0)
    return rows


def transformed(record: Record, lines: Float, blocks: Blocks) -> Iterator[tuple[Float, Float]] | None:
    """For each output the Jacobian float[2 n_used, n_columns] of its lines, and rows float[2 n_used, n_own].

    Periods are averaged first; real parts stand above imaginary ones, all weighted. None if the run diverges.
    """
    periods = (len(record.u) - record.counted_from) // record.period
    jacobian = np.zeros((record.period, len(lines), blocks.columns))
    rows = np.zeros((record.period, blocks.own))
    at = 0
    for bounded in blocks:
        if not bounded:
            return None
        place = slice(at % record.period, at % record.period + len(blocks.rows))
        jacobian[place] += blocks.rows[:, -len(lines) :] / periods
        rows[place] += blocks.q[:, : blocks.own] / periods
        at += len(blocks.rows)
    return _by_output(jacobian, np.fft.rfft(rows, axis=0), lines)


def _by_output(jacobian: Float, rows: NDArray[np.complex128], lines: Float) -> Iterator[tuple[Float, Float]]:
    for output, weight in enumerate(lines):
        used = np.flatnonzero(weight)
        by = weight[used, None]
        out = np.empty((2 * used.size, jacobian.shape[2]))
        for begin in range(0, jacobian.shape[2], _COLUMNS):
            columns = slice(begin, begin + _COLUMNS)
            out[:, columns] = _stacked(np.fft.rfft(jacobian[:, output, columns], axis=0)[used] * by)
        yield out, _stacked(rows[used] * by)


def _stacked(lines: NDArray[np.complex128]) -> Float:
    return np.concatenate([lines.real, lines.imag])
