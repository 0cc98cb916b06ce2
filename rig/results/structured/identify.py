"""Identify structured models from recordings: modes, data, fit and errors."""

import time
from collections.abc import Sequence
from pathlib import Path

from identification import LinearModes, ModalAnalysis, fit_structured
from identification.common import one_specimen
from identification.models import linear_start
from rig.errors import RecordingError
from rig.recording.arrays import kind_of
from rig.results.files import load_as
from rig.results.kind import Progress
from rig.results.simulated.data_files import uses_of
from rig.results.simulated.fit_data import fit_data, fitted
from rig.results.structured.model import IdentifiedStructured
from rig.results.structured.options import MODES_OF_A_STRUCTURE, StructuredOptions

_KINDS = ("multisine", "sweep", "time-data")
"""Data that may begin at rest."""


def identify(
    paths: Sequence[Path], options: StructuredOptions, progress: Progress | None = None
) -> IdentifiedStructured:
    """Identify one model from all recordings together, beginning with the modes in a file.

    Raises `RecordingError` for files with other contents, `identification.IdentificationError` if the data does not allow the
    identification.
    """
    begun = time.perf_counter()
    modes = options.modes
    assert modes is not None
    found = _modes_in(modes)
    data = fit_data(paths, options, "structured", kinds=_KINDS)
    one_specimen(**{str(modes): found.specimen, str(paths[0]): data.training[0].specimen})
    known = options.suspension_stiffness_n_m
    fit, scatter = fitted(
        lambda training, validation: fit_structured(
            found,
            training,
            validation=validation,
            **options.arguments(),
            support=True if known is None else known,
            progress=progress,
        ),
        data,
        options.scatter,
    )
    identified = IdentifiedStructured(
        model=fit.model,
        fit=fit,
        scatter=scatter,
        linear=linear_start(found, data.training[0], fit.model.steps),
        seconds=time.perf_counter() - begun,
        notes=data.notes,
        data=data.fingerprint,
        uses=uses_of(data.training, data.validation),
    )
    return identified.judged(data.training, data.validation, recordings=data.runs)


def _modes_in(path: Path) -> LinearModes:
    if not path.exists() or (kind := kind_of(path)) != "linear-modes":
        what = f"is a file of kind {kind}" if path.exists() else "does not exist"
        raise RecordingError(f"{path}: {what}, expected {MODES_OF_A_STRUCTURE}")
    return load_as(ModalAnalysis, path).modes
