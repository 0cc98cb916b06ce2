"""Units that imported measurements may have: those of a force, a motion, a voltage or a ratio in `vibrolock.quantities`."""

from identification.errors import IdentificationError
from vibrolock.quantities import SIGNALS, USUAL, Quantity, quantity


def _known(unit: str) -> Quantity | None:
    found = quantity(unit)
    return found if found is not None and found.si in SIGNALS else None


UNITS: dict[str, tuple[str, float]] = {
    name: (found.si, float(found.factor)) for name in USUAL if (found := _known(name)) is not None
}
"""SI unit of the usual units, and the factor to it; other spellings and prefixes are understood as well."""


def is_signal_unit(unit: str) -> bool:
    """Return whether a unit is one of a force, a motion, a voltage or a ratio."""
    return _known(unit) is not None


def si_of(unit: str, where: str) -> tuple[str, float]:
    """Return the SI unit of a signal and the factor to it; raise `IdentificationError` with the usual units for others."""
    found = _known(unit)
    if found is None:
        raise IdentificationError(f"is '{unit.strip()}'", where=where, allowed=UNITS)
    return found.si, float(found.factor)
