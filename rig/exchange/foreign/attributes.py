"""What attributes of the datasets of an HDF5 file say of their values, by the conventions of NetCDF and CF.

The conventions: https://docs.unidata.ucar.edu/netcdf-c/current/attribute_conventions.html and section 8.1 of
https://cfconventions.org/cf-conventions/cf-conventions.html. A file may use them without being a NetCDF file.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from rig.exchange.file_data import ChannelFacts, Value
from vibrolock.quantities import says_a_unit

_MISSING = ("_FillValue", "missing_value")


def facts_of_attributes(values: Mapping[str, Value]) -> dict[str, ChannelFacts]:
    """Return what ``name@attribute`` beside each array of numbers says of it, by name.

    Scale and offset count as CF has them: stored numbers times ``scale_factor`` plus ``add_offset``. Values that are marked as
    missing or lie outside the valid range, and unsigned numbers in a signed type, are facts that cannot be followed.
    """
    every: dict[str, dict[str, Value]] = {}
    for key, value in values.items():
        name, at, attribute = key.rpartition("@")
        if at:
            every.setdefault(name, {})[attribute] = value
    found = {}
    for name, of in every.items():
        value = values.get(name)
        if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
            found[name] = ChannelFacts(
                unit=_unit(of),
                scale=_number(of.get("scale_factor")),
                offset=_number(of.get("add_offset")),
                unread="; ".join(_unread(value, of)),
            )
    return {name: facts for name, facts in found.items() if facts != ChannelFacts()}


def _unit(of: Mapping[str, Value]) -> str:
    told = (of.get(key) for key in ("units", "unit", "Units", "Unit", "UNITS", "UNIT"))
    return next((text for text in told if isinstance(text, str) and says_a_unit(text)), "")


def _number(value: Value) -> float | None:
    array = np.asarray(value) if isinstance(value, np.ndarray | np.generic | int | float) else None
    return float(array.reshape(-1)[0]) if array is not None and array.size == 1 and array.dtype.kind in "biuf" else None


def _unread(values: NDArray[np.generic], of: Mapping[str, Value]) -> Iterator[str]:
    """Yield in words what cannot be followed."""
    for key in ("scale_factor", "add_offset"):
        if key in of and _number(of[key]) is None:
            yield f"has {key} {of[key]!r}, which is no number"
    if str(of.get("_Unsigned", "")).lower() == "true" and values.dtype.kind == "i":
        yield "is marked _Unsigned, but stored with a sign"
    for key in _MISSING:
        for missing in np.ravel(np.asarray(of[key])) if key in of else ():
            count = int(np.count_nonzero(np.isnan(values) if missing != missing else values == missing))
            if count and not (missing != missing and values.dtype.kind in "biu"):
                yield f"has {count} missing values ({key} {missing})"
    low, high = _limits(of)
    numbers = values.astype(np.float64)
    if count := int(np.count_nonzero((numbers < low) | (numbers > high))):
        yield f"has {count} values outside its valid range, {low:g} to {high:g}"


def _limits(of: Mapping[str, Value]) -> tuple[float, float]:
    pair = np.ravel(np.asarray(of.get("valid_range", ())))
    low, high = (_number(of.get("valid_min")), _number(of.get("valid_max"))) if pair.size != 2 else map(float, pair)
    return -np.inf if low is None else low, np.inf if high is None else high
