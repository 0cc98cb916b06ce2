"""Result of a hammer test: the hits, the frequency responses with their errors, the coherence."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from identification.channels import Channel
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.validation import shaped_array
from vibrolock.arrays import Float
from vibrolock.results import Result


@dataclass(frozen=True)
class Hit:
    """One hit.

    Parameters
    ----------
    label
        Number from 1, and where the hit is.
    record
        Number of the record, from 1.
    time_s
        Beginning of the pulse in its record.
    peak_n
        Largest force.
    duration_s
        Duration of the pulse.
    fault
        Why the hit does not count; empty if it does.
    """

    label: str
    record: int
    time_s: float
    peak_n: float
    duration_s: float
    fault: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class HammerTest(Result):
    """Result of a hammer test.

    Raises `IdentificationError` if shapes do not agree or values are not finite.

    Parameters
    ----------
    channels
        The channels of the records.
    sample_rate_hz
        Samples per second.
    record_s
        Length of the record of one hit.
    hits
        All hits, in the order of the records; those with a fault do not count.
    responses
        Frequency responses of the motions to the force, for `linear_modes`; they know the exponential window.
    coherence
        float[n_lines, n_outputs], in [0, 1], over the hits that count.
    force_n_s
        float[n_lines], RMS over the hits of the modulus of the force's transform.
    """

    channels: tuple[Channel, ...]
    sample_rate_hz: float
    record_s: float
    hits: tuple[Hit, ...]
    responses: FrequencyResponseMatrix
    coherence: Float
    force_n_s: Float

    def __post_init__(self) -> None:
        lines, outputs = self.responses.frequency_hz.size, len(self.responses.outputs)
        for name, shape in (("coherence", (lines, outputs)), ("force_n_s", (lines,))):
            object.__setattr__(self, name, shaped_array(name, getattr(self, name), np.float64, shape))

    @property
    def used(self) -> tuple[Hit, ...]:
        """The hits that count."""
        return tuple(hit for hit in self.hits if not hit.fault)

    def table(self) -> list[dict[str, Any]]:
        """Return one JSON-able dictionary per hit."""
        return [asdict(hit) for hit in self.hits]
