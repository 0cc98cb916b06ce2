"""The errors that this package raises if measurements or models cannot be used as given."""

from vibrolock.errors import InputError


class IdentificationError(InputError):
    """Measurements, a mapping or a model are not usable as given."""


class ExtrapolationError(IdentificationError):
    """A model is evaluated too far beyond the data of its identification."""
