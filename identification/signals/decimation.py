"""Resample recordings at a lower rate: low-pass filter and decimation by a rational factor."""

from fractions import Fraction
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from identification.errors import IdentificationError
from identification.validation import finite_array, positive

EDGE_SAMPLES = 32
"""Number of samples of the slower signal at either end that are affected by values beyond the record."""
LARGEST_FACTOR = 1000
"""Largest numerator and denominator of a ratio of rates. Chosen: the filter grows with it."""
_KAISER_BETA = 8.6  # 87 dB
_CORNER = 0.91  # of the new Nyquist frequency: middle of the transition band, which ends at that frequency


def decimated(signals: ArrayLike, rate_hz: float, new_rate_hz: float) -> NDArray[np.float64]:
    """Resample signals at a lower rate, for instance 5000 Hz -> 800 Hz (by 4/25).

    Raises `IdentificationError` if values are NaN or infinite, there are more than two dimensions, the new rate is
    higher, or the ratio is not a quotient of small integers.

    Parameters
    ----------
    signals
        float[n] or float[n_channels, n], uniformly sampled.
    rate_hz, new_rate_hz
        Samples per second before and after; their ratio must be a quotient of integers up to 1000.

    Returns
    -------
    float[ceil(n new/old)] or float[n_channels, ceil(n new/old)]; its first sample is at the instant of the first one given.
        The filter has linear phase and no delay (`scipy.signal.resample_poly`, Kaiser window): flat within 1e-4 up to 0.82 of
        the new Nyquist frequency and 87 dB down above the new Nyquist frequency, which prevents aliasing.

    The record is taken as zero beyond its ends. Where the signal is not zero there, ``EDGE_SAMPLES`` samples of the result at
    either end are in error. Discard them, or begin and end the recording at rest.
    """
    array = finite_array("signals", signals, np.float64, 1 if np.ndim(signals) < 2 else 2)
    old, new = positive("rate_hz", rate_hz, "Hz"), positive("new_rate_hz", new_rate_hz, "Hz")
    if new > old:
        raise IdentificationError(field="new_rate_hz", value=new, allowed=f"at most rate_hz = {old:g} Hz")
    ratio = Fraction(new / old).limit_denominator(LARGEST_FACTOR)
    if ratio == 0 or abs(float(ratio) * old / new - 1.0) > 1e-12:
        reason = f"its ratio to rate_hz = {old:g} Hz must be one of whole numbers up to {LARGEST_FACTOR}"
        raise IdentificationError(reason, field="new_rate_hz", value=new)
    if ratio == 1:
        return np.array(array)
    up, down = ratio.numerator, ratio.denominator
    low_pass: Any = scipy.signal.firwin(2 * EDGE_SAMPLES * down + 1, _CORNER / down, window=("kaiser", _KAISER_BETA))
    slower: Any = scipy.signal.resample_poly(array, up, down, axis=-1, window=low_pass)
    return np.asarray(slower, np.float64)
