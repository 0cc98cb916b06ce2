"""Units of the data in a universal file, from the labels of its axes and from its dataset 164."""

import math
import re

from identification import IdentificationError
from identification.mapping import si_of
from rig.exchange.child_reading import ImportFailed
from rig.exchange.universal_file import Axis, Function, UnitSystem, UniversalFile
from vibrolock.quantities import quantity

_TOLERANCE = 1e-3
"""Relative difference of two factors that count as one; chosen: factors are stored with three digits and more."""
_LENGTH = {8: "m", 11: "m/s", 12: "m/s2"}  # SI units of motions by their specific data type
_FORCE = (9, 13)  # specific data types of forces
_UNKNOWN = (0, 1)  # specific data types that say no quantity
_TIME, _FREQUENCY = 17, 18  # specific data types of abscissas
_SYSTEMS: dict[int, tuple[str, float, float]] = {
    1: ("SI", 1.0, 1.0),
    2: ("BG", 3.28084, 0.224809),
    3: ("MG", 1.0, 0.101972),
    4: ("BA", 3.28084, 7.23301),
    5: ("MM", 1000.0, 1000.0),
    6: ("CM", 100.0, 100.0),
    7: ("IN", 39.3701, 0.224809),
    8: ("GM", 1000.0, 0.101972),
    10: ("MN", 1000.0, 1.0),
}
"""Systems of units by their code: name, divisor of lengths, divisor of forces (SDRC, dataset 164); 9 is the user's own."""


class FileUnits:
    """Factors from the quantities of a file to SI, by its ``system`` of units (dataset 164) if it has one.

    ``assumed`` decides if labels and dataset 164 disagree or are missing: ``labels``, ``file`` (dataset 164) or ``si``; if
    empty, such a file is refused.
    """

    def __init__(self, system: UnitSystem | None, assumed: str = "") -> None:
        self._system, self._assumed = system, assumed

    def of(self, axis: Axis, name: str, where: str) -> tuple[str, float]:
        """Return the SI unit of an axis and the factor to it; raise `ImportFailed`, which has its ``name``, if unclear."""
        known, label = _by_code(axis), axis.unit
        if not label and not known and axis.data_type not in _UNKNOWN:
            raise IdentificationError(
                f"is of data type {axis.data_type}", where=f"{where}: the {name}", allowed="motion, force"
            )
        filed = self._filed(axis)
        if self._assumed == "file" and filed is not None and not _in_every_system(label):
            return filed
        if self._assumed == "si" and known:
            return known, 1.0
        labelled = si_of(label, f"{where}: unit of the {name}") if label else None
        if self._assumed == "si":
            return labelled[0] if labelled else "1", 1.0
        if labelled is None and filed is None:
            raise ImportFailed(
                f"{where}: the {name} has no unit, and the file no dataset 164; where it is in SI, say `units` si"
            )
        if labelled is None:
            assert filed is not None
            return filed
        if filed is not None and self._assumed != "labels" and not _in_every_system(label):
            self._agree(label, labelled, filed, f"{where}: mixed units: the {name}")
        return labelled

    def of_signal(self, axis: Axis, where: str) -> tuple[str, float, bool]:
        """Return the unit of a signal, the factor to it, and whether it is an SI unit of a force, a motion or a voltage.

        A signal in another unit keeps it, and one of an unknown quantity without a unit has none.
        """
        known = _by_code(axis)
        if not known and not axis.unit:
            return "", 1.0, False
        try:
            return *self.of(axis, "ordinate", where), True
        except IdentificationError:  # what the label says is no unit of a signal
            return axis.unit, 1.0, False

    def of_response(self, function: Function) -> tuple[str, str, float]:
        """Return the SI units of output and input of a frequency response, and the factor to their ratio.

        The unit of the ordinate may be the ratio itself, such as ``(m/s^2)/N``. Raises `ImportFailed` or
        `IdentificationError` if a unit is unclear.
        """
        ordinate, source, where = function.ordinate, function.denominator, function.where
        if (ratio := _ratio(ordinate.unit)) is not None:
            return self._ratio_in_si(*ratio, function)
        out_unit, out_factor = self.of(ordinate, "ordinate", where)
        in_unit, in_factor = self.of(source, "orddenom", where)
        return out_unit, in_unit, out_factor / in_factor

    def _ratio_in_si(self, output: str, source: str, factor: float, function: Function) -> tuple[str, str, float]:
        if label := function.denominator.unit:
            denominator = quantity(label)
            if denominator is None or denominator.si != source:
                raise ImportFailed(
                    f"{function.where}: the ordinate is labelled {function.ordinate.unit}, its denominator {label}; "
                    "expected the same, or no label of the denominator"
                )
        if self._assumed == "si":
            return _by_code(function.ordinate) or output, source, 1.0
        above, below = self._filed(function.ordinate), self._filed(function.denominator)
        if above is None or below is None or self._assumed == "labels":
            return output, source, factor
        filed = above[0], above[1] / below[1]
        if self._assumed == "file":
            return filed[0], below[0], filed[1]
        if not re.match(r"\W*g\b", function.ordinate.unit, re.IGNORECASE):  # g is of no system of units
            self._agree(function.ordinate.unit, (output, factor), filed, f"{function.where}: mixed units: the ordinate")
        return output, source, factor

    def _filed(self, axis: Axis) -> tuple[str, float] | None:
        """Return the SI unit and the factor to it by dataset 164, whose factors divide to give SI; None if it has none."""
        known = _by_code(axis)
        if self._system is None or not known:
            return None
        self._consistent()
        return known, 1.0 / (self._system.force if known == "N" else self._system.length)

    def _consistent(self) -> None:
        """Raise `ImportFailed` if code and factors of dataset 164 say different things and nothing was chosen."""
        system = self._system
        if system is None or self._assumed or system.code not in _SYSTEMS:
            return
        name, length, force = _SYSTEMS[system.code]
        if not (
            math.isclose(system.length, length, rel_tol=_TOLERANCE)
            and math.isclose(system.force, force, rel_tol=_TOLERANCE)
        ):
            raise ImportFailed(
                f"units (dataset 164): code {system.code} is {name}, with the factors {length:g} and {force:g}, the file has "
                f"{system.length:g} and {system.force:g}; choose these by `units` file, or `units` labels, or `units` si"
            )

    def _agree(self, label: str, labelled: tuple[str, float], filed: tuple[str, float], what: str) -> None:
        if labelled[0] != filed[0] or not math.isclose(labelled[1], filed[1], rel_tol=_TOLERANCE):
            raise ImportFailed(
                f"{what} is labelled {label} (times {labelled[1]:g} gives {labelled[0]}), dataset 164 says {self.name} "
                f"(times {filed[1]:g} gives {filed[0]}); choose one by `units` labels or `units` file"
            )

    def mass_factor(self, where: str) -> float:
        """Return the factor from the file's unit of mass (its force over its acceleration) to kg."""
        if self._assumed == "si":
            return 1.0
        if self._system is None:
            raise ImportFailed(f"{where}: the file has no units (dataset 164); where it is in SI, say `units` si")
        self._consistent()
        return self._system.length / self._system.force

    @property
    def name(self) -> str:
        """Name of the file's system of units."""
        code = 0 if self._system is None else self._system.code
        return _SYSTEMS[code][0] if code in _SYSTEMS else "units of the user" if code == 9 else f"code {code}"


def _by_code(axis: Axis) -> str:
    """Return the SI unit of a motion or a force by its specific data type; empty for any other."""
    return _LENGTH.get(axis.data_type, "N" if axis.data_type in _FORCE else "")


def _in_every_system(label: str) -> bool:
    """Return whether a label is g, or a unit of voltages or ratios, which belong to no system of units."""
    found = quantity(label) if label else None
    return found is not None and (found.si in ("V", "1") or found == quantity("g"))


def _ratio(label: str) -> tuple[str, str, float] | None:
    """Return the SI units of a motion and of the force (or voltages) below it, and the factor; None if it is no ratio."""
    found = quantity(label) if label else None
    if found is None or found.si in ("m", "m/s", "m/s2", "N", "V", "1"):
        return None
    for source in ("N", "V"):
        above = quantity(f"({label})*{source}")
        if above is not None and above.si in ("m", "m/s", "m/s2", "V"):
            return above.si, source, float(above.factor)
    return None


def seconds_of(function: Function) -> float:
    """Return the seconds in the unit of an abscissa; raise `ImportFailed` if it is no time."""
    return _abscissa(function, _TIME, "time", {"s": 1.0})


def hertz_of(function: Function) -> float:
    """Return the hertz in the unit of an abscissa; raise `ImportFailed` if it is no frequency."""
    return _abscissa(function, _FREQUENCY, "frequency", {"Hz": 1.0, "rad/s": 0.5 / math.pi})


def _abscissa(function: Function, code: int, what: str, allowed: dict[str, float]) -> float:
    axis = function.abscissa
    found = quantity(axis.unit) if axis.unit else None
    if found is not None and found.si in allowed:
        return float(found.factor) * allowed[found.si]
    if axis.unit or axis.data_type not in (0, 1, code):
        said = f"in '{axis.unit}'" if axis.unit else f"of data type {axis.data_type}"
        raise ImportFailed(f"{function.where}: the abscissa is {said}, expected a {what} in {' or '.join(allowed)}")
    return 1.0


def file_units(file: UniversalFile, assumed: str = "") -> FileUnits:
    """Return the units of a file; raise `ImportFailed` if it has several datasets 164 that differ."""
    factors = {(system.length, system.force) for system in file.units}
    if len(factors) > 1 or any(length <= 0.0 or force <= 0.0 for length, force in factors):
        raise ImportFailed(
            f"units (dataset 164): {len(factors)} different ones, {sorted(factors)}; expected one, above zero"
        )
    return FileUnits(file.units[0] if file.units else None, assumed)
