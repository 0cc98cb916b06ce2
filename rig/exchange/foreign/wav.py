"""WAV files: one array per channel, relative to full scale."""

import warnings
from pathlib import Path

import numpy as np

from rig.exchange.file_data import FileData


def read_wav(path: Path) -> FileData:
    """Return ``channel1``, ``channel2``, ... as float[n], 1 at full scale, and the sample rate.

    Raises ValueError or errors of SciPy if the file cannot be read, or ends early.
    """
    from scipy.io import wavfile

    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        rate, samples = wavfile.read(path)
    if early := next((str(one.message) for one in warned if "EOF" in str(one.message)), None):
        raise ValueError(f"it is cut short: {early}")
    if samples.dtype.kind == "u":
        values = (samples.astype(np.float64) - 128.0) / 128.0
    elif samples.dtype.kind == "i":
        values = samples / float(2 ** (8 * samples.dtype.itemsize - 1))
    else:
        values = samples.astype(np.float64)
    columns = values[:, None] if values.ndim == 1 else values
    channels = {f"channel{number}": np.array(column) for number, column in enumerate(columns.T, 1)}
    return FileData(values={**channels}, sample_rate_hz=float(rate))
