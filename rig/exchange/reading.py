"""Reading measurements from elsewhere: MAT files with a mapping file that says what is where."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.configuration import read_toml, validated
from rig.errors import RigError

if TYPE_CHECKING:
    from identification.frequency_responses import FrequencyResponse
    from identification.mapping import FrequencyResponseMapping

__all__ = ["ImportFailed", "read_frequency_responses", "read_mapping"]


class ImportFailed(RigError):  # noqa: N818 (says what happened)
    """A file of measurements cannot be read, or does not hold what its mapping says; the message names both."""


def read_frequency_responses(mat_path: str | Path, mapping_path: str | Path) -> "tuple[FrequencyResponse, ...]":
    """Stepped-sine frequency responses in a MAT file (up to version 7), in SI.

    Parameters
    ----------
    mat_path
        The MAT file.
    mapping_path
        TOML file with the keys of `identification.mapping.FrequencyResponseMapping`.

    Raises
    ------
    ConfigurationError
        If the mapping cannot be read or holds a value that is not allowed.
    ImportFailed
        If the MAT file cannot be read or does not hold what the mapping says.
    """
    from identification.errors import IdentificationError
    from identification.mapping import map_frequency_responses

    mapping = read_mapping(mapping_path)
    data = _read_mat(Path(mat_path))
    try:
        return map_frequency_responses(data, mapping)
    except IdentificationError as error:
        raise ImportFailed(f"{mat_path} does not fit {mapping_path}: {error}") from None


def read_mapping(path: str | Path) -> "FrequencyResponseMapping":
    """Read a mapping from TOML; raises `ConfigurationError` that names each wrong key and its value."""
    from identification.mapping import FrequencyResponseMapping

    return validated(FrequencyResponseMapping, read_toml(Path(path)), str(path))


def _read_mat(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    if not path.is_file():
        raise ImportFailed(f"{path}: there is no such file")
    try:
        data: dict[str, Any] = loadmat(str(path), simplify_cells=True, appendmat=False)
    except NotImplementedError:
        raise ImportFailed(f"{path}: is a MAT file of version 7.3; save it in MATLAB with save(..., '-v7')") from None
    except OSError as error:
        raise ImportFailed(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # the parser fails on damaged bytes in many ways, of no common class
        raise ImportFailed(f"{path}: is no MAT file, or a damaged one ({error})") from None
    return data
