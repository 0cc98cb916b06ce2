"""Datasets of a universal file, checked for being whole."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rig.exchange.mat import ImportFailed
from rig.system.text_files import read_bytes

__all__ = ["Dataset", "degree_of", "read_uff"]

Dataset = Mapping[str, Any]
LARGEST_BYTES = 2_000_000_000
_KNOWN = (55, 58, 151, 164)
_DIRECTION = {0: "", 1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}


def read_uff(path: Path) -> list[Dataset]:
    """Datasets 55, 58, 151 and 164 of a universal file, in their order.

    Raises `ImportFailed`: missing, no universal file, cut short, or a dataset that cannot be read.
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
    except Exception as error:  # pyuff raises nothing more special
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
    """Node and direction as text, ``3+Z``."""
    direction = int(dataset[f"{prefix}_dir"])
    sign = _DIRECTION.get(abs(direction), f"?{direction}")
    return f"{dataset[f'{prefix}_node']}{sign.replace('+', '-') if direction < 0 else sign}"
