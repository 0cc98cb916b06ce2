"""Import frequency responses estimated elsewhere as a `FrequencyResponseMatrix`."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from identification.errors import IdentificationError
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.mapping.base import (
    ChannelMapping,
    ComplexPaths,
    MappingTable,
    Path,
    SpectrumMapping,
    complex_at,
    in_si,
    notes_of,
    value_at,
)
from identification.mapping.zero_line import without_line_at_0_hz
from vibrolock.arrays import Float


class PathMapping(MappingTable):
    """Frequency response of one output to one input."""

    output: str
    """Name of one of the outputs."""
    input: str
    """Name of one of the inputs."""
    value: Path | ComplexPaths
    """Path of complex numbers, or paths of their parts; in the output's unit over the input's unit."""


class ResponseMatrixMapping(SpectrumMapping):
    """Where frequency responses are in the data and what they mean."""

    kind: Literal["frequency-response-matrix"]
    estimator: str = "imported"
    """How the responses were estimated: ``H1``, ``H2`` ..."""
    outputs: Annotated[tuple[ChannelMapping, ...], Field(min_length=1)]
    """The responding channels."""
    inputs: Annotated[tuple[ChannelMapping, ...], Field(min_length=1)]
    """The exciting channels."""
    matrix: Path | None = None
    """Path of an array frequencies x outputs x inputs (the last may be left out for one input); or give ``paths``."""
    paths: tuple[PathMapping, ...] = ()
    """One entry for every pair of output and input."""


def map_response_matrix(data: Any, mapping: ResponseMatrixMapping) -> FrequencyResponseMatrix:
    """Return the frequency responses in ``data`` in SI units, without a line at 0 Hz that says nothing.

    Raises `IdentificationError` if a path does not exist, shapes or numbers do not fit, or a response is missing.

    Parameters
    ----------
    data
        What a file holds: nested mappings and arrays, as its reader returns them.
    mapping
        Where the quantities lie, in which units.
    """
    frequency = mapping.frequency_hz(data)
    outputs, out_factors = in_si(mapping.outputs)
    inputs, in_factors = in_si(mapping.inputs)
    value = _matrix(data, mapping, frequency.size) if mapping.matrix is not None else _paths(data, mapping, frequency)
    value = value * (out_factors[:, None] / in_factors)
    where = "`paths`" if mapping.matrix is None else "`matrix`"
    frequency, value, notes = without_line_at_0_hz(frequency, value, outputs, where)
    return FrequencyResponseMatrix(
        outputs=outputs,
        inputs=inputs,
        frequency_hz=frequency,
        value=value if mapping.sense == "exp(+iwt)" else np.conj(value),
        notes=(*notes_of(data), *notes),
        estimator=mapping.estimator,
        specimen=mapping.specimen,
    )


def _matrix(data: Any, mapping: ResponseMatrixMapping, lines: int) -> Any:
    array = np.asarray(value_at(data, str(mapping.matrix), "matrix"))
    wanted = (lines, len(mapping.outputs), len(mapping.inputs))
    if array.dtype.kind not in "iufc" or array.size != np.prod(wanted) or array.shape[0] != lines:
        raise IdentificationError(f"matrix '{mapping.matrix}': shape {array.shape}, needs {wanted}")
    return array.reshape(wanted).astype(np.complex128)


def _paths(data: Any, mapping: ResponseMatrixMapping, frequency_hz: Float) -> Any:
    outputs, inputs = ([channel.name for channel in group] for group in (mapping.outputs, mapping.inputs))
    lines, given = frequency_hz.size, set[tuple[str, str]]()
    value = np.full((lines, len(outputs), len(inputs)), complex(np.nan, np.nan))
    for number, path in enumerate(mapping.paths):
        where = f"paths[{number}]"
        for name, names in ((path.output, outputs), (path.input, inputs)):
            if name not in names:
                raise IdentificationError(f"{where}: '{name}' is none of {', '.join(names)}")
        response = complex_at(data, path.value, 1, f"{where}.value")
        if response.size != lines:
            raise IdentificationError(f"{response.size} values for {lines} frequencies", field=f"{where}.value")
        faults = ~np.isfinite(response) & (frequency_hz != 0.0)
        if faults.any():
            at = int(np.argmax(faults))
            raise IdentificationError(f"is not finite at [{at}], {frequency_hz[at]:g} Hz", field=f"{where}.value")
        value[:, outputs.index(path.output), inputs.index(path.input)] = response
        given.add((path.output, path.input))
    if missing := [f"{o} to {i}" for o in outputs for i in inputs if (o, i) not in given]:
        raise IdentificationError(f"the response of {', '.join(missing)} is missing", field="paths")
    return value
