"""The error that this package raises if measurements or models cannot be used as given."""


class IdentificationError(ValueError):
    """Measurements, a mapping or a model are not usable; the message names the field, its value and what is allowed."""
