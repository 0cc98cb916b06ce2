"""Exchange of linear modes."""

from functools import partial
from typing import Any

import numpy as np

from identification import (
    FrequencyResponseMatrix,
    LinearModes,
    ModalAnalysis,
)
from identification.common import decode, encode
from rig.results.kind import Exchange
from rig.text.contents import Contents


def _linear_modes(modes: LinearModes) -> Contents:
    arrays, attributes = encode(modes)
    names = tuple(channel.name for channel in modes.channels)
    shapes = {name: 1 for name in arrays if name.startswith("shapes")}
    rows = {name: 0 for name, array in arrays.items() if array.shape == modes.frequency_hz.shape and name not in _SIDES}
    units: dict[str, Any] = {"lower": "1/kg", "upper": "s2/kg", "force_rms_n": "N", "residues": "1/kg"}
    units["small_terms"] = np.array(["1/(kg s)", "1/(kg s2)", "s3/kg"])
    labels = dict.fromkeys(shapes, (names,))
    return Contents("linear-modes", modes.specimen, arrays, attributes, rows | shapes, units, labels)


_SIDES = ("lower", "upper")  # one value per channel, not per mode


def objects_of(found: ModalAnalysis) -> list[LinearModes | FrequencyResponseMatrix]:
    """Return the modes, and the responses in which they were identified if the file holds them."""
    return [found.modes] if found.responses is None else [found.modes, found.responses]


EXCHANGE = Exchange("linear-modes", LinearModes, _linear_modes, partial(decode, LinearModes))
