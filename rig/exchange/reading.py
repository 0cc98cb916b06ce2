"""Read measurements and models from files of other programs."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.bench.configuration import read_toml, validated
from rig.errors import ConfigurationError
from rig.exchange.child_reading import NAMES, ImportFailed, read_in_child
from rig.exchange.mat import read_mat, structures_of_ours
from rig.exchange.sources import format_of, read_data
from vibrolock.printable import shown

if TYPE_CHECKING:
    from identification import FrequencyResponse, FrequencyResponseMatrix, PeriodicSpectra

_DEFAULT_KIND = "frequency-responses"
_PROPOSAL = "say by `mapping` what is where in it; `rig new mapping` proposes one for time data"


def import_file(
    path: Path, format_: str = "", mapping: Path | None = None, *, units: str = "", drive: str = "", item: int = 0
) -> Any:
    """Read the measurement or model in a file.

    Parameters
    ----------
    path
        The file. Further files that a mapping of time data names are beside it.
    format_
        ``mat``, ``uff``, ``csv``, ``hdf5``, ``wav``, ``tdms``, ``mdf4`` or ``sep005``; by the suffix of ``path`` if empty.
    mapping
        TOML file that describes the contents. Required unless this package wrote the file, or it is a universal file with
        frequency responses or modes.
    units
        For universal files: ``labels``, ``file`` or ``si`` if labels and dataset 164 disagree or are missing.
    drive
        For universal files with modes: the degree of freedom at which the force acts, such as ``1+Z``.
    item
        Number of the object if there are several, from 1; 0 if there is only one.

    Raises
    ------
    ConfigurationError
        If the mapping cannot be read or has a value that is not allowed.
    ImportFailed
        If the file cannot be read or does not contain what the mapping says.
    """
    from identification import IdentificationError

    form = format_of(path, format_, "`format`")
    readers = {"mat": _from_mat, "uff": _from_uff, "csv": _from_csv}
    if units not in ("", "labels", "file", "si"):
        raise ConfigurationError(f"`units` = {units!r}: allowed is labels, file or si")
    try:
        if mapping is not None:
            return _read_with(mapping, path, form, units)
        if form == "hdf5":
            read_data(path, form)  # refuses files of ours and damaged ones
        if form not in readers:
            raise ImportFailed(f"{path}: {_PROPOSAL}")
        return readers[form](path, {"units": units, "drive": drive, "item": item})
    except ImportFailed as error:
        if str(path) in str(error):
            raise
        raise ImportFailed(f"{path}: {error}") from None
    except IdentificationError as error:
        fit = "" if mapping is None else f" does not fit {mapping}"
        raise ImportFailed(f"{path}{fit}: {error}") from None


def read_frequency_responses(mat_path: str | Path, mapping_path: str | Path) -> "tuple[FrequencyResponse, ...]":
    """Read stepped-sine frequency responses from a MAT file (up to version 7), in SI; errors are as for `import_file`."""
    found: tuple[FrequencyResponse, ...] = import_file(Path(mat_path), "mat", Path(mapping_path))
    return found


def import_sep005(series: Sequence[Mapping[str, Any]], mapping: str | Path) -> Any:
    """Read the measurement in time series of SEP005 (SDyPy), which a mapping describes by their names.

    Parameters
    ----------
    series
        Dictionaries with ``data``, ``name``, ``unit_str`` and ``fs`` or ``time``. Series of one name are realisations.
    mapping
        TOML file, such as one of ``kind = "multisine"``.

    Errors are those of `import_file`.
    """
    from identification import IdentificationError
    from rig.exchange.sep005 import data_of_series

    try:
        return _mapped(data_of_series(series), read_mapping(mapping))
    except IdentificationError as error:
        raise ImportFailed(f"the series do not fit {mapping}: {error}") from None


def _mappings() -> dict[str, tuple[Any, Callable[[Any, Any], Any]]]:
    """Return model and reader of every kind of mapping."""
    import identification as i

    return {
        _DEFAULT_KIND: (i.FrequencyResponseMapping, i.map_frequency_responses),
        "frequency-response-matrix": (i.ResponseMatrixMapping, i.map_response_matrix),
        "multisine": (i.MultisineMapping, i.map_multisine),
        "time-data": (i.TimeDataMapping, i.map_time_data),
        "hammer-test": (i.HammerTestMapping, i.map_hammer_test),
        "backbone": (i.BackboneMapping, i.map_backbone),
        "pnlss": (i.PnlssMapping, i.map_pnlss),
        "nonlinear-mode": (i.NonlinearModeMapping, i.map_nonlinear_mode),
    }


def read_mapping(path: str | Path) -> Any:
    """Read a mapping from TOML; raise `ConfigurationError` that names each wrong key and its value."""
    table = read_toml(Path(path))
    kind, known = table.get("kind", _DEFAULT_KIND), _mappings()
    if not isinstance(kind, str) or kind not in known:
        raise ConfigurationError(f"{path}: kind = {shown(kind)}: allowed is {', '.join(known)}")
    return validated(known[kind][0], table, str(path))


def _read_with(mapping_path: Path, path: Path, form: str, units: str) -> Any:
    """Read a file, and the further files that the mapping names, and apply the mapping."""
    mapping = read_mapping(
        mapping_path
    )  # errors in the mapping are reported before the file is read, which may be large
    layout = getattr(mapping, "csv", None)
    data = read_data(path, form, units=units, layout=layout)
    files: dict[str, Any] = {}
    for name in dict.fromkeys(getattr(channel, "file", "") for channel in getattr(mapping, "channels", ())):
        if name:
            beside = path.parent / name
            form = format_of(beside, "", "another ending of `file`")
            files[name] = read_data(beside, form, units=units, layout=layout if form == "csv" else None)
    return _mapped(data, mapping, files)


def _mapped(data: Mapping[str, Any], mapping: Any, files: Mapping[str, Any] | None = None) -> Any:
    """Apply a mapping to data; spectra are converted to frequency responses."""
    from identification import map_time_data

    _check_units(data, mapping, files or {})
    if mapping.kind == "time-data":
        return map_time_data(data, mapping, files)
    found = _mappings()[mapping.kind][1](data, mapping)
    return _response_matrix(found, mapping.instrument, mapping.specimen) if mapping.kind == "multisine" else found


def _check_units(data: Mapping[str, Any], mapping: Any, files: Mapping[str, Any]) -> None:
    """Refuse units in a mapping that contradict those that the file itself tells of its values."""
    from identification import IdentificationError
    from identification.mapping import si_of

    for channel in getattr(mapping, "channels", ()):
        of_file = files.get(getattr(channel, "file", ""), data)
        for key in ("units", "__file_units__"):
            told = of_file[key].get(channel.value) if isinstance(of_file.get(key), dict) else None
            if not isinstance(told, str) or not told or getattr(channel, "scale", 1.0) != 1.0:
                continue  # with a scale, the numbers are another quantity: volts of a sensor, for example
            try:
                known = si_of(told, channel.name)
            except IdentificationError:
                continue
            if si_of(channel.unit, channel.name) != known:
                raise ImportFailed(
                    f"channels.{channel.name}.unit = '{channel.unit}': the file's own units make it {told}; write that"
                )


def _response_matrix(spectra: "PeriodicSpectra", instrument: str, specimen: str) -> "FrequencyResponseMatrix":
    """Return the frequency responses of all motions to the force, with an instrument or as H1."""
    from identification import best_linear_approximation

    if not instrument:
        return best_linear_approximation(spectra, estimator="H1", specimen=specimen)
    return best_linear_approximation(spectra, instruments=(instrument,), specimen=specimen)


def _chosen(found: list[Any], path: Path, item: int) -> Any:
    if not 0 <= item <= len(found) or (item == 0 and len(found) > 1):
        raise ImportFailed(f"{path}: holds {len(found)} objects; choose by `item` 1 to {len(found)}")
    return found[max(item - 1, 0)]


def _from_mat(path: Path, options: Mapping[str, Any]) -> Any:
    from rig.exchange.kinds import put_together

    ours = structures_of_ours(read_mat(path))
    if not ours:
        raise ImportFailed(f"{path}: was not written by this package; {_PROPOSAL}")
    return put_together(*_chosen(ours, path, options["item"]))


def _from_csv(path: Path, options: Mapping[str, Any]) -> Any:
    from rig.exchange.kinds import put_together

    ours = read_in_child("table of ours", path, NAMES["csv"])
    if ours is None:
        raise ImportFailed(f"{path}: was not written by this package; {_PROPOSAL}")
    return put_together(*ours)


def _from_uff(path: Path, options: Mapping[str, Any]) -> Any:
    from rig.exchange.uff.modes import modes_in
    from rig.exchange.uff.reading import read_uff
    from rig.exchange.uff.responses import responses_in

    units = options["units"]
    datasets = read_uff(path)
    kinds = {(dataset["type"], dataset.get("func_type", 0)) for dataset in datasets}
    modes = (55, 0) in kinds
    if modes and (58, 4) in kinds and not options["item"]:
        raise ImportFailed(f"{path}: holds modes and frequency responses; choose by `item` 1 (modes) or 2 (responses)")
    if modes and options["item"] in (0, 1):
        return modes_in(datasets, units, options["drive"])
    if (58, 4) in kinds:
        before = [None] if modes else []  # the modes are item 1
        return _chosen([*before, *responses_in(datasets, units)], path, options["item"])
    if modes:
        raise ImportFailed(f"{path}: holds modes alone; choose by `item` 1")
    if (58, 1) in kinds:
        raise ImportFailed(f"{path}: holds time data; {_PROPOSAL}")
    raise ImportFailed(f"{path}: holds neither frequency responses (58, type 4), modes (55) nor time data (58, type 1)")
