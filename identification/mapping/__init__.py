"""Mappings: where the values of an external measurement are in nested data, and what they mean."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.mapping.base import MeasurementMapping as MeasurementMapping
    from identification.mapping.instants import EvenSampling as EvenSampling, even_sampling as even_sampling
    from identification.mapping.time_data import (
        CsvLayout as CsvLayout,
        Encoding as Encoding,
        SampledChannel as SampledChannel,
        Stretch as Stretch,
    )
    from identification.mapping.units import UNITS as UNITS, si_of as si_of
    from identification.mapping.zero_line import without_line_at_0_hz as without_line_at_0_hz
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
