"""Fingerprints that identify training data, independent of file names."""

import hashlib
from collections.abc import Sequence

import numpy as np

from identification import Experiment


def features_of(experiment: Experiment) -> str:
    """Describe the data of an experiment to six digits, without its weight, names and files."""
    signals = np.vstack([experiment.inputs, experiment.outputs])
    sizes = [np.sqrt(np.mean(values**2)) for rows in (signals, np.diff(signals)) for values in rows]
    shape = f"{signals.shape} {experiment.counted_from} {experiment.period_samples} {experiment.initial_state}"
    return f"{shape} {[f'{size:.5e}' for size in sizes]}"


def fingerprint(experiment: Experiment) -> str:
    """Return a short text that identifies the data of an experiment."""
    return hashlib.sha256(features_of(experiment).encode()).hexdigest()[:16]


def uses_of(training: Sequence[Experiment], validation: Sequence[Experiment]) -> dict[str, str]:
    """Return the use of experiments in a model, ``training`` or ``validation``, by their fingerprints."""
    return {fingerprint(one): "validation" for one in validation} | {fingerprint(one): "training" for one in training}
