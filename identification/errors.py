"""The error that this package raises if measurements or models cannot be used as given."""

from vibrolock.errors import InputError


class IdentificationError(InputError):
    """Measurements, a mapping or a model are not usable as given."""
