"""Exchange of sweeps: their fundamentals over time."""

from functools import partial

from identification import Transient
from identification.common import decode, encode
from rig.results.kind import Exchange
from rig.results.time_data.series import units_and_labels
from rig.text.contents import Contents


def _contents(transient: Transient) -> Contents:
    arrays, attributes = encode(transient)
    units, labels = units_and_labels(transient.channels)
    rows = {"time_s": 0, "frequency_hz": 0, "fundamentals": 1}
    return Contents("sweep", "sweep", arrays, attributes, rows, {"fundamentals": units}, {"fundamentals": labels})


EXCHANGE = Exchange("sweep", Transient, _contents, partial(decode, Transient))
