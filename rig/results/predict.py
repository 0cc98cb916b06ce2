"""Predictions by models, compared with recordings."""

from collections.abc import Mapping
from pathlib import Path

from identification import Predictions
from rig.errors import RecordingError
from rig.recording.arrays import kind_of
from rig.results.kinds import predictions


def predict_vibrations(model: Path, asked: Mapping[str, object], *, kind: str = "") -> Predictions:
    """Predict with the model in a file, with errors where there is a reference.

    ``asked`` has the fields of the options of predictions by its kind, which is ``kind`` where one is wanted. Raises
    `RecordingError` for files with other contents, `ConfigurationError` for options that the kind does not have and plans that
    cannot be predicted, `identification.IdentificationError` if the model cannot answer.
    """
    known = predictions()
    if (found := kind_of(model)) not in known:
        raise RecordingError(f"{model}: is a file of kind {found}; predictions are made with a {', '.join(known)}")
    if kind not in ("", found):
        raise RecordingError(f"{model}: is a file of kind {found}, expected one of kind {kind}")
    return known[found].predict(model, known[found].options(**asked))
