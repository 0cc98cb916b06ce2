"""Identify models from recordings."""

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.errors import ConfigurationError
from rig.results.kind import Progress
from rig.results.kinds import identifications

if TYPE_CHECKING:
    from rig.results.options import Options


def identify_model(paths: Sequence[Path], options: "Options", *, progress: Progress | None = None) -> Any:
    """Identify a model in recordings or imported measurements. Its kind is that of the options.

    ``progress`` is called after every iteration when a PNLSS model is fitted. Raises `RecordingError` for files with other
    contents, `identification.IdentificationError` if the data does not allow the identification.
    """
    for path, other in combinations(paths, 2):
        if path.exists() and other.exists() and path.samefile(other):
            raise ConfigurationError(f"{other}: is given twice; each file once")
    return identifications()[options.kind].identify(paths, options, progress)
