"""Files of other programs, whatever their format, as mappings take them."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rig.errors import ConfigurationError
from rig.exchange.beside import facts_beside, merged
from rig.exchange.child_reading import NAMES, ImportFailed, read_in_child
from rig.exchange.file_data import FileData, from_variables, in_full
from rig.exchange.foreign.attributes import facts_of_attributes
from rig.exchange.uff.reading import read_uff
from rig.exchange.uff.time_data import time_data_in

if TYPE_CHECKING:
    from identification.mapping import CsvLayout

FORMATS = {
    "mat": (".mat",),
    "uff": (".uff", ".unv", ".uf", ".bunv"),
    "csv": (".csv", ".txt", ".tsv"),
    "hdf5": (".h5", ".hdf5", ".hdf", ".he5", ".nc", ".nc4"),
    "wav": (".wav", ".wave"),
    "tdms": (".tdms",),
    "mdf4": (".mf4",),
    "lvm": (".lvm",),
    "npz": (".npz",),
    "xlsx": (".xlsx", ".xlsm"),
    "sep005": (".json",),
}
"""Formats that are read, with the suffixes that identify them."""
EXPORTS = ("mat", "uff", "csv")
"""Formats that are written."""


def format_of(path: Path, given: str, option: str, known: tuple[str, ...] = tuple(FORMATS)) -> str:
    """Return the given format, or else the one for the suffix of ``path``; raise `ConfigurationError` if it is unknown."""
    if given:
        ConfigurationError.unless_one_of(option, given, known)
        return given
    for name in known:
        if path.suffix.lower() in FORMATS[name]:
            return name
    raise ConfigurationError(f"{path}: the ending says no format; give {option}, one of {', '.join(known)}")


def read_data(path: Path, format_: str, *, units: str = "", layout: "CsvLayout | None" = None) -> FileData:
    """Return what is in a file of one of `FORMATS`; raise `ImportFailed` if it cannot be read.

    ``units`` is the source of the units of a universal file, see `rig.exchange.reading.import_file`; ``layout`` that of a CSV
    file without one line of names.
    """
    if layout is not None and format_ != "csv":
        raise ConfigurationError(f"is for CSV files, {path} is read as {format_}", field="csv")
    if format_ == "uff":
        return time_data_in(read_uff(path), units)
    if layout is not None:
        return read_in_child("csv", path, NAMES["csv"], FileData, layout=layout.model_dump(mode="json"))
    data = read_in_child(format_, path, NAMES[format_], FileData)
    if format_ == "hdf5" and data.values.get("@format") == "vibrolock":
        kind = data.values.get("@kind")
        raise ImportFailed(f"{path}: is a file of this program, of kind {kind!s}; it needs no import")
    if format_ != "hdf5":
        return data
    full = {**dict(in_full(data.values)), **data.values}  # values within groups also by full names, units by attributes
    netcdf = path.suffix.lower() in (".nc", ".nc4")
    found = from_variables(full)
    channels = merged(found.channels, facts_beside(full), facts_of_attributes(full, netcdf=netcdf), data.channels)
    return replace(found, channels=channels, sample_rate_hz=data.sample_rate_hz)
