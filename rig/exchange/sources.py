"""Files of others as nested dictionaries of arrays, whatever their format, as mappings take them."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.errors import ConfigurationError
from rig.exchange.child_reading import ImportFailed, read_in_child

if TYPE_CHECKING:
    from identification.mapping.csv_layout import CsvLayout

__all__ = ["EXPORTS", "FORMATS", "format_of", "read_data"]

FORMATS = {
    "mat": (".mat",),
    "uff": (".uff", ".unv", ".uf", ".bunv"),
    "csv": (".csv", ".txt", ".tsv"),
    "hdf5": (".h5", ".hdf5", ".hdf", ".he5"),
    "wav": (".wav", ".wave"),
    "tdms": (".tdms",),
    "mdf4": (".mf4",),
    "sep005": (".json",),
}
"""Formats that are read, with the suffixes that identify them."""
EXPORTS = ("mat", "uff", "csv")
"""Formats that are written."""

_LARGEST_JSON_BYTES = 500_000_000


def format_of(path: Path, given: str, option: str, known: tuple[str, ...] = tuple(FORMATS)) -> str:
    """Return the given format, or else the one for the suffix of ``path``; raise `ConfigurationError` if it is unknown."""
    if given:
        if given not in known:
            raise ConfigurationError(f"{option} = {given!r}: allowed is {', '.join(known)}")
        return given
    for name in known:
        if path.suffix.lower() in FORMATS[name]:
            return name
    raise ConfigurationError(f"{path}: the ending says no format; give {option}, one of {', '.join(known)}")


def read_data(path: Path, format_: str, *, units: str = "", layout: "CsvLayout | None" = None) -> dict[str, Any]:
    """Return what is in a file.

    Besides the values by name, the dictionary may have ``sample_rate_hz`` (Hz) or, by name, ``__rates_hz__`` and
    ``__starts_s__`` (s); ``units``, by name, of values that are in SI already, or ``__file_units__`` of values that are as the
    file has them.

    Parameters
    ----------
    path
        The file.
    format_
        One of `FORMATS`.
    units
        Of a universal file, see `rig.exchange.reading.import_file`.
    layout
        Of a CSV file without one line of names.

    Raises
    ------
    ImportFailed
        If the file cannot be read.
    """
    if layout is not None and format_ != "csv":
        raise ConfigurationError(f"csv: is for CSV files, {path} is read as {format_}")
    readers: dict[str, Callable[[], dict[str, Any]]] = {
        "mat": lambda: _mat(path),
        "uff": lambda: _uff(path, units),
        "csv": lambda: _csv(path, layout),
        "sep005": lambda: _sep005(path),
    }
    return readers.get(format_, lambda: _foreign(path, format_))()


def _mat(path: Path) -> dict[str, Any]:
    from rig.exchange.mat import read_mat

    return read_mat(path)


def _uff(path: Path, units: str) -> dict[str, Any]:
    from rig.exchange.uff.reading import read_uff, time_data_in

    return time_data_in(read_uff(path), units)


def _csv(path: Path, layout: "CsvLayout | None") -> dict[str, Any]:
    from rig.exchange.csv import read_csv, table_of_ours, units_of_csv

    if table_of_ours(path) is not None and layout is None:
        return read_csv(path)
    return {**read_csv(path, layout), "__file_units__": units_of_csv(path) if layout is None else {}}


def _sep005(path: Path) -> dict[str, Any]:
    import json

    from rig.exchange.sep005 import data_of_series
    from rig.system.text_files import read_text

    try:
        series = json.loads(read_text(path, _LARGEST_JSON_BYTES, ImportFailed))
    except (ValueError, RecursionError) as error:
        raise ImportFailed(f"{path}: is no JSON ({error})") from None
    if not isinstance(series, list) or not all(isinstance(one, Mapping) for one in series):
        raise ImportFailed(
            f"{path}: is no list of SEP005 time series, dictionaries with data, name, unit_str, fs or time"
        )
    return data_of_series(series)


def _foreign(path: Path, format_: str) -> dict[str, Any]:
    """Return what a child process reads; names within groups of HDF5 files also in full, joined by ``/``.

    The units of HDF5 files are attributes called ``units`` or ``unit``.
    """
    from rig.exchange.foreign.process import NAMES

    data = read_in_child("rig.exchange.foreign.process", path, NAMES[format_], format_)
    if format_ != "hdf5":
        return data
    if data.get("@format") == "vibrolock":
        raise ImportFailed(f"{path}: is a file of this program, of kind {data.get('@kind')}; it needs no import")
    full = {**_in_full(data, ""), **data}
    units = {name: full.get(f"{name}@units", full.get(f"{name}@unit")) for name in full if "@" not in name}
    return {**full, "__file_units__": {name: unit for name, unit in units.items() if isinstance(unit, str)}}


def _in_full(group: Mapping[str, Any], before: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in group.items():
        if isinstance(value, Mapping):
            found |= _in_full(value, f"{before}{name}/")
        elif before:
            found[f"{before}{name}"] = value
    return found
