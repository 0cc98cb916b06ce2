"""Units of the data in a universal file, from the labels of its axes and from its dataset 164."""

from identification.mapping import si_of
from rig.exchange.child_reading import ImportFailed
from rig.exchange.universal_file import Axis, UnitSystem, UniversalFile

_TOLERANCE = 1e-3
"""Relative difference of two factors that count as one; chosen: factors are stored with three digits and more."""
_LENGTH = {8: "m", 11: "m/s", 12: "m/s2"}  # SI units of motions by their specific data type
_FORCE = (9, 13)  # specific data types of forces
_INDEPENDENT = ("g", "1", "V")  # labels that do not depend on the system of units
_CODES = ("", "SI", "BG", "MG", "BA", "MM", "CM", "IN", "GM", "US")  # names of systems of units by their code


class FileUnits:
    """Factors from the quantities of a file to SI, by its ``system`` of units (dataset 164) if it has one.

    ``assumed`` decides if labels and dataset 164 disagree or are missing: ``labels``, ``file`` (dataset 164) or ``si``; if
    empty, such a file is refused.
    """

    def __init__(self, system: UnitSystem | None, assumed: str = "") -> None:
        self._system, self._assumed = system, assumed

    def of(self, axis: Axis, name: str, where: str) -> tuple[str, float]:
        """Return the SI unit of an axis and the factor to it; raise `ImportFailed`, which has its ``name``, if unclear."""
        code, label = axis.data_type, axis.unit.strip()
        quantity = _LENGTH.get(code, "N" if code in _FORCE else "")
        labelled = None if label in ("", "NONE") else si_of(label, f"{where}: unit of the {name}")
        if self._assumed == "si":
            return (quantity or (labelled[0] if labelled else "1")), 1.0
        filed = None  # unit and factor by dataset 164, whose factors divide to give SI
        if self._system is not None and quantity:
            filed = quantity, 1.0 / (self._system.force if code in _FORCE else self._system.length)
        if labelled and (self._assumed == "labels" or filed is None or label in _INDEPENDENT):
            return labelled
        if labelled and filed and self._assumed != "file":
            if labelled[0] != filed[0] or abs(labelled[1] / filed[1] - 1.0) > _TOLERANCE:
                raise ImportFailed(
                    f"{where}: mixed units: the {name} is labelled {label} (times {labelled[1]:g} gives {labelled[0]}), "
                    f"dataset 164 says {self.name} (times {filed[1]:g} gives {filed[0]}); choose one by `units` labels or "
                    "`units` file"
                )
            return labelled
        if filed is None:
            raise ImportFailed(
                f"{where}: the {name} has no unit, and the file no dataset 164; where it is in SI, say `units` si"
            )
        return filed

    def mass_factor(self, where: str) -> float:
        """Return the factor from the file's unit of mass (its force over its acceleration) to kg."""
        if self._assumed == "si":
            return 1.0
        if self._system is None:
            raise ImportFailed(f"{where}: the file has no units (dataset 164); where it is in SI, say `units` si")
        return self._system.length / self._system.force

    @property
    def name(self) -> str:
        """Name of the file's system of units."""
        code = 0 if self._system is None else self._system.code
        return _CODES[code] if 0 <= code < len(_CODES) else f"code {code}"


def file_units(file: UniversalFile, assumed: str = "") -> FileUnits:
    """Return the units of a file; raise `ImportFailed` if it has several datasets 164 that differ."""
    factors = {(system.length, system.force) for system in file.units}
    if len(factors) > 1 or any(length <= 0.0 or force <= 0.0 for length, force in factors):
        raise ImportFailed(
            f"units (dataset 164): {len(factors)} different ones, {sorted(factors)}; wanted is one, above zero"
        )
    return FileUnits(file.units[0] if file.units else None, assumed)
