"""The periodic ones among experiments: which they are, and whether they are what they claim to be."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.pnlss.experiment import Experiment

__all__ = ["check_periodic", "periodic_ones"]

Float = NDArray[np.float64]

_DIFFERENCE = 0.3
"""RMS difference of two periods, relative to the signal: above, noise is no explanation that leaves anything to identify."""
_SETTLED_PART = 32
"""Before the counted part, this fraction of a period must be like the one a period later, however long the transient."""


def periodic_ones(experiments: Sequence[Experiment]) -> tuple[list[Experiment], tuple[str, ...]]:
    """The periodic experiments of the commonest period, checked, and notes on those that are left out.

    Experiments that are not periodic are left out without a note. Raises `IdentificationError` where none is periodic, and
    where one is not what it claims (`check_periodic`).
    """
    claimed = [experiment for experiment in experiments if experiment.period_samples]
    if not claimed:
        raise IdentificationError(
            "experiments: none is periodic, which the best linear approximation needs; add multisine periods "
            "(period_samples), or give a linear model to begin from"
        )
    for index, experiment in enumerate(claimed):
        check_periodic(experiment, experiment.name or f"periodic one number {index + 1}")
    samples: Counter[int] = Counter()
    for experiment in claimed:
        samples[experiment.period_samples] += experiment.counted
    period = max(samples, key=lambda size: (samples[size], size))
    left = len(claimed) - sum(experiment.period_samples == period for experiment in claimed)
    notes = [f"periodic experiments left out: {left} of other periods than {period} samples"] if left else []
    return [experiment for experiment in claimed if experiment.period_samples == period], tuple(notes)


def check_periodic(experiment: Experiment, name: str) -> None:
    """Raise `IdentificationError` unless the counted periods repeat each other, and what is just before them repeats too.

    Two neighbouring periods may differ by 0.3 of the signal (RMS, mean removed) in every channel. Of what is put ahead, as much
    as 1/32 of a period is held against the same a period later: there the transient must have decayed.
    """
    n, begin = experiment.period_samples, experiment.counted_from
    channels = (*experiment.input_channels, *experiment.output_channels)
    for channel, signal in zip(channels, np.vstack([experiment.inputs, experiment.outputs]), strict=True):
        counted = signal[begin:].reshape(-1, n)
        size = float(np.std(counted))
        if size == 0.0:
            continue
        if len(counted) > 1:
            difference = np.sqrt(np.mean(np.diff(counted, axis=0) ** 2, axis=1)) / size
            worst = int(np.argmax(difference))
            if difference[worst] > _DIFFERENCE:
                raise IdentificationError(
                    f"experiment '{name}', channel '{channel.name}': periods {worst + 1} and {worst + 2} of {n} samples "
                    f"differ by {difference[worst]:.2g} of the signal's RMS, allowed is {_DIFFERENCE:g}; count later, "
                    "settled periods, check period_samples, or set it to 0 (not periodic)"
                )
        reach = min(begin, max(n // _SETTLED_PART, 1))
        if reach:
            off = float(np.sqrt(np.mean((signal[begin - reach : begin] - counted[0, n - reach :]) ** 2))) / size
            if off > _DIFFERENCE:
                raise IdentificationError(
                    f"experiment '{name}', channel '{channel.name}': the {reach} samples before sample {begin}, where "
                    f"counting begins, differ from those a period later by {off:.2g} of the signal's RMS, allowed is "
                    f"{_DIFFERENCE:g}; count from a settled period, put a repeat of the period ahead "
                    "(Experiment.periodic), or set period_samples to 0 (not periodic)"
                )
