"""What several experiments have in common."""

from collections.abc import Sequence

import numpy as np

from identification.errors import IdentificationError
from identification.pnlss.experiment import Experiment

__all__ = ["excited_band", "same_channels", "same_data"]


def excited_band(experiments: Sequence[Experiment]) -> tuple[float, float] | None:
    """From the lowest to the highest frequency that any experiment excites; None where none says so."""
    bands = [experiment.excited_hz for experiment in experiments if experiment.excited_hz is not None]
    return (min(low for low, _ in bands), max(high for _, high in bands)) if bands else None


def same_data(one: Experiment, other: Experiment) -> bool:
    """Whether two experiments hold the same samples, be they one object or read twice from a file."""
    if one is other:
        return True
    pairs = ((one.inputs, other.inputs), (one.outputs, other.outputs))
    return all(a.shape == b.shape for a, b in pairs) and all(np.array_equal(a, b) for a, b in pairs)


def same_channels(experiments: Sequence[Experiment]) -> None:
    """Raise `IdentificationError` unless there is one at least and all have the same channels and sample rate."""
    if not experiments:
        raise IdentificationError("experiments: none given, needs one at least")
    first = experiments[0]
    for index, other in enumerate(experiments):
        what = f"experiments[{index}]{f' ({other.name})' if other.name else ''}"
        if abs(other.sample_rate_hz / first.sample_rate_hz - 1.0) > 1e-9:
            raise IdentificationError(
                f"{what}: sampled at {other.sample_rate_hz:g} Hz, the first at {first.sample_rate_hz:g} Hz; resample one"
            )
        for name in ("input_channels", "output_channels"):
            mine, theirs = (tuple(c.name for c in getattr(e, name)) for e in (other, first))
            if mine != theirs:
                raise IdentificationError(
                    f"{what}: {name.replace('_', ' ')} {', '.join(mine)}, the first has {', '.join(theirs)}"
                )
