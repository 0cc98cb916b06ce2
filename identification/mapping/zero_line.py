"""The line at 0 Hz of frequency responses of others, which often holds nothing."""

from collections.abc import Sequence

import numpy as np

from identification.channels import Channel
from identification.errors import IdentificationError
from vibrolock.arrays import Complex, Float


def without_line_at_0_hz(
    frequency_hz: Float, value: Complex, outputs: Sequence[Channel], where: str
) -> tuple[Float, Complex, tuple[str, ...]]:
    """Return frequencies and responses without a line at 0 Hz that says nothing, and a note on it.

    At 0 Hz a displacement that was computed from an acceleration is NaN, and velocity and acceleration are 0: such a line is
    left out. A displacement there is kept. Raises `IdentificationError` for a NaN or infinite value at any other frequency.

    Parameters
    ----------
    frequency_hz
        float[n_lines].
    value
        complex[n_lines, n_outputs, n_inputs].
    outputs
        The responding channels.
    where
        What names the responses in messages.
    """
    still = [channel.unit in ("m/s", "m/s2") for channel in outputs]
    empty = (frequency_hz == 0.0) & (
        ~np.all(np.isfinite(value), axis=(1, 2)) | np.any(value == 0.0, axis=(1, 2)) | any(still)
    )
    kept = ~empty
    bad = kept & ~np.all(np.isfinite(value), axis=(1, 2))
    if bad.any():
        at = int(np.argmax(bad))
        raise IdentificationError(f"is not finite at [{at}], {frequency_hz[at]:g} Hz", where=where)
    if not kept.any():
        raise IdentificationError("has no line but that at 0 Hz", where=where)
    notes = ("left out: the line at 0 Hz, which says nothing of these motions",) if empty.any() else ()
    return frequency_hz[kept], value[kept], notes
