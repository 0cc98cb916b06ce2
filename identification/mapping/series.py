"""Stored arrays of any dimensions as series over time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from vibrolock.arrays import Float


@dataclass(frozen=True, eq=False)
class Series:
    """Samples of one channel: float[n_levels, n_realisations, n], and the length of a period if the axes tell it, else 0."""

    values: Float
    period_samples: int


def series(value: Any, axes: Sequence[str], index: int, where: str) -> Series:
    """Return the samples of a channel in a stored array whose dimensions are ``axes``.

    A vector, row or column, is one record. Periods follow each other. Raises `IdentificationError` for what is not a real array
    of numbers with these dimensions, for NaN and inf, and if there is no channel ``index`` (from 1).
    """
    array = _array(value, where)
    if array.size == max(array.shape, default=1):
        IdentificationError.raise_if(
            index > 1, f"'{where}' is a vector, which has 1 channel", field=f"{where}.index", value=index
        )
        array, axes = array.reshape(-1), ("sample",)
    if array.ndim != len(axes):
        raise IdentificationError(
            f"{where}: has shape {array.shape}, `axes` names {len(axes)} dimensions ({', '.join(axes)}); name each, and leave "
            "out those of length 1"
        )
    names = list(axes)
    if "channel" in names:
        at = names.index("channel")
        if index > array.shape[at]:
            reason = f"the array has 1 to {array.shape[at]} (shape {array.shape})"
            raise IdentificationError(reason, field=f"{where}.index", value=index)
        array = np.take(array, index - 1, axis=at)
        names.pop(at)
    for name in ("level", "realisation", "period", "sample"):
        if name not in names:
            array, names = array[None], [name, *names]
    array = np.transpose(array, [names.index(name) for name in ("level", "realisation", "period", "sample")])
    size = array.shape[-1] if "period" in axes else 0
    return Series(np.ascontiguousarray(array.reshape(*array.shape[:2], -1), dtype=np.float64), size)


def _array(value: Any, where: str) -> NDArray[Any]:
    try:
        array = np.asarray(value)
    except ValueError:
        raise IdentificationError("is a list of unequal lengths", where=where, allowed="numbers") from None
    if array.dtype.kind not in "biuf":
        what = "complex" if array.dtype.kind == "c" else "no array of numbers"
        raise IdentificationError(f"is {what}", where=where, allowed="real numbers over time")
    if array.size < 2:
        raise IdentificationError(f"has shape {array.shape}", where=where, allowed="two samples at least")
    if array.dtype.kind == "f" and not np.all(np.isfinite(array)):
        at = [int(i) for i in np.argwhere(~np.isfinite(array))[0]]
        raise IdentificationError(f"value at {at} is {array[tuple(at)]}", where=where, allowed="finite")
    return array


def common_length(
    values: Sequence[Float], skipped: Sequence[int], shapes: Mapping[str, tuple[int, ...]], *, cut: bool
) -> Float:
    """float[n_channels, n_levels, n_realisations, n]: all channels from a common beginning; ``cut`` to the shortest if allowed.

    Raises `IdentificationError` if numbers of levels, realisations or samples differ, or if nothing is left.
    """
    late = [one[..., skip:] for one, skip in zip(values, skipped, strict=True)]
    lengths = [one.shape[-1] for one in late]
    told = ", ".join(f"{name} {' x '.join(map(str, shape))}" for name, shape in shapes.items())
    if len({one.shape[:2] for one in late}) > 1:
        raise IdentificationError(f"unequal numbers of levels x realisations x samples ({told})", field="channels")
    if len(set(lengths)) > 1 and not cut:
        raise IdentificationError(f"unequal lengths (levels x realisations x samples: {told})", field="channels")
    IdentificationError.raise_if(min(lengths) < 2, f"no two samples are left in common ({told})", field="channels")
    return np.array([one[..., : min(lengths)] for one in late])
