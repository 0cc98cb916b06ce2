"""Whole periods of a record as columns for least squares, chunk by chunk: harmonics of its phase, and its signals."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification.signals.chunks import Line, Phase, Record, spans
from identification.signals.even_phase import EvenPhase
from identification.signals.turns import turns_of
from identification.validation import finite
from vibrolock.arrays import Complex, Float

_MOST_KEPT = 2**22
"""Numbers that are kept in memory rather than computed again."""


class Stretch(NamedTuple):
    """A stretch of the whole periods of a record; rows of zeros where samples were lost."""

    theta: Float
    """float[n], without ripple."""
    design: Float
    """float[n, 2 H + 4]."""
    data: Float
    """float[n, n_channels]."""
    lost: NDArray[np.bool_]
    """bool[n]."""


class Columns:
    """The first ``count`` samples of a record, whole periods, in chunks; as often as they are iterated over.

    The ripple of the phase is removed and a drift is fitted if there are ``many`` periods. Few chunks are kept in memory.
    """

    def __init__(self, record: Record, phase: Phase, count: int, harmonics: int, *, many: bool) -> None:
        self._record, self._phase, self._harmonics = record, phase, harmonics
        self.count = count
        self._straight = Line(phase.first, phase.at(count - 1), count)
        self._position = Line(-0.5, 0.5, count)
        self._kept: list[Stretch] = []
        self._even: tuple[int, int, EvenPhase] | None = None
        self._drifts = many
        self._swing = self._ripple() if many else None

    def __iter__(self) -> Iterator[Stretch]:
        if self._kept:
            yield from self._kept
            return
        kept = []
        for start, stop in spans(self.count):
            chunk = self._read(start, stop)
            if self.count * (chunk.design.shape[1] + chunk.data.shape[1]) <= _MOST_KEPT:
                kept.append(chunk)
            yield chunk
            del chunk  # before the next is read
        self._kept = kept

    def _read(self, start: int, stop: int) -> Stretch:
        theta = self._phase.read(start, stop)
        if self._swing is not None:
            theta = np.asarray(theta - self._repeating(start, stop).signal(self._swing))
        position = self._position.read(start, stop) if self._drifts else None
        design = _design(theta, self._harmonics, position)
        samples, lost = self._record.samples(start, stop)
        if lost.any():
            samples = np.where(lost, 0.0, samples)
            design[lost] = 0.0  # rows of zeros, in the data as well: no effect on the sums of least squares
        return Stretch(theta, design, finite("samples", samples).T, lost)

    def _repeating(self, start: int, stop: int) -> EvenPhase:
        """Harmonics of a phase that advances uniformly, in a stretch."""
        if self._even is None or self._even[:2] != (start, stop):
            first = float(self._straight.read(start, start + 1)[0])
            self._even = start, stop, EvenPhase(first, self._straight.step, stop - start, self._harmonics)
        return self._even[2]

    def _ripple(self) -> Complex:
        """complex[H + 1]: harmonics of the part of the phase that repeats within every period.

        It is fitted to the deviation of the phase from its moving mean over one period, so that slow variations remain.
        """
        step = self._straight.step
        period = round(2.0 * np.pi / step)
        size = self.count - period + 1
        sums: Complex | float = 0.0
        for start, stop in spans(size):
            end = stop + period - 1
            away = self._phase.read(start, end) - self._straight.read(start, end)
            summed = np.cumsum(away)
            mean = summed[period - 1 :] / period
            mean[1:] -= summed[:-period] / period
            inside = slice(period // 2, period // 2 + mean.size)
            weight = _hanning(start, stop, size)  # without it the ends of a slow variation leak into the fit
            weighted = np.zeros(end - start)
            weighted[inside] = (away[inside] - mean) * weight**2
            sums = sums + self._repeating(start, end).sums(weighted)
        middle = self._straight.first + step * (period // 2 + 0.5 * (size - 1))
        right = np.asarray(sums)
        found = least_squares(even_products(middle, step, size, self._harmonics), np.append(right.real[1:], right.imag))
        return np.asarray(np.append(0.0, found[: self._harmonics]) + 1j * found[self._harmonics :])


def even_products(middle: float, step: float, size: int, harmonics: int) -> Float:
    """float[2 H + 1, 2 H + 1]: products of cosines from 1 up and minus sines from 0 up, weighted by the square of `_hanning`.

    They come from sums of ``exp(i m theta)`` over samples whose phase advances by ``step``, to either side of ``middle``. The
    square of the weight is a sum of five exponentials, with which the sums are geometric.
    """
    orders = np.arange(harmonics + 1)
    half = 0.5 * step * np.arange(2 * harmonics + 1)[:, None] + np.pi / (size - 1) * np.arange(-2, 3)
    kernels = np.divide(np.sin(size * half), np.sin(half), out=np.full(half.shape, float(size)), where=half != 0.0)
    sums = np.exp(1j * middle * np.arange(2 * harmonics + 1)) * (kernels @ (np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0))
    above, apart = sums[orders[:, None] + orders], orders[:, None] - orders
    below = np.where(apart < 0, np.conj(sums[abs(apart)]), sums[abs(apart)])
    cosines, sines, mixed = (above + below).real, (below - above).real, (below - above).imag[1:]
    return 0.5 * np.block([[cosines[1:, 1:], mixed], [mixed.T, sines]])


def _hanning(start: int, stop: int, size: int) -> Float:
    """``np.hanning(size)[start:stop]``."""
    step = 2.0 * np.pi / (size - 1)
    return EvenPhase((start + 0.5) * step - np.pi * size / (size - 1), step, stop - start, 1).signal(np.full(2, 0.5))


def least_squares(normal: Float, right: Float) -> Float:
    """Solve the normal equations, which suffice for the few columns of harmonics, as these are nearly orthogonal.

    Columns of zeros get a coefficient of zero.
    """
    solution = np.asarray(np.linalg.lstsq(normal, right, rcond=None)[0])
    solution[~normal.any(axis=0)] = 0.0
    return solution


def _design(theta: Float, harmonics: int, position: Float | None = None) -> Float:
    """float[n, 2 H + 4]: cosines and minus sines (for Re and Im of Y_h, h from 0 up), and the drift of the fundamental.

    ``position`` in the record goes from -1/2 to 1/2. Without it the drift is left out (its columns are zero), as below four
    periods, where it cannot be separated from the harmonics.
    """
    columns = np.zeros((2 * harmonics + 4, theta.size))
    turns = turns_of(theta, harmonics, columns[:-2].reshape(2, harmonics + 1, theta.size))
    if position is not None:
        np.multiply(position, turns[:, 1], out=columns[-2:])
    return columns.T
