"""Checks that every measurement type of this package shares."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from identification.errors import IdentificationError


def convert_fields(of: object, convert: Callable[[Any], object], *names: str) -> None:
    """Replace fields of a frozen dataclass that is being made by what ``convert`` returns of them."""
    for name in names:
        object.__setattr__(of, name, convert(getattr(of, name)))


def read_only(values: ArrayLike, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """Return a copy of ``values`` as a read-only array."""
    array = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array


def finite_array(name: str, values: ArrayLike, dtype: DTypeLike, ndim: int) -> NDArray[Any]:
    """Return a read-only copy of ``values``; raise `IdentificationError` unless it has ``ndim`` dimensions and is finite."""
    try:
        array = read_only(values, dtype)
    except (TypeError, ValueError) as error:
        raise IdentificationError(f"not an array of numbers ({error})", field=name) from None
    if array.ndim != ndim:
        raise IdentificationError(f"has {array.ndim} dimensions (shape {array.shape})", field=name, allowed=ndim)
    return finite(name, array)


def shaped_array(name: str, values: ArrayLike, dtype: DTypeLike, shape: tuple[int, ...]) -> NDArray[Any]:
    """Return a read-only copy of ``values``; raise `IdentificationError` unless it has this shape and is finite."""
    array = finite_array(name, values, dtype, len(shape))
    IdentificationError.raise_if(array.shape != shape, f"shape {array.shape}", field=name, allowed=f"{shape}")
    return array


def finite(name: str, array: NDArray[Any]) -> NDArray[Any]:
    """Return the array itself; raise `IdentificationError` unless all of it is finite."""
    if not np.all(np.isfinite(array)):
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise IdentificationError(f"value at {list(index)} is {array[index]}", field=name, allowed="finite")
    return array


def table_rows(columns: Mapping[str, ArrayLike]) -> list[dict[str, float | None]]:
    """Return one JSON-able dictionary per row of columns of equal length, with None for what is not finite."""
    rows = zip(*map(np.asarray, columns.values()), strict=True)
    return [{name: float(v) if np.isfinite(v) else None for name, v in zip(columns, row, strict=True)} for row in rows]


def positive(name: str, value: float, unit: str = "") -> float:
    """Return ``value`` as a float; raise `IdentificationError` unless it is finite and above zero."""
    number = float(value)
    if not (np.isfinite(number) and number > 0.0):
        raise IdentificationError(field=name, value=number, unit=unit, allowed="finite and above zero")
    return number


def one_specimen(**named: str) -> None:
    """Raise `IdentificationError` if two of the named things belong to different specimens; empty names are ignored."""
    known = {what: specimen for what, specimen in named.items() if specimen}
    if len(set(known.values())) > 1:
        listed = ", ".join(f"{what} of '{specimen}'" for what, specimen in known.items())
        raise IdentificationError(listed, field="specimen", hint="they must belong to one specimen")
