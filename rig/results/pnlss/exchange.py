"""Exchange of nonlinear state-space models: coefficient matrices under the names used by PNLSS toolboxes."""

from typing import Any

import numpy as np

from identification import PnlssModel
from identification.common import Arrays, Attributes, decode, encode
from rig.results.kind import Exchange
from rig.text.contents import Contents

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
"""Names of the arrays in exchanged files, with their names in this program's files."""


def pnlss_parts(model: PnlssModel) -> Contents:
    """Convert a model to A to F, powers of the monomials (one row each; states, then inputs), and all other data.

    ``n``, ``m``, ``p``: numbers of states, inputs, outputs; ``nx``, ``ny``: degrees that occur; ``fs``: sample rate. These are
    for readers only.
    """
    arrays, attributes = encode(model)
    out: dict[str, Any] = {outside: np.asarray(arrays[name]) for outside, name in _NAMES.items()}
    for powers in ("xpowers", "ypowers"):
        out[powers] = out[powers].astype(float)  # MATLAB's number type
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


def pnlss_from(arrays: Arrays, attributes: Attributes) -> PnlssModel:
    """Convert the output of `pnlss_parts` back to a model."""
    inside = {name: np.asarray(arrays[outside]) for outside, name in _NAMES.items()}
    for name in ("state_features/exponents", "output_features/exponents"):
        inside[name] = inside[name].astype(np.int64)
    return decode(PnlssModel, inside, attributes)


EXCHANGE = Exchange("pnlss", PnlssModel, pnlss_parts, pnlss_from)
