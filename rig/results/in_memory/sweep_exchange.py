"""Exchange of sweeps: their fundamentals over time."""

import numpy as np
from pydantic import BaseModel

from identification import Channel, Transient
from rig.results.arrays import Arrays, Attributes
from rig.results.kind import Exchange
from rig.results.time_data.exchange import named
from rig.text.contents import Contents


def transient_parts(transient: Transient) -> Contents:
    """Convert a sweep to its fundamentals over time."""
    units, labels, channels = named(transient.channels)
    return Contents(
        kind="sweep",
        title="sweep",
        arrays={name: getattr(transient, name) for name in ("time_s", "frequency_hz", "fundamentals")},
        attributes={"channels": channels, "window_periods": transient.window_periods},
        rows={"time_s": 0, "frequency_hz": 0, "fundamentals": 1},
        units={"fundamentals": units},
        labels={"fundamentals": labels},
    )


class _SweepFacts(BaseModel):
    """Attributes of a sweep."""

    channels: tuple[Channel, ...]
    window_periods: int


def transient_from(arrays: Arrays, attributes: Attributes) -> Transient:
    """Convert the output of `transient_parts` back; raise KeyError or ValueError for missing or unknown entries."""
    facts = _SweepFacts.model_validate(attributes)
    time_s, frequency_hz = (np.asarray(arrays[name], np.float64) for name in ("time_s", "frequency_hz"))
    fundamentals = np.asarray(arrays["fundamentals"], np.complex128)
    return Transient(facts.channels, time_s, frequency_hz, fundamentals, facts.window_periods)


EXCHANGE = Exchange("sweep", Transient, transient_parts, transient_from)
