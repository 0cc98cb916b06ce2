"""Units that imported measurements may have."""

from identification.errors import IdentificationError

GRAVITY = 9.80665  # m/s2, standard
_INCH, _POUND = 0.0254, 4.4482216152605  # m; N per pound-force

UNITS: dict[str, tuple[str, float]] = {
    **{"m": ("m", 1.0), "mm": ("m", 1e-3), "um": ("m", 1e-6), "in": ("m", _INCH), "ft": ("m", 12.0 * _INCH)},
    **{"m/s": ("m/s", 1.0), "mm/s": ("m/s", 1e-3), "in/s": ("m/s", _INCH)},
    **{"m/s2": ("m/s2", 1.0), "m/s^2": ("m/s2", 1.0), "mm/s2": ("m/s2", 1e-3), "mm/s^2": ("m/s2", 1e-3)},
    **{"in/s2": ("m/s2", _INCH), "in/s^2": ("m/s2", _INCH), "g": ("m/s2", GRAVITY)},
    **{"N": ("N", 1.0), "mN": ("N", 1e-3), "kN": ("N", 1e3), "lbf": ("N", _POUND), "kgf": ("N", GRAVITY)},
    **{"V": ("V", 1.0), "mV": ("V", 1e-3), "1": ("1", 1.0)},
}
"""SI unit of every known unit, and the factor to it."""

_SPELLINGS = {
    "m/s²": "m/s2",
    "m/s**2": "m/s2",
    "m/sec^2": "m/s2",
    "lb": "lbf",
    "G": "g",
    "gn": "g",
    "µm": "um",
    "volt": "V",
}


def si_of(unit: str, where: str) -> tuple[str, float]:
    """Return the SI unit and the factor to it; raise `IdentificationError` with the known units if ``unit`` is unknown."""
    unit = unit.strip()
    known = UNITS.get(_SPELLINGS.get(unit, unit))
    if known is None:
        raise IdentificationError(f"is '{unit}'", where=where, allowed=UNITS)
    return known
