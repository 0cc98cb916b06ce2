"""Levels of a response-controlled test, and their files. The surface is fitted again on each use."""

from dataclasses import dataclass
from functools import cached_property

from identification import (
    ForceSurface,
    FrequencyResponse,
    force_surface,
    pack_frequency_responses,
    unpack_frequency_responses,
)
from identification.common import Arrays, Attributes
from rig.results.kind import Storage
from vibrolock.results import Result


@dataclass(frozen=True, eq=False)
class MeasuredSurface(Result):
    """Levels of a response-controlled test, the surface through them, and notes on missing points of the plan."""

    responses: tuple[FrequencyResponse, ...]
    notes: tuple[str, ...] = ()

    @cached_property
    def surface(self) -> ForceSurface:
        """Surface fitted to the levels; raises `IdentificationError` if they do not define one."""
        return force_surface(self.responses)


def exported(measured: MeasuredSurface) -> list[tuple[FrequencyResponse, ...]]:
    """Return what is exported of a file: the measured levels."""
    return [measured.responses]


def _pack(measured: MeasuredSurface) -> tuple[Arrays, Attributes]:
    arrays, attributes = pack_frequency_responses(measured.responses)
    return arrays, {**attributes, "notes": list(measured.notes)}


def _unpack(arrays: Arrays, attributes: Attributes) -> MeasuredSurface:
    return MeasuredSurface(unpack_frequency_responses(arrays, attributes), tuple(attributes.get("notes", ())))


STORAGE = Storage(_pack, _unpack)
