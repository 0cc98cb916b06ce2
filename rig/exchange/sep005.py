"""Time series of SEP005 (SDyPy), in memory, as data that a mapping describes."""

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from identification import IdentificationError
from identification.mapping import EvenSampling, even_sampling, si_of
from rig.exchange.child_reading import ImportFailed
from rig.exchange.file_data import ChannelFacts, FileData, side_by_side
from rig.system.text_files import read_text
from vibrolock.arrays import Float

_LARGEST_JSON_BYTES = 500_000_000  # largest file that is read, bytes; chosen
_MAX_RATE_HZ = 1e100  # largest sample rate, Hz; chosen: any number with which one can still calculate
_SAME_INSTANT_S = 1e-6  # difference of start times that count as one, s; chosen: that of time stamps in microseconds
_SAME_RATE = 1e-6  # relative difference of sample rates that count as one; chosen


def series_in(path: Path) -> FileData:
    """Return what `data_of_series` makes of the series in a JSON file; raise `ImportFailed` as well if there are none."""
    try:
        series = json.loads(read_text(path, _LARGEST_JSON_BYTES, ImportFailed))
    except (ValueError, RecursionError) as error:
        raise ImportFailed(f"{path}: is not JSON ({error})") from None
    if not isinstance(series, list) or not all(isinstance(one, Mapping) for one in series):
        raise ImportFailed(
            f"{path}: is not a list of SEP005 time series, dictionaries with data, name, unit_str, fs or time"
        )
    return data_of_series(series)


def data_of_series(series: Sequence[Mapping[str, object]]) -> FileData:
    """Return time series by name, in SI where their unit is understood, as a mapping takes them.

    Series of one name are the records (realisations) of one channel, in their order: float64[n, n_records], as long as the
    shortest. A unit that is not understood stays as it is. Raises `ImportFailed` for what does not follow SEP005, for uneven
    sampling and for different rates.
    """
    if isinstance(series, Mapping) or not series:
        raise ImportFailed("series: allowed is a list of dictionaries, one a signal")
    samplings = [_sampling(one, number) for number, one in enumerate(series)]
    rates = [sampling.rate_hz for sampling in samplings]
    if max(rates) / min(rates) - 1.0 > _SAME_RATE:
        raise ImportFailed(f"series: sample rates from {min(rates):g} to {max(rates):g} Hz; expected one")
    stamps = [_instant(one, number) for number, one in enumerate(series)]
    first = min((stamp for stamp in stamps if stamp is not None), default=0.0)
    instants = [0.0 if stamp is None else stamp - first for stamp in stamps]
    records: dict[str, list[Float]] = {}
    begins: dict[str, list[float]] = {}
    units: dict[str, tuple[str, bool]] = {}
    for number, (one, sampling) in enumerate(zip(series, samplings, strict=True)):
        name, given = (_text(one, key, number) for key in ("name", "unit_str"))
        try:
            unit, factor = si_of(given, name)
        except IdentificationError:
            unit, factor = given, 0.0
        if units.setdefault(name, (unit, factor > 0.0))[0] != unit:
            raise ImportFailed(
                f"{name} was in {units[name][0]!r} before", field=f"series[{number}].unit_str", value=given
            )
        records.setdefault(name, []).append(_data(one, number) * (factor or 1.0))
        begins.setdefault(name, []).append(instants[number] + sampling.start_s)
    starts, unlike = _starts(begins)
    return FileData(
        values={name: side_by_side(found) for name, found in records.items()},
        channels={
            name: ChannelFacts(name=name, unit=unit, in_si=in_si, start_s=starts[name], unread=unlike.get(name, ""))
            for name, (unit, in_si) in units.items()
        },
        sample_rate_hz=rates[0],
    )


def _starts(begins: Mapping[str, Sequence[float]]) -> tuple[dict[str, float], dict[str, str]]:
    """Return how much later than the first each channel begins, s, and words for those with which this differs by record."""
    earliest = [min(several[k] for several in begins.values() if k < len(several)) for k in range(_longest(begins))]
    later = {
        name: [at - first for at, first in zip(several, earliest, strict=False)] for name, several in begins.items()
    }
    unlike = "has records that begin at different times from those of other channels"
    return (
        {name: several[0] for name, several in later.items()},
        {name: unlike for name, several in later.items() if max(several) - min(several) > _SAME_INSTANT_S},
    )


def _longest(begins: Mapping[str, Sequence[float]]) -> int:
    return max(map(len, begins.values()))


def _instant(one: Mapping[str, object], number: int) -> float | None:
    """Return the instant of a series, s since 1970, a time without a zone being of UTC; None if it has none."""
    given = one.get("start_timestamp")
    if given is None:
        return None
    try:
        instant = given if isinstance(given, datetime) else datetime.fromisoformat(str(given))
    except ValueError:
        raise ImportFailed(
            field=f"series[{number}].start_timestamp", value=given, allowed="an instant of ISO 8601"
        ) from None
    return (instant if instant.tzinfo is not None else instant.replace(tzinfo=UTC)).timestamp()


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


def _sampling(one: Mapping[str, object], number: int) -> EvenSampling:
    data, fs, time = _data(one, number), one.get("fs"), one.get("time")
    if fs is None and time is None:
        raise ImportFailed(f"series[{number}].fs: is missing, and so is time; expected one of them")
    found = None if time is None else _of_instants(time, data)
    if time is not None and found is None:
        raise ImportFailed(
            f"series[{number}].time: allowed are evenly spaced instants that increase, one for each of the data"
        )
    if fs is None and found is not None:
        fs = found.rate_hz
    if isinstance(fs, bool) or not isinstance(fs, int | float | np.number) or not 0.0 < fs < _MAX_RATE_HZ:
        raise ImportFailed(field=f"series[{number}].fs", value=fs, allowed="a number above 0")
    if found is not None and abs(found.rate_hz / float(fs) - 1.0) > _SAME_RATE:
        raise ImportFailed(f"its time says {found.rate_hz:g} Hz", field=f"series[{number}].fs", value=fs)
    return EvenSampling(float(fs), 0.0 if found is None else found.start_s)


def _of_instants(time: object, data: Float) -> EvenSampling | None:
    """Return the sampling; None if these are no instants of evenly spaced samples."""
    try:
        instants = np.asarray(time, np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    return even_sampling(instants) if instants.shape == data.shape else None
