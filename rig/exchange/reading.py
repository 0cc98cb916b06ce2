"""Read measurements and models from files of other programs."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from rig.bench.configuration import read_toml, validated
from rig.errors import ConfigurationError
from rig.exchange.child_reading import NAMES, NOT_OURS, PROPOSAL, ImportFailed, read_in_child
from rig.exchange.facts import for_mapping
from rig.exchange.file_data import FileData, StoredObject
from rig.exchange.mat import read_mat, stored_objects
from rig.exchange.sources import format_of, read_data

if TYPE_CHECKING:
    import identification as i
    from identification.mapping import MeasurementMapping
    from rig.results.time_data.series import TimeData

    Measurement = (
        i.Backbone
        | tuple[i.FrequencyResponse, ...]
        | i.FrequencyResponseMatrix
        | i.HammerTest
        | i.LinearModes
        | i.NonlinearMode
        | i.PnlssModel
        | i.StructuredModel
        | i.TimeRecords
        | i.Transient
        | TimeData
    )

_DEFAULT_KIND = "frequency-responses"  # kind of a mapping that names none
T = TypeVar("T")  # one of several objects in a file


def import_file(
    path: Path, format_: str = "", mapping: Path | None = None, *, units: str = "", drive: str = "", item: int = 0
) -> "Measurement":
    """Read the measurement or model in a file.

    Parameters
    ----------
    path
        The file. Further files that a mapping of time data names are beside it.
    format_
        ``mat``, ``uff``, ``csv``, ``hdf5``, ``wav``, ``tdms``, ``mdf4``, ``lvm``, ``npz``, ``xlsx`` or ``sep005``; by the
        suffix of ``path`` if empty.
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
    if units not in ("", "labels", "file", "si"):
        raise ConfigurationError(field="units", value=units, allowed="labels, file or si")
    try:
        if mapping is not None:
            return _read_with(mapping, path, form, units)
        return _read_without(path, form, units, drive, item)
    except ImportFailed as error:
        if str(path) in str(error):
            raise
        raise ImportFailed.of(error, where=path) from None
    except IdentificationError as error:
        fit = "" if mapping is None else f" does not fit {mapping}"
        raise ImportFailed.of(error, where="" if str(path) in str(error) else f"{path}{fit}") from None


def read_frequency_responses(mat_path: str | Path, mapping_path: str | Path) -> "tuple[i.FrequencyResponse, ...]":
    """Read stepped-sine frequency responses from a MAT file (up to version 7), in SI; errors are as for `import_file`."""
    found = import_file(Path(mat_path), "mat", Path(mapping_path))
    if not isinstance(found, tuple):
        raise ConfigurationError(where=mapping_path, field="kind", allowed=_DEFAULT_KIND)
    return found


def import_sep005(series: Sequence[Mapping[str, object]], mapping: str | Path) -> "Measurement":
    """Read the measurement in time series of SEP005 (SDyPy), which a mapping, a TOML file, describes by their names.

    ``series`` are dictionaries with ``data``, ``name``, ``unit_str`` and ``fs`` or ``time``; those of one name are
    realisations. Errors are those of `import_file`.
    """
    from identification import IdentificationError
    from rig.exchange.sep005 import data_of_series

    try:
        return _mapped(data_of_series(series), read_mapping(mapping), {})
    except IdentificationError as error:
        raise ImportFailed.of(error, where=f"the series do not fit {mapping}") from None


def _kinds() -> "dict[str, tuple[type[MeasurementMapping], Callable[..., Measurement]]]":
    """Return the mappings by kind, each with the function that applies it to values."""
    import identification as i

    return {
        _DEFAULT_KIND: (i.FrequencyResponseMapping, i.map_frequency_responses),
        "frequency-response-matrix": (i.ResponseMatrixMapping, i.map_response_matrix),
        "multisine": (i.MultisineMapping, _response_matrix),
        "time-data": (i.TimeDataMapping, i.map_time_data),
        "hammer-test": (i.HammerTestMapping, i.map_hammer_test),
        "backbone": (i.BackboneMapping, i.map_backbone),
        "pnlss": (i.PnlssMapping, i.map_pnlss),
        "nonlinear-mode": (i.NonlinearModeMapping, i.map_nonlinear_mode),
    }


def read_mapping(path: str | Path) -> "MeasurementMapping":
    """Read a mapping from TOML; raise `ConfigurationError` that names each wrong key and its value."""
    table, kinds = read_toml(Path(path)), _kinds()
    kind = table.get("kind", _DEFAULT_KIND)
    if not isinstance(kind, str) or kind not in kinds:
        raise ConfigurationError(where=path, field="kind", value=kind, allowed=kinds)
    return validated(kinds[kind][0], table, str(path))


def _read_with(mapping_path: Path, path: Path, form: str, units: str) -> "Measurement":
    from identification import TimeDataMapping

    mapping = read_mapping(mapping_path)  # before the file, which may be large
    if not isinstance(mapping, TimeDataMapping):
        return _mapped(read_data(path, form, units=units), mapping, {})
    data = read_data(path, form, units=units, layout=mapping.csv)
    files: dict[str, FileData] = {}
    for name in dict.fromkeys(channel.file for channel in mapping.channels if channel.file):
        beside = path.parent / name
        form = format_of(beside, "", "another ending of `file`")
        files[name] = read_data(beside, form, units=units, layout=mapping.csv if form == "csv" else None)
    return _mapped(data, mapping, files)


def _mapped(data: FileData, mapping: "MeasurementMapping", files: Mapping[str, FileData]) -> "Measurement":
    from identification import TimeDataMapping

    values, further = for_mapping(data, mapping, files)
    apply = next(apply for kind, apply in _kinds().values() if isinstance(mapping, kind))
    return apply(values, mapping, *([further] if isinstance(mapping, TimeDataMapping) else []))


def _response_matrix(values: Mapping[str, object], mapping: "i.MultisineMapping") -> "i.FrequencyResponseMatrix":
    """Return the frequency responses of all motions to the force, with an instrument or as H1."""
    from identification import best_linear_approximation, map_multisine

    spectra = map_multisine(values, mapping)
    if not mapping.instrument:
        return best_linear_approximation(spectra, estimator="H1", specimen=mapping.specimen)
    return best_linear_approximation(spectra, instruments=(mapping.instrument,), specimen=mapping.specimen)


def _chosen(found: Sequence[T], path: Path, item: int) -> T:
    if not 0 <= item <= len(found) or (item == 0 and len(found) > 1):
        raise ImportFailed(f"{path}: holds {len(found)} objects; choose by `item` 1 to {len(found)}")
    return found[max(item - 1, 0)]


def _read_without(path: Path, form: str, units: str, drive: str, item: int) -> "Measurement":
    from rig.exchange.conversion import decoded

    match form:
        case "uff":
            return _from_uff(path, units, drive, item)
        case "mat":
            if not (ours := stored_objects(read_mat(path))):
                raise ImportFailed(f"{path}: {NOT_OURS}")
            one = _chosen(ours, path, item)
        case "csv":
            one = read_in_child("table of ours", path, NAMES["csv"], StoredObject)
        case "hdf5":
            read_data(path, form)  # refuses files of ours and damaged ones
            raise ImportFailed(f"{path}: {PROPOSAL}")
        case _:
            raise ImportFailed(f"{path}: {PROPOSAL}")
    found: Measurement = decoded(one.kind, one.arrays, one.attributes)
    return found


def _from_uff(path: Path, units: str, drive: str, item: int) -> "Measurement":
    from rig.exchange.uff.modes import modes_in
    from rig.exchange.uff.reading import read_uff
    from rig.exchange.uff.responses import responses_in
    from rig.exchange.universal_file import FREQUENCY_RESPONSE, TIME_RESPONSE

    file = read_uff(path)
    modes, responses = file.shapes > 0, bool(file.of_type(FREQUENCY_RESPONSE))
    if modes and responses and not item:
        raise ImportFailed(f"{path}: holds modes and frequency responses; choose by `item` 1 (modes) or 2 (responses)")
    if modes and item in (0, 1):
        return modes_in(file, units, drive)
    if responses:
        found: list[Measurement | None] = [None] if modes else []  # the modes are item 1
        chosen = _chosen([*found, *responses_in(file, units)], path, item)
        if chosen is not None:
            return chosen
    if modes:
        raise ImportFailed(f"{path}: holds modes alone; choose by `item` 1")
    if file.of_type(TIME_RESPONSE):
        raise ImportFailed(f"{path}: holds time data; {PROPOSAL}")
    raise ImportFailed(f"{path}: holds neither frequency responses (58, type 4), modes (55) nor time data (58, type 1)")
