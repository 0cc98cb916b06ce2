"""Files of others as nested dictionaries of arrays, whatever their format, as mappings take them."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.errors import ConfigurationError
from rig.exchange.child_reading import NAMES, ImportFailed, read_in_child

if TYPE_CHECKING:
    from identification.mapping import CsvLayout

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
    options = {} if layout is None else {"layout": layout.model_dump(mode="json")}
    found: dict[str, Any] = read_in_child("csv", path, NAMES["csv"], **options)
    return found


def _sep005(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = read_in_child("sep005", path, NAMES["sep005"])
    return found


def _foreign(path: Path, format_: str) -> dict[str, Any]:
    """Return what a child process reads; names within groups of HDF5 files also in full, joined by ``/``.

    The units of HDF5 files are attributes called ``units`` or ``unit``.
    """
    data: dict[str, Any] = read_in_child(format_, path, NAMES[format_])
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
