"""Nonlinear state-space models as they are exchanged: coefficient matrices under the names that PNLSS toolboxes give them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from identification import PnlssModel
from rig.text.contents import Contents

__all__ = ["pnlss_from", "pnlss_parts"]

_NAMES = {
    **{name.upper(): name for name in ("a", "b", "c", "d", "e", "f")},
    "xpowers": "state_features/exponents",
    "ypowers": "output_features/exponents",
    "xweights": "state_features/weights",
    "yweights": "output_features/weights",
    "xlimits": "state_features/limits",
    "ylimits": "output_features/limits",
    "state_range": "state_range",
    "input_range": "input_range",
}
"""Names of the arrays outside, and in files of ours."""


def pnlss_parts(model: PnlssModel) -> Contents:
    """A model by A to F, powers of the monomials (rows; states, then inputs), and what else there is.

    ``n``, ``m``, ``p``: states, inputs, outputs; ``nx``, ``ny``: degrees that occur; ``fs``: sample rate; for readers only.
    """
    arrays, attributes = model.to_arrays()
    out: dict[str, Any] = {outside: np.asarray(arrays[name]) for outside, name in _NAMES.items()}
    for powers in ("xpowers", "ypowers"):
        out[powers] = out[powers].astype(float)  # as MATLAB has its numbers
    out |= {
        "n": np.array([float(model.states)]),
        "m": np.array([float(len(model.inputs))]),
        "p": np.array([float(len(model.outputs))]),
        "nx": np.unique(out["xpowers"].sum(axis=1)),
        "ny": np.unique(out["ypowers"].sum(axis=1)),
        "fs": np.array([model.sample_rate_hz]),
    }
    units: dict[str, Any] = {"fs": "Hz", **dict.fromkeys((*_NAMES,), "SI, by the channels")}
    units |= dict.fromkeys(("xpowers", "ypowers"), "1")
    return Contents("pnlss", model.specimen, out, attributes, {}, units)


def pnlss_from(arrays: Mapping[str, Any], attributes: Mapping[str, Any]) -> PnlssModel:
    """Inverse of `pnlss_parts`."""
    inside = {name: np.asarray(arrays[outside]) for outside, name in _NAMES.items()}
    for name in ("state_features/exponents", "output_features/exponents"):
        inside[name] = inside[name].astype(np.int64)
    return PnlssModel.from_arrays(inside, attributes)
