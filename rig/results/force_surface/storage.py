"""Files of force surfaces. They contain the measured levels."""

from identification import (
    pack_frequency_responses,
    unpack_frequency_responses,
)
from rig.results.arrays import Arrays, Attributes
from rig.results.force_surface.model import MeasuredSurface
from rig.results.kind import Storage


def _pack(measured: MeasuredSurface) -> tuple[Arrays, Attributes]:
    arrays, attributes = pack_frequency_responses(measured.responses)
    return arrays, {**attributes, "notes": list(measured.notes)}


def _unpack(arrays: Arrays, attributes: Attributes) -> MeasuredSurface:
    return MeasuredSurface(unpack_frequency_responses(arrays, attributes), tuple(attributes.get("notes", ())))


STORAGE = Storage(_pack, _unpack)
