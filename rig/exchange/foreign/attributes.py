"""What attributes of the datasets of an HDF5 file say of their values, by the conventions of NetCDF and CF.

The conventions: https://docs.unidata.ucar.edu/netcdf-c/current/attribute_conventions.html and section 8.1 of
https://cfconventions.org/cf-conventions/cf-conventions.html. A file may use them without being a NetCDF file. Attributes of
other names that seem to be factors are facts that cannot be followed: files do not say whether they are in the numbers.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from rig.exchange.beside import texts_in, units_in, with_units
from rig.exchange.file_data import ChannelFacts, Value
from rig.exchange.spellings import START_KEYS, UNIT_KEYS, factor_remark, number_in, plain, rate_named
from vibrolock.quantities import says_a_unit

_FIELD = re.compile(r"FIELD_(\d+)_UNITS?")
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
        if columns := [key for key in _inside(values, name) if "@" not in key]:
            units = dict(zip(columns, _units(of), strict=False)) if len(_units(of)) == len(columns) > 1 else {}
            units |= _units_of_fields(of, columns)
            found |= {f"{name}/{column}": ChannelFacts(unit=unit) for column, unit in units.items()}
    for name, value in values.items():
        if isinstance(value, np.ndarray) and value.dtype.kind in "biuf" and "@" not in name:
            of = every.get(name, {})
            rates = (rate_named(key, told) for key, told in of.items())
            facts = with_units(
                ChannelFacts(
                    scale=number_in(of.get("scale_factor")),
                    offset=number_in(of.get("add_offset")),
                    sample_rate_hz=next((rate for rate in rates if rate is not None), None),
                    start_s=starts[name] - earliest if name in starts else None,
                    unread="; ".join([*_unread(value, of), *(_unwritten(value, of) if netcdf else [])]),
                ),
                _units(of),
                value,
            )
            found |= {} if facts == ChannelFacts() else {name: facts}
    return found


def _inside(values: Mapping[str, Value], name: str) -> Mapping[str, Value]:
    """Return what a group or table holds; nothing for any other name."""
    inside: Value = {**values}
    for part in filter(None, name.split("/")):
        inside = inside.get(part) if isinstance(inside, dict) else None
    return inside if isinstance(inside, dict) and name else {}


def _units(of: Mapping[str, Value]) -> list[str]:
    """Return the unit in the attributes of an array, or the units."""
    told = {plain(key): units_in(value) for key, value in of.items()}
    for key in UNIT_KEYS:
        if (units := told.get(key, [])) and (len(units) > 1 or says_a_unit(units[0])):
            return units
    return []


def _units_of_fields(of: Mapping[str, Value], columns: Sequence[str]) -> dict[str, str]:
    """Return the units of the columns of a table as PyTables writes them: ``FIELD_0_UNITS``."""
    found: dict[str, str] = {}
    for key, value in of.items():
        field = _FIELD.fullmatch(key)
        units = texts_in(value)
        if field and len(units) == 1 and says_a_unit(units[0]) and int(field[1]) < len(columns):
            name = of.get(f"FIELD_{field[1]}_NAME")
            found[name if isinstance(name, str) and name in columns else columns[int(field[1])]] = units[0]
    return found


def _start_s(of: Mapping[str, Value]) -> float | None:
    """Return the instant of the first sample: s, or a date and time of ISO 8601, of UTC where it has no zone."""
    for key, value in of.items():
        if plain(key) not in START_KEYS:
            continue
        number = number_in(value)
        if number is None and isinstance(value, str):
            with suppress(ValueError):
                instant = datetime.fromisoformat(value)
                number = (instant if instant.tzinfo else instant.replace(tzinfo=UTC)).timestamp()
        if number is not None and np.isfinite(number):
            return number
    return None


def _unread(values: NDArray[np.generic], of: Mapping[str, Value]) -> Iterator[str]:
    """Yield in words what cannot be followed."""
    for key, value in of.items():
        if key in ("scale_factor", "add_offset") and number_in(value) is None:
            yield f"has {key} {value!r}, which is not a number"
        if remark := factor_remark(key, value, "the attribute"):
            yield remark
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
    low, high = (number_in(of.get("valid_min")), number_in(of.get("valid_max"))) if pair.size != 2 else map(float, pair)
    return -np.inf if low is None else low, np.inf if high is None else high
