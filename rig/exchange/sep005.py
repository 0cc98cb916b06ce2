"""Time series of SEP005 (SDyPy), in memory, as data that a mapping describes."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from identification import IdentificationError
from identification.mapping import even_sampling, si_of
from rig.exchange.child_reading import ImportFailed
from rig.exchange.file_data import ChannelFacts, FileData, side_by_side
from rig.system.text_files import read_text
from vibrolock.arrays import Float

_LARGEST_JSON_BYTES = 500_000_000  # largest file that is read, bytes; chosen
_MAX_RATE_HZ = 1e100  # largest sample rate, Hz; chosen: any number with which one can still calculate
_SAME_RATE = 1e-6  # relative difference of sample rates that count as one; chosen


def series_in(path: Path) -> FileData:
    """Return what `data_of_series` makes of the series in a JSON file; raise `ImportFailed` as well if there are none."""
    try:
        series = json.loads(read_text(path, _LARGEST_JSON_BYTES, ImportFailed))
    except (ValueError, RecursionError) as error:
        raise ImportFailed(f"{path}: is no JSON ({error})") from None
    if not isinstance(series, list) or not all(isinstance(one, Mapping) for one in series):
        raise ImportFailed(
            f"{path}: is no list of SEP005 time series, dictionaries with data, name, unit_str, fs or time"
        )
    return data_of_series(series)


def data_of_series(series: Sequence[Mapping[str, object]]) -> FileData:
    """Return time series by name, in SI where their unit is understood, as a mapping takes them.

    Series of one name are the records (realisations) of one channel, in their order: float64[n, n_records], as long as the
    shortest. A unit that is not understood is left out. Raises `ImportFailed` for what does not follow SEP005, for uneven
    sampling and for different rates.
    """
    if isinstance(series, Mapping) or not series:
        raise ImportFailed("series: allowed is a list of dictionaries, one a signal")
    rates = [_rate(one, number) for number, one in enumerate(series)]
    if max(rates) / min(rates) - 1.0 > _SAME_RATE:
        raise ImportFailed(f"series: sample rates from {min(rates):g} to {max(rates):g} Hz; wanted is one")
    records: dict[str, list[Float]] = {}
    units: dict[str, str] = {}
    for number, one in enumerate(series):
        name, given = (_text(one, key, number) for key in ("name", "unit_str"))
        try:
            unit, factor = si_of(given, name)
        except IdentificationError:
            unit, factor = "", 1.0
        if units.setdefault(name, unit) != unit:
            raise ImportFailed(f"{name} was in {units[name]!r} before", field=f"series[{number}].unit_str", value=given)
        records.setdefault(name, []).append(_data(one, number) * factor)
    columns = {name: side_by_side(found) for name, found in records.items()}
    channels = {name: ChannelFacts(name=name, unit=unit, in_si=True) for name, unit in units.items() if unit}
    return FileData(values={**columns}, channels=channels, sample_rate_hz=rates[0])


def _text(one: Mapping[str, object], key: str, number: int) -> str:
    if not isinstance(value := one.get(key), str):
        raise ImportFailed(field=f"series[{number}].{key}", value=value, allowed="a text")
    return value


def _data(one: Mapping[str, object], number: int) -> Float:
    try:
        data = np.asarray(one["data"], np.float64)
    except (KeyError, TypeError, ValueError, OverflowError):
        raise ImportFailed(f"series[{number}].data: allowed is a list of numbers") from None
    if data.ndim != 1 or data.size < 2:
        raise ImportFailed(f"series[{number}].data: has shape {data.shape}, allowed is (n,) with n from 2")
    return data


def _rate(one: Mapping[str, object], number: int) -> float:
    data, fs, time = _data(one, number), one.get("fs"), one.get("time")
    if fs is None and time is None:
        raise ImportFailed(f"series[{number}].fs: is missing, and so is time; wanted is one of them")
    if fs is None:
        fs = _rate_of(time, data)
        if fs is None:
            raise ImportFailed(
                f"series[{number}].time: allowed are evenly spaced instants that increase, one for each of the data"
            )
    if isinstance(fs, bool) or not isinstance(fs, int | float | np.number) or not 0.0 < fs < _MAX_RATE_HZ:
        raise ImportFailed(field=f"series[{number}].fs", value=fs, allowed="a number above 0")
    return float(fs)


def _rate_of(time: object, data: Float) -> float | None:
    """Return the sample rate, Hz; None if these are no instants of evenly spaced samples."""
    try:
        instants = np.asarray(time, np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    found = even_sampling(instants) if instants.shape == data.shape else None
    return None if found is None else found.rate_hz
