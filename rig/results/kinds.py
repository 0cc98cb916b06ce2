"""Registry of the kinds of files: one line for each kind. A kind is imported when a file of it is read or written."""

from collections.abc import Mapping
from typing import Any

from rig.results.kind import FileKind
from vibrolock.on_use import Registry

_DECLARED = {
    "nonlinear-mode": ("nonlinear_mode.kind:NONLINEAR_MODE", ("NonlinearMode",)),
    "decay-backbone": ("decay_backbone.kind:DECAY", ("DecayBackbone",)),
    "linear-modes": ("linear_modes.kind:LINEAR_MODES", ("ModalAnalysis", "LinearModes")),
    "exciter": ("exciter.kind:EXCITER", ("Exciter",)),
    "pnlss": ("pnlss.kind:PNLSS", ("IdentifiedPnlss", "PnlssFit", "PnlssModel")),
    "structured": ("structured.kind:STRUCTURED", ("IdentifiedStructured", "StructuredFit", "StructuredModel")),
    "force-surface": ("force_surface.kind:FORCE_SURFACE", ("MeasuredSurface",)),
    "frequency-responses": ("frequency_responses.kind:FREQUENCY_RESPONSES", ("tuple",)),
    "frequency-response-matrix": ("frequency_response_matrix.kind:RESPONSE_MATRIX", ("FrequencyResponseMatrix",)),
    "hammer-test": ("hammer_test.kind:HAMMER_TEST", ("HammerTest",)),
    "measured-backbone": ("measured_backbone.kind:MEASURED_BACKBONE", ("Backbone",)),
    "time-data": ("time_data.kind:TIME_DATA", ("TimeRecords",)),
    "predictions": ("predictions.kind:PREDICTIONS", ("Predictions",)),
    "rehearsal": ("rehearsal.kind:REHEARSAL", ("Rehearsal",)),
}
"""By the name in the file: where the kind is declared, and the names of the types that it holds."""


KINDS: Mapping[str, FileKind] = Registry({name: f"rig.results.{declared}" for name, (declared, _) in _DECLARED.items()})
"""Every kind of file other than recordings, by its name in the file."""


def kind_of_file_for(thing: Any) -> FileKind | None:
    """Return the kind of file that holds an object; None if there is none."""
    types = {one.__name__ for one in type(thing).__mro__}
    for name, (_, held) in _DECLARED.items():
        if types & set(held) and isinstance(thing, KINDS[name].holds):
            return KINDS[name]
    return None


def as_kept(kind: FileKind, thing: Any) -> Any:
    """Return the object as it would be loaded from a file of its kind: linear modes as a modal analysis, for example."""
    first = kind.holds[0] if isinstance(kind.holds, tuple) else kind.holds
    return thing if isinstance(thing, first) else kind.unpack(*kind.pack(thing))
