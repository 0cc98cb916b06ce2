"""Sensitivities as data sheets have them: ``100 mV/g``, ``22.4 mV/N``, ``3.9 pC/N`` into a charge amplifier, ``1 mm/V``."""

import re
from fractions import Fraction

from vibrolock.errors import InputError
from vibrolock.quantities import SIGNALS, USUAL, Quantity, quantity

_QUANTITY = re.compile(r"\s*([+-]?(?:\d++\.?\d*+|\.\d++)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")
_LEAST, _MOST = 1e-12, 1e12  # of a number: sensors and amplifiers lie inside
_SENSITIVITY = "a number and its unit as on the data sheet, such as '100 mV/g', '22.4 mV/N', '3.9 pC/N', '1 mm/V'"
_GAIN = "a number and its unit, such as '10 mV/pC' or '0.1 V/pC' for a charge amplifier, '10' or '10 V/V' for another"


def volts_per_unit(sensitivity: str, amplifier_gain: str = "") -> tuple[float, str]:
    """Return volts per unit, and the unit as a bench has it (N, m/s^2, m/s, m), of a sensor with its amplifier.

    Parameters
    ----------
    sensitivity
        Volts or charge per unit of the quantity (``100 mV/g``, ``3.9 pC/N``), or the quantity per volt (``1 mm/V``).
        The quantity is in a unit of `vibrolock.quantities`; g is 9.80665 m/s2.
    amplifier_gain
        Volts per charge (``10 mV/pC``), which a sensitivity in charge needs; or volts per volt (``10``, ``10 V/V``).

    Raises
    ------
    ValueError
        For a text that is none of these, or a gain that does not belong to the sensor.
    """
    per_unit, output, unit = _sensor(sensitivity)
    if output == "C" and not amplifier_gain:
        raise InputError(
            f"is missing, sensitivity = {sensitivity!r} is a charge", field="amplifier_gain", allowed=_GAIN
        )
    gain = Fraction(1)
    if amplifier_gain:
        gain, taken = _amplifier(amplifier_gain)
        if taken != output:
            wanted = "'10 mV/pC'" if output == "C" else "'10' or '10 V/V'"
            raise InputError(
                f"sensitivity = {sensitivity!r}",
                field="amplifier_gain",
                value=amplifier_gain,
                allowed=f"such as {wanted}",
            )
    return float(gain * per_unit), unit  # rounded once: '10.2 mV/N' is 0.0102


def _sensor(text: str) -> tuple[Fraction, str, str]:
    """Return volts or coulombs per SI unit of the quantity, which of the two, and the SI unit."""
    number, unit = _quantity("sensitivity", text, _SENSITIVITY)
    before, _, after = unit.partition("/")
    output = quantity(before)
    if output is not None and output.si in ("V", "C"):
        of = _measured(text, after)
        return number * output.factor / of.factor, output.si, _of_bench(of)
    measured, _, volt = unit.rpartition("/")
    output = quantity(volt)
    if output is None or output.si != "V":
        raise InputError(field="sensitivity", value=text, allowed=_SENSITIVITY)
    of = _measured(text, measured)
    return output.factor / (number * of.factor), "V", _of_bench(of)


def _amplifier(text: str) -> tuple[Fraction, str]:
    """Return volts per volt or per coulomb, and which of the two the amplifier takes."""
    number, unit = _quantity("amplifier_gain", text, _GAIN)
    given, taken = map(quantity, (unit or "V/V").split("/", 1)) if "/" in (unit or "V/V") else (None, None)
    if given is None or taken is None or given.si != "V" or taken.si not in ("V", "C"):
        raise InputError(field="amplifier_gain", value=text, allowed=_GAIN)
    return number * given.factor / taken.factor, taken.si


def _quantity(key: str, text: str, allowed: str) -> tuple[Fraction, str]:
    found = _QUANTITY.fullmatch(text)
    if found is None or not _LEAST <= abs(float(found[1])) <= _MOST:
        raise InputError(field=key, value=text, allowed=allowed)
    return Fraction(found[1]), re.sub(r"\s+per\s+", "/", found[2]).strip()


def _measured(text: str, unit: str) -> Quantity:
    found = quantity(unit)
    if found is None or found.si not in SIGNALS:
        raise InputError(f"is '{unit.strip()}'", where=f"sensitivity = {text!r}: the quantity", allowed=USUAL)
    return found


def _of_bench(found: Quantity) -> str:
    return "m/s^2" if found.si == "m/s2" else found.si
