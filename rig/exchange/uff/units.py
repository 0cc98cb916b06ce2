"""Units of the data in a universal file, from the labels of its axes and from its dataset 164."""

from collections.abc import Mapping, Sequence
from typing import Any

from identification.mapping import si_of
from rig.exchange.child_reading import ImportFailed

_TOLERANCE = 1e-3
_LENGTH = {8: "m", 11: "m/s", 12: "m/s2"}
_FORCE = (9, 13)
_APART = ("g", "1", "V")  # labels that do not depend on the system of units
_CODES = ("", "SI", "BG", "MG", "BA", "MM", "CM", "IN", "GM", "US")


class FileUnits:
    """Factors from the quantities of a file to SI.

    Parameters
    ----------
    dataset
        Dataset 164; None if the file has none.
    assumed
        Source that decides if labels and dataset 164 disagree or are missing: ``labels``, ``file`` (dataset 164) or ``si``. If
        empty, such a file is refused.
    """

    def __init__(self, dataset: Mapping[str, Any] | None, assumed: str = "") -> None:
        self._dataset, self._assumed = dataset, assumed

    def of(self, function: Mapping[str, Any], prefix: str, where: str) -> tuple[str, float]:
        """Return the SI unit of an axis (``ordinate``, ``orddenom``) and the factor to it; raise `ImportFailed` if unclear."""
        code = int(function.get(f"{prefix}_spec_data_type", 0))
        label = str(function.get(f"{prefix}_axis_units_lab", "")).strip()
        quantity = _LENGTH.get(code, "N" if code in _FORCE else "")
        labelled = None if label in ("", "NONE") else si_of(label, f"{where}: unit of the {prefix}")
        if self._assumed == "si":
            return (quantity or (labelled[0] if labelled else "1")), 1.0
        filed = self._filed(code, quantity)
        if labelled and (self._assumed == "labels" or filed is None or label in _APART):
            return labelled
        if labelled and filed and self._assumed != "file":
            if labelled[0] != filed[0] or abs(labelled[1] / filed[1] - 1.0) > _TOLERANCE:
                raise ImportFailed(
                    f"{where}: mixed units: the {prefix} is labelled {label} (times {labelled[1]:g} gives {labelled[0]}), "
                    f"dataset 164 says {self.name} (times {filed[1]:g} gives {filed[0]}); choose one by `units` labels or "
                    "`units` file"
                )
            return labelled
        if filed is None:
            raise ImportFailed(
                f"{where}: the {prefix} has no unit, and the file no dataset 164; where it is in SI, say `units` si"
            )
        return filed

    def mass_factor(self, where: str) -> float:
        """Return the factor from the file's unit of mass (its force over its acceleration) to kg."""
        if self._assumed == "si":
            return 1.0
        if self._dataset is None:
            raise ImportFailed(f"{where}: the file has no units (dataset 164); where it is in SI, say `units` si")
        return float(self._dataset["length"]) / float(self._dataset["force"])

    @property
    def name(self) -> str:
        """Name of the file's system of units."""
        code = 0 if self._dataset is None else int(self._dataset["units_code"])
        return _CODES[code] if 0 <= code < len(_CODES) else f"code {code}"

    def _filed(self, code: int, quantity: str) -> tuple[str, float] | None:
        """Return unit and factor by dataset 164, whose factors divide to give SI; None if it does not define the quantity."""
        if self._dataset is None or not quantity:
            return None
        return quantity, 1.0 / float(self._dataset["force" if code in _FORCE else "length"])


def file_units(datasets: Sequence[Mapping[str, Any]], assumed: str = "") -> FileUnits:
    """Return the units of a file; raise `ImportFailed` if it has several datasets 164 that differ."""
    found = [dataset for dataset in datasets if dataset["type"] == 164]
    factors = {(dataset["length"], dataset["force"]) for dataset in found}
    if len(factors) > 1 or any(length <= 0.0 or force <= 0.0 for length, force in factors):
        raise ImportFailed(
            f"units (dataset 164): {len(factors)} different ones, {sorted(factors)}; wanted is one, above zero"
        )
    return FileUnits(found[0] if found else None, assumed)
