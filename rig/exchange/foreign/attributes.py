"""What attributes of the datasets of an HDF5 file say of their values, by the conventions of NetCDF and CF.

The conventions: https://docs.unidata.ucar.edu/netcdf-c/current/attribute_conventions.html and section 8.1 of
https://cfconventions.org/cf-conventions/cf-conventions.html. A file may use them without being a NetCDF file. Attributes of
other names that seem to be factors are facts that cannot be followed: files do not say whether they are in the numbers.
"""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from rig.exchange.file_data import ChannelFacts, Value
from vibrolock.quantities import says_a_unit

_UNITS = ("units", "unit", "unitname", "unitstring", "unitstr", "engineeringunits", "engineeringunit", "eu")
_RATES = ("samplerate", "sampleratehz", "samplingrate", "samplingfrequency", "fs")
_STEPS = ("dt", "wfincrement", "samplinginterval", "sampleinterval")
_STARTS = ("starttime", "t0", "startoffset", "wfstartoffset", "wfstarttime", "starttimestamp")
_FACTORS = (
    *("gain", "scale", "scaling", "scalingfactor", "conversion", "conversionfactor", "multiplier", "factor", "slope"),
    *("calibration", "calibrationfactor", "sensitivity", "polarity"),
)
_OFFSETS = ("offset", "intercept")
_MISSING = ("_FillValue", "missing_value")
_NOT_WRITTEN = {
    "i2": -32767,
    "i4": -2147483647,
    "f4": float(np.float32(9.969209968386869e36)),
    "f8": 9.969209968386869e36,
}
"""What NetCDF puts in the place of numbers that were never written, by type (``NC_FILL_...`` of its header)."""


def facts_of_attributes(values: Mapping[str, Value], *, netcdf: bool = False) -> dict[str, ChannelFacts]:
    """Return what ``name@attribute`` beside each array of numbers says of it, by name.

    Starts count from the earliest. Scale and offset count as CF has them: stored numbers times ``scale_factor`` plus
    ``add_offset``. Values that are marked as missing or lie outside the valid range, and unsigned numbers in a signed type,
    are facts that cannot be followed; in a file of NetCDF also those that were never written.
    """
    every: dict[str, dict[str, Value]] = {}
    for key, value in values.items():
        name, at, attribute = key.rpartition("@")
        if at:
            every.setdefault(name, {})[attribute] = value
    starts = {name: start for name, of in every.items() if (start := _start_s(of)) is not None}
    earliest = min(starts.values(), default=0.0)
    found: dict[str, ChannelFacts] = {}
    for name, of in every.items():
        value, units = values.get(name), _units(of)
        if isinstance(value, dict) and len(units) == len(value):  # a table, with a unit for each column
            found |= {f"{name}/{column}": ChannelFacts(unit=unit) for column, unit in zip(value, units, strict=True)}
    for name, value in values.items():
        if isinstance(value, np.ndarray) and value.dtype.kind in "biuf" and "@" not in name:
            of = every.get(name, {})
            units = [*dict.fromkeys(_units(of))]
            several = [f"has several units ({', '.join(units)})"] if len(units) > 1 else []
            facts = ChannelFacts(
                unit=units[0] if len(units) == 1 else "",
                scale=_number(of.get("scale_factor")),
                offset=_number(of.get("add_offset")),
                sample_rate_hz=_rate_hz(of),
                start_s=starts[name] - earliest if name in starts else None,
                unread="; ".join([*several, *_unread(value, of), *(_unwritten(value, of) if netcdf else [])]),
            )
            found |= {} if facts == ChannelFacts() else {name: facts}
    return found


def _plain(key: str) -> str:
    return key.lower().replace("_", "").replace(" ", "")


def _units(of: Mapping[str, Value]) -> list[str]:
    """Return the unit in the attributes of an array, or the units."""
    told = {_plain(key): value for key, value in of.items()}
    for key in _UNITS:
        value = told.get(key)
        texts = [value] if isinstance(value, str) else value if isinstance(value, list) else []
        if units := [text for text in texts if isinstance(text, str) and (len(texts) > 1 or says_a_unit(text))]:
            return units
    return []


def _rate_hz(of: Mapping[str, Value]) -> float | None:
    for names, power in ((_RATES, 1), (_STEPS, -1)):
        for key, value in of.items():
            number = _number(value) if _plain(key) in names else None
            if number is not None and 0.0 < number < np.inf:
                return float(number**power)
    return None


def _start_s(of: Mapping[str, Value]) -> float | None:
    """Return the instant of the first sample: s, or a date and time of ISO 8601, of UTC where it has no zone."""
    for key, value in of.items():
        if _plain(key) not in _STARTS:
            continue
        number = _number(value)
        if number is None and isinstance(value, str):
            with suppress(ValueError):
                instant = datetime.fromisoformat(value)
                number = (instant if instant.tzinfo else instant.replace(tzinfo=UTC)).timestamp()
        if number is not None and np.isfinite(number):
            return number
    return None


def _number(value: Value) -> float | None:
    array = np.asarray(value) if isinstance(value, np.ndarray | np.generic | int | float) else None
    return float(array.reshape(-1)[0]) if array is not None and array.size == 1 and array.dtype.kind in "biuf" else None


def _unread(values: NDArray[np.generic], of: Mapping[str, Value]) -> Iterator[str]:
    """Yield in words what cannot be followed."""
    for key, value in of.items():
        number = _number(value)
        if key in ("scale_factor", "add_offset") and number is None:
            yield f"has {key} {value!r}, which is no number"
        neutral = 1.0 if _plain(key) in _FACTORS else 0.0 if _plain(key) in _OFFSETS else None
        if number is not None and neutral is not None and number != neutral:
            yield f"has the attribute {key} ({number:g}), and the file does not say whether it is in the numbers"
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


def _unwritten(values: NDArray[np.generic], of: Mapping[str, Value]) -> Iterator[str]:
    """Yield that values were never written, where the file has no ``_FillValue`` of its own."""
    fill = _NOT_WRITTEN.get(values.dtype.str[1:])
    if fill is not None and "_FillValue" not in of and (count := int(np.count_nonzero(values == fill))):
        yield f"has {count} values that were never written ({fill:g})"


def _limits(of: Mapping[str, Value]) -> tuple[float, float]:
    pair = np.ravel(np.asarray(of.get("valid_range", ())))
    low, high = (_number(of.get("valid_min")), _number(of.get("valid_max"))) if pair.size != 2 else map(float, pair)
    return -np.inf if low is None else low, np.inf if high is None else high
