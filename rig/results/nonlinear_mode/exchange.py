"""Kinds of objects that are exchanged, each with its conversion to arrays and back."""

from functools import partial

import numpy as np

from identification import (
    NonlinearMode,
)
from identification.common import decode, encode
from identification.nonlinear import QUANTITIES
from rig.results.kind import Exchange
from rig.text.contents import Contents, Labels, unit_of


def _nonlinear_mode(mode: NonlinearMode) -> Contents:
    arrays, attributes = encode(mode)
    size = len(mode.force_n)
    rows = {name: 0 for name, array in arrays.items() if array.ndim and array.shape[0] == size}
    units = np.array([unit_of(name) for name in QUANTITIES])
    further = {"systematic_std": units, "random_std": units, "interval_95": units[:, None]}
    labels: dict[str, Labels] = dict.fromkeys(("systematic_std", "random_std"), (QUANTITIES,))
    labels |= {"interval_95": (QUANTITIES, ("low", "high"))}
    return Contents("nonlinear-mode", mode.specimen, arrays, attributes, rows, further, labels)


EXCHANGE = Exchange("nonlinear-mode", NonlinearMode, _nonlinear_mode, partial(decode, NonlinearMode))
