"""Texts by which training data is known again, whatever its files are called."""

import hashlib
from collections.abc import Sequence

import numpy as np

from identification import Experiment

__all__ = ["features_of", "fingerprint", "uses_of"]


def features_of(experiment: Experiment) -> str:
    """What makes an experiment, to six digits, but for its weight: names and files may change."""
    signals = np.vstack([experiment.inputs, experiment.outputs])
    sizes = [np.sqrt(np.mean(values**2)) for rows in (signals, np.diff(signals)) for values in rows]
    shape = f"{signals.shape} {experiment.counted_from} {experiment.period_samples} {experiment.initial_state}"
    return f"{shape} {[f'{size:.5e}' for size in sizes]}"


def fingerprint(experiment: Experiment) -> str:
    """A short text that is the same for the same data alone."""
    return hashlib.sha256(features_of(experiment).encode()).hexdigest()[:16]


def uses_of(training: Sequence[Experiment], validation: Sequence[Experiment]) -> dict[str, str]:
    """What experiments are to a model, by their fingerprints: ``training`` or ``validation``."""
    return {fingerprint(one): "validation" for one in validation} | {fingerprint(one): "training" for one in training}
