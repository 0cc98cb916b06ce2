"""Read measurements and models from files of other programs."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.bench.configuration import read_toml, validated
from rig.errors import ConfigurationError
from rig.exchange.mat import ImportFailed, read_mat, structures_of_ours
from rig.text.printable import shown

if TYPE_CHECKING:
    from identification import FrequencyResponse, FrequencyResponseMatrix, PeriodicSpectra

__all__ = [
    "FORMATS",
    "ImportFailed",
    "format_of",
    "import_file",
    "import_sep005",
    "read_frequency_responses",
    "read_mapping",
]

FORMATS = {"mat": (".mat",), "uff": (".uff", ".unv", ".uf", ".bunv"), "csv": (".csv", ".txt")}
"""Formats with the suffixes that identify them."""

_DEFAULT_KIND = "frequency-responses"


def format_of(path: Path, given: str, option: str) -> str:
    """Return the given format, or else the one for the suffix of ``path``; raise `ConfigurationError` if it is unknown."""
    if given:
        if given not in FORMATS:
            raise ConfigurationError(f"{option} = {given!r}: allowed is {', '.join(FORMATS)}")
        return given
    for name, endings in FORMATS.items():
        if path.suffix.lower() in endings:
            return name
    raise ConfigurationError(f"{path}: the ending says no format; give {option}, one of {', '.join(FORMATS)}")


def import_file(
    path: Path, format_: str = "", mapping: Path | None = None, *, units: str = "", drive: str = "", item: int = 0
) -> Any:
    """Read the measurement or model in a file.

    Parameters
    ----------
    path
        The file.
    format_
        ``mat``, ``uff`` or ``csv``; by the suffix of ``path`` if empty.
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
    from identification.errors import IdentificationError

    reader = {"mat": _from_mat, "uff": _from_uff, "csv": _from_csv}[format_of(path, format_, "`format`")]
    try:
        return reader(path, mapping, {"units": units, "drive": drive, "item": item})
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
    from identification.errors import IdentificationError
    from rig.exchange.sep005 import data_of_series

    try:
        return _mapped(data_of_series(series), Path(mapping))
    except IdentificationError as error:
        raise ImportFailed(f"the series do not fit {mapping}: {error}") from None


def _mappings() -> dict[str, tuple[Any, Callable[[Any, Any], Any]]]:
    """Return model and reader of every kind of mapping."""
    import identification as i

    return {
        _DEFAULT_KIND: (i.FrequencyResponseMapping, i.map_frequency_responses),
        "frequency-response-matrix": (i.ResponseMatrixMapping, i.map_response_matrix),
        "multisine": (i.MultisineMapping, i.map_multisine),
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


def _mapped(data: Mapping[str, Any], mapping_path: Path) -> Any:
    """Apply a mapping to data; spectra are converted to frequency responses."""
    mapping = read_mapping(mapping_path)
    _check_units(data, mapping)
    found = _mappings()[mapping.kind][1](data, mapping)
    return _response_matrix(found, mapping.instrument, mapping.specimen) if mapping.kind == "multisine" else found


def _check_units(data: Mapping[str, Any], mapping: Any) -> None:
    """Refuse units in a mapping that contradict those of a universal file, whose data is already converted to SI."""
    from identification.mapping.units import si_of

    for channel in getattr(mapping, "channels", ()):
        told = data["units"].get(channel.value) if isinstance(data.get("units"), dict) else None
        if isinstance(told, str) and told and si_of(channel.unit, channel.name) != si_of(told, channel.name):
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


def _from_mat(path: Path, mapping: Path | None, options: Mapping[str, Any]) -> Any:
    from rig.exchange.kinds import put_together

    if mapping is not None:
        read_mapping(mapping)  # errors in the mapping are reported before the file is read, which may be large
        return _mapped(read_mat(path), mapping)
    ours = structures_of_ours(read_mat(path))
    if not ours:
        raise ImportFailed(f"{path}: was not written by this package; say by `mapping` what is where in it")
    return put_together(*_chosen(ours, path, options["item"]))


def _from_csv(path: Path, mapping: Path | None, options: Mapping[str, Any]) -> Any:
    from rig.exchange.csv import read_csv, table_of_ours
    from rig.exchange.kinds import put_together

    if mapping is not None:
        read_mapping(mapping)
        return _mapped(read_csv(path), mapping)
    ours = table_of_ours(path)
    if ours is None:
        raise ImportFailed(f"{path}: was not written by this package; say by `mapping` what is in its columns")
    return put_together(*ours)


def _from_uff(path: Path, mapping: Path | None, options: Mapping[str, Any]) -> Any:
    from rig.exchange.uff.modes import modes_in
    from rig.exchange.uff.reading import read_uff, time_data_in
    from rig.exchange.uff.responses import responses_in

    units = options["units"]
    if units not in ("", "labels", "file", "si"):
        raise ConfigurationError(f"`units` = {units!r}: allowed is labels, file or si")
    if mapping is not None:
        read_mapping(mapping)
    datasets = read_uff(path)
    if mapping is not None:
        return _mapped(time_data_in(datasets, units), mapping)
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
        raise ImportFailed(f"{path}: holds time data; say by `mapping` with kind = 'multisine' what was played")
    raise ImportFailed(f"{path}: holds neither frequency responses (58, type 4), modes (55) nor time data (58, type 1)")
