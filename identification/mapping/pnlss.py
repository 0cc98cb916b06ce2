"""Import nonlinear state-space models from elsewhere, a structure with A to F and powers, as `PnlssModel`."""

from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from identification.errors import IdentificationError
from identification.mapping.base import ChannelMapping, MeasurementMapping, Path, in_si, value_at
from identification.models.pnlss.features import Features
from identification.models.pnlss.model import PnlssModel
from vibrolock.arrays import Float


class PnlssMapping(MeasurementMapping):
    """Where the matrices of a model are in the data and what they mean; the states are in the model's own units."""

    kind: Literal["pnlss"]
    model: Path = "model"
    """Path of the structure with ``A``, ``B``, ``C``, ``D``, ``E``, ``F``, ``xpowers`` and ``ypowers``."""
    sample_rate_hz: Annotated[float, Field(gt=0)] | None = None
    """Sample rate of the model; give this or ``sample_rate``."""
    sample_rate: Path | None = None
    """Path of the sample rate, Hz."""
    inputs: Annotated[tuple[ChannelMapping, ...], Field(min_length=1)]
    """The inputs in the order of the columns of B."""
    outputs: Annotated[tuple[ChannelMapping, ...], Field(min_length=1)]
    """The outputs in the order of the rows of C."""

    @model_validator(mode="after")
    def _one_rate(self) -> "PnlssMapping":
        if (self.sample_rate_hz is None) == (self.sample_rate is None):
            raise ValueError("give sample_rate_hz or sample_rate, one of the two")
        return self


def map_pnlss(data: Any, mapping: PnlssMapping) -> PnlssModel:
    """Return the model in ``data``, in SI units; powers have a row per monomial, with columns for states, then inputs.

    Raises `IdentificationError` if a path does not exist, shapes do not fit, values are NaN, or powers are not integers.

    Parameters
    ----------
    data
        What a file holds: nested mappings and arrays, as its reader returns them.
    mapping
        Where the quantities lie, in which units.
    """
    inputs, of_inputs = in_si(mapping.inputs)
    outputs, of_outputs = in_si(mapping.outputs)
    m, p = len(inputs), len(outputs)
    a = _array(data, mapping, "A")
    n = round(float(np.sqrt(a.size)))
    xpowers, ypowers = (_powers(data, mapping, name, n + m) for name in ("xpowers", "ypowers"))
    shapes = {"a": (n, n), "b": (n, m), "c": (p, n), "d": (p, m), "e": (n, len(xpowers)), "f": (p, len(ypowers))}
    matrices: dict[str, Any] = {}
    for name, shape in shapes.items():
        array = _array(data, mapping, name.upper())
        if array.size != shape[0] * shape[1] or (array.ndim == 2 and 1 not in shape and array.shape != shape):
            raise IdentificationError(f"shape {array.shape}", field=name.upper(), allowed=f"{shape}")
        matrices[name] = array.reshape(shape)  # file readers drop dimensions of size one
    rate_hz = mapping.sample_rate_hz
    if mapping.sample_rate is not None:
        rate_hz = float(np.asarray(value_at(data, mapping.sample_rate, "sample_rate"), dtype=float).ravel()[0])
    found = PnlssModel(
        **matrices,
        state_features=Features(variables=n + m, exponents=xpowers),
        output_features=Features(variables=n + m, exponents=ypowers),
        sample_rate_hz=float(rate_hz or 0.0),
        inputs=inputs,
        outputs=outputs,
        state_range=np.full(n, np.nan),
        input_range=np.full(m, np.nan),
        specimen=mapping.specimen,
        notes=("imported: the range of its training data is not known",),
    )
    return found.scaled(states=np.ones(n), inputs=1.0 / of_inputs, outputs=1.0 / of_outputs)


def _array(data: Any, mapping: PnlssMapping, name: str) -> Float:
    where = f"{mapping.model}.{name}"
    try:
        return np.asarray(value_at(data, where, name), dtype=np.float64)
    except (TypeError, ValueError):
        raise IdentificationError(f"{where}: holds no real numbers") from None


def _powers(data: Any, mapping: PnlssMapping, name: str, variables: int) -> NDArray[np.int64]:
    array = _array(data, mapping, name)
    if array.size and array.shape[-1:] != (variables,):
        reason = f"shape {array.shape}"
        raise IdentificationError(reason, field=name, allowed=f"{variables} columns: states, then inputs")
    powers = np.round(array).astype(np.int64)
    IdentificationError.raise_if(not np.array_equal(powers, array), "are no whole numbers", field=name)
    return powers.reshape(-1, variables)
