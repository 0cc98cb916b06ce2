"""Sensitivities as data sheets have them: ``100 mV/g``, ``22.4 mV/N``, ``3.9 pC/N`` into a charge amplifier, ``1 mm/V``."""

import re
from fractions import Fraction

from identification import IdentificationError
from identification.mapping import si_of
from vibrolock.errors import InputError

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")
_VOLTS = {"V": Fraction(1), "mV": Fraction(1, 1000), "uV": Fraction(1, 1_000_000)}  # in V
_CHARGES = {"pC": Fraction(1), "nC": Fraction(1000)}  # in pC
_OUTPUTS = _VOLTS | _CHARGES
_LEAST, _MOST = 1e-12, 1e12  # of a number: sensors and amplifiers lie inside
_SPELLINGS = (("µ", "u"), ("μ", "u"), ("²", "2"), ("^", ""), ("ms-2", "m/s2"), ("ms-1", "m/s"), ("·", ""))
_SENSITIVITY = "a number and its unit as on the data sheet, such as '100 mV/g', '22.4 mV/N', '3.9 pC/N', '1 mm/V'"
_GAIN = "a number and its unit, such as '10 mV/pC' or '0.1 V/pC' for a charge amplifier, '10' or '10 V/V' for another"


def volts_per_unit(sensitivity: str, amplifier_gain: str = "") -> tuple[float, str]:
    """Return volts per unit, and the unit as a bench has it (N, m/s^2, m/s, m), of a sensor with its amplifier.

    Parameters
    ----------
    sensitivity
        Volts or charge per unit of the quantity (``100 mV/g``, ``3.9 pC/N``), or the quantity per volt (``1 mm/V``).
        The quantity is in one of `identification.mapping.units.UNITS`; g is 9.80665 m/s2.
    amplifier_gain
        Volts per charge (``10 mV/pC``), which a sensitivity in charge needs; or volts per volt (``10``, ``10 V/V``).

    Raises
    ------
    ValueError
        For a text that is none of these, or a gain that does not belong to the sensor.
    """
    per_unit, output, unit = _sensor(sensitivity)
    if output in _CHARGES and not amplifier_gain:
        raise InputError(
            f"is missing, sensitivity = {sensitivity!r} is a charge", field="amplifier_gain", allowed=_GAIN
        )
    if amplifier_gain:
        gain, taken = _amplifier(amplifier_gain)
        if (taken in _CHARGES) != (output in _CHARGES):
            wanted = "'10 mV/pC'" if output in _CHARGES else "'10' or '10 V/V'"
            raise InputError(
                f"sensitivity = {sensitivity!r}",
                field="amplifier_gain",
                value=amplifier_gain,
                allowed=f"such as {wanted}",
            )
    else:
        gain = Fraction(1)
    return float(gain * per_unit), unit  # rounded once: '10.2 mV/N' is 0.0102


def _sensor(text: str) -> tuple[Fraction, str, str]:
    """Return volts or pC per SI unit of the quantity, the unit of the output, and the SI unit."""
    number, unit = _quantity("sensitivity", text, _SENSITIVITY)
    before, _, after = unit.partition("/")
    if before in _OUTPUTS:
        scale, si = _si(text, after)
        return number * _OUTPUTS[before] / scale, before, si
    quantity, _, volt = unit.rpartition("/")
    InputError.raise_if(volt not in _VOLTS, field="sensitivity", value=text, allowed=_SENSITIVITY)
    scale, si = _si(text, quantity)
    return _VOLTS[volt] / (number * scale), volt, si


def _amplifier(text: str) -> tuple[Fraction, str]:
    """Return volts per volt or per pC, and what the amplifier takes."""
    number, unit = _quantity("amplifier_gain", text, _GAIN)
    given, _, taken = (unit or "V/V").partition("/")
    InputError.raise_if(given not in _VOLTS or taken not in _OUTPUTS, field="amplifier_gain", value=text, allowed=_GAIN)
    return number * _VOLTS[given] / _OUTPUTS[taken], taken


def _quantity(key: str, text: str, allowed: str) -> tuple[Fraction, str]:
    found = _QUANTITY.fullmatch(text)
    if found is None or not _LEAST <= abs(float(found[1])) <= _MOST:
        raise InputError(field=key, value=text, allowed=allowed)
    unit = "".join(found[2].split())
    for old, new in _SPELLINGS:
        unit = unit.replace(old, new)
    return Fraction(found[1]), unit


def _si(text: str, quantity: str) -> tuple[Fraction, str]:
    bare = quantity[1:-1] if quantity.startswith("(") and quantity.endswith(")") else quantity
    try:
        si, scale = si_of(bare, f"sensitivity = {text!r}: the quantity")
    except IdentificationError as error:
        raise InputError.of(error) from None
    return Fraction(str(scale)), "m/s^2" if si == "m/s2" else si
