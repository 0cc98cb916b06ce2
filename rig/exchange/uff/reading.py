"""Read the datasets of a universal file, check that they are complete, and extract their time data."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identification import IdentificationError
from rig.exchange.child_reading import NAMES, ImportFailed, read_in_child
from rig.exchange.uff.units import file_units
from rig.system.text_files import read_bytes

Dataset = Mapping[str, Any]
LARGEST_BYTES = 2_000_000_000
_KNOWN = (55, 58, 151, 164)
_DIRECTION = {0: "", 1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}


def read_uff(path: Path) -> list[Dataset]:
    """Return what `datasets_in` reads, by a child process; raise `ImportFailed` as it does."""
    found: list[Dataset] = read_in_child("uff", path, NAMES["uff"])
    return found


def datasets_in(path: Path) -> list[Dataset]:
    """Return datasets 55, 58, 151 and 164 of a universal file, in their order.

    Raises `ImportFailed` if the file is missing, not a universal file or cut short, or if a dataset cannot be read.
    """
    import pyuff

    text = read_bytes(path, LARGEST_BYTES, ImportFailed)
    if not re.match(rb"\s*-1\s*[\r\n]+\s*\d+", text[:400]):
        raise ImportFailed(f"{path}: is no universal file; those begin with a line -1 and a dataset's number")
    if not text.rstrip().endswith(b"    -1"):
        raise ImportFailed(f"{path}: is cut short: the last dataset has no end")
    try:
        file = pyuff.UFF(str(path))
        types = [int(number) for number in file.get_set_types()]
    except Exception as error:  # pyuff raises no more specific error
        raise ImportFailed(f"{path}: is a damaged universal file ({error})") from None
    return [_dataset(file, number, kind, path) for number, kind in enumerate(types) if kind in _KNOWN]


def _dataset(file: Any, number: int, kind: int, path: Path) -> Dataset:
    where = f"{path}, dataset {number + 1} (type {kind})"
    try:
        dataset: dict[str, Any] = file.read_sets(number)
    except Exception as error:
        raise ImportFailed(f"{where}: is damaged or in a variant that is not understood ({error})") from None
    if kind == 58:
        values, wanted = len(dataset["data"]), dataset["num_pts"]
        if values < wanted:
            raise ImportFailed(f"{where}: holds {values} of {wanted} values")
        dataset["data"], dataset["x"] = dataset["data"][:wanted], dataset["x"][:wanted]
        if not np.all(np.isfinite(dataset["data"])):
            raise ImportFailed(f"{where}: value {int(np.argmin(np.isfinite(dataset['data']))) + 1} is not finite")
    return {**dataset, "where": where}


def degree_of(dataset: Dataset, prefix: str) -> str:
    """Return node and direction as text, such as ``3+Z``."""
    direction = int(dataset[f"{prefix}_dir"])
    sign = _DIRECTION.get(abs(direction), f"?{direction}")
    return f"{dataset[f'{prefix}_node']}{sign.replace('+', '-') if direction < 0 else sign}"


_SPARE = 0.01  # a recorder stops a few samples early or late


def time_data_in(datasets: Sequence[Dataset], assumed: str = "") -> dict[str, Any]:
    """Return the time functions (type 1) by name, with one column per record, in SI if they have units.

    The dictionary also has ``sets`` (list of all functions), ``sample_rate_hz`` and ``units`` (by name). Raises `ImportFailed`
    if there are none, or if their rates disagree.
    """
    functions = [dataset for dataset in datasets if dataset["type"] == 58 and dataset["func_type"] == 1]
    if not functions:
        raise ImportFailed(f"no time data (dataset 58 of function type 1) among {len(datasets)} datasets")
    units = file_units(datasets, assumed)
    rates: list[float] = []
    stored: list[Any] = []
    out: dict[str, list[Any]] = {}
    known: dict[str, str] = {}
    for function in functions:
        rates.append(_rate(function))
        if abs(rates[-1] / rates[0] - 1.0) > 1e-9:
            raise ImportFailed(
                f"{function['where']}: sample rate {rates[-1]:g} Hz, that of the first is {rates[0]:g} Hz"
            )
        name = function["id1"] if function["id4"].startswith("vibrolock") else degree_of(function, "rsp")
        try:
            unit, factor = units.of(function, "ordinate", function["where"])
        except (ImportFailed, IdentificationError):
            if assumed or int(function["ordinate_spec_data_type"]):
                raise
            unit, factor = "", 1.0  # an unknown quantity without unit: the mapping says what it is
        stored.append(np.asarray(function["data"], dtype=np.float64) * factor)
        out.setdefault(name, []).append(stored[-1])
        if abs(len(stored[-1]) - len(out[name][0])) > _SPARE * len(out[name][0]):
            raise ImportFailed(
                f"{function['where']}: {name} has {len(stored[-1])} samples, before {len(out[name][0])}; wanted are records "
                "of one length"
            )
        known[name] = unit
    return {
        **{name: _columns(records) for name, records in out.items()},
        "sets": stored,
        "units": known,
        "sample_rate_hz": rates[0],
    }


def _columns(records: Sequence[Any]) -> Any:
    """Put records side by side, cut to the length of the shortest."""
    shortest = min(map(len, records))
    return np.column_stack([record[:shortest] for record in records])


def _rate(function: Dataset) -> float:
    """Return the sample rate of line 5 if it agrees with the header to the header's six digits, else that of the header.

    Of the rates with these six digits of the step, the one with the fewest digits is taken: 2048 Hz, not 2048.001 Hz.
    """
    step = float(function["abscissa_inc"])
    if function["abscissa_spacing"] != 1 or step <= 0.0:
        raise ImportFailed(f"{function['where']}: is not evenly sampled; wanted is a step above zero")
    rate = 1.0 / step
    told = re.match(r"sample rate (\S+) Hz", function["id5"])
    if told and abs(float(told[1]) / rate - 1.0) < 1e-5:
        return float(told[1])
    rounded = (float(f"{rate:.{digits}g}") for digits in range(1, 7))
    return next((one for one in rounded if f"{1.0 / one:.5e}" == f"{step:.5e}"), rate)
