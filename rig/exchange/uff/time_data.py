"""Time data in the datasets of a universal file."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from identification import IdentificationError
from rig.exchange.mat import ImportFailed
from rig.exchange.uff.reading import Dataset, degree_of
from rig.exchange.uff.units import file_units

__all__ = ["time_data_in"]

_SPARE = 0.01  # a recorder stops a few samples early or late


def time_data_in(datasets: Sequence[Dataset], assumed: str = "") -> dict[str, Any]:
    """The time functions (type 1) by name, one column a record, in SI where they have units; ``sets`` is the list of all.

    ``sample_rate_hz`` and ``units`` (of each name) go along. Raises `ImportFailed` without any, or on rates that disagree.
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
    """Records side by side, cut to the shortest."""
    shortest = min(map(len, records))
    return np.column_stack([record[:shortest] for record in records])


def _rate(function: Dataset) -> float:
    """Sample rate: the header's, or line 5's where that is the same to the header's six digits."""
    if function["abscissa_spacing"] != 1 or function["abscissa_inc"] <= 0.0:
        raise ImportFailed(f"{function['where']}: is not evenly sampled; wanted is a step above zero")
    rate = 1.0 / float(function["abscissa_inc"])
    told = re.match(r"sample rate (\S+) Hz", function["id5"])
    return float(told[1]) if told and abs(float(told[1]) / rate - 1.0) < 1e-5 else rate
