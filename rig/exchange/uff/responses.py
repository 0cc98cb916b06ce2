"""Read frequency responses from the datasets of a universal file."""

import re
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from identification import Channel, FrequencyResponse, FrequencyResponseMatrix
from rig.exchange.child_reading import ImportFailed
from rig.exchange.uff.reading import Dataset, degree_of
from rig.exchange.uff.units import FileUnits, file_units


def _names(dataset: Dataset) -> tuple[str, str]:
    """Return the names of response and reference as written by this package, otherwise node and direction."""
    parts = dataset["id1"].split(" / ")
    if dataset["id4"].startswith("vibrolock") and len(parts) == 2:
        return parts[0], parts[1]
    return degree_of(dataset, "rsp"), degree_of(dataset, "ref")


def responses_in(datasets: Sequence[Dataset], assumed: str = "") -> list[Any]:
    """Return the functions of type 4 as one or several objects: `FrequencyResponseMatrix`, or levels of a stepped sine.

    Where a response is there more than once, each load case is a matrix of its own, in the order of the file: a level of a
    multisine, in a file of this package. The levels of a stepped sine of this package are one object. A response with the node
    and axis of a reference is the drive point. Raises `ImportFailed` for missing or duplicate paths, unequal frequencies, or
    unclear units.
    """
    functions = [dataset for dataset in datasets if dataset["type"] == 58 and dataset["func_type"] == 4]
    units = file_units(datasets, assumed)
    if functions and all(function["id4"] == "vibrolock frequency-responses" for function in functions):
        return [_stepped_sines(datasets, functions)]
    if not functions:
        raise ImportFailed(f"no frequency response (dataset 58 of function type 4) among {len(datasets)} datasets")
    names = [_names(function) for function in functions]
    if len(set(names)) == len(names):
        return [_matrix(functions, units)]
    cases = dict.fromkeys(function["load_case_id"] for function in functions)
    return [_matrix([one for one in functions if one["load_case_id"] == case], units) for case in cases]


def _matrix(functions: Sequence[Dataset], units: FileUnits) -> FrequencyResponseMatrix:
    """Return frequency responses of all outputs to all inputs; each is there once."""
    paths: dict[tuple[str, str], Any] = {}
    outputs: dict[str, Channel] = {}
    inputs: dict[str, Channel] = {}
    rms: dict[str, float] = {}
    frequency_hz = np.asarray(functions[0]["x"], dtype=np.float64)
    for function in functions:
        where, x = function["where"], function["x"]
        if len(x) != frequency_hz.size or not np.allclose(x, frequency_hz, rtol=1e-6):
            raise ImportFailed(f"{where}: its frequencies are not those of the first; import such files one by one")
        output, source = _names(function)
        if (output, source) in paths:
            raise ImportFailed(
                f"{where}: a second response of {output} to {source} in load case {function['load_case_id']}; wanted is one"
            )
        value, channels = _path(function, units, output, source)
        paths[output, source] = value
        if told := re.search(r", input RMS (\S+) ", function["id5"] + " "):
            rms[source] = float(told[1])
        for known, channel in zip((outputs, inputs), channels, strict=True):
            if known.setdefault(channel.name, channel).unit != channel.unit:
                raise ImportFailed(
                    f"{where}: {channel.name} is in {channel.unit}, before in {known[channel.name].unit}"
                )
            if channel.role == "drive":
                known[channel.name] = channel
    if missing := [f"{o} to {i}" for o in outputs for i in inputs if (o, i) not in paths]:
        raise ImportFailed(
            f"frequency responses: there is none of {', '.join(missing)}; wanted are all outputs to all inputs"
        )
    return FrequencyResponseMatrix(
        outputs=tuple(outputs.values()),
        inputs=tuple(inputs.values()),
        frequency_hz=frequency_hz,
        value=np.array([[paths[o, i] for i in inputs] for o in outputs]).transpose(2, 0, 1),
        estimator=_estimator(functions[0]),
        input_rms=tuple(rms[name] for name in inputs) if set(rms) == set(inputs) else (),
        specimen="" if functions[0]["id2"] == "NONE" else functions[0]["id2"],
    )


def _estimator(function: Dataset) -> str:
    found = re.search(r", estimator ([^,]+)", function["id5"])
    return found.group(1) if found else "imported"


def _path(function: Dataset, units: FileUnits, output: str, source: str) -> tuple[Any, tuple[Channel, Channel]]:
    """Return one response in SI, and its two channels."""
    where = function["where"]
    (out_unit, out_factor), (in_unit, in_factor) = (
        units.of(function, axis, where) for axis in ("ordinate", "orddenom")
    )
    value = np.asarray(function["data"], dtype=np.complex128) * (out_factor / in_factor)
    told = re.match(r"(\w+) / (\w+), estimator", function["id5"])
    if told:
        return value, (Channel(output, told[1], out_unit), Channel(source, told[2], in_unit))  # type: ignore[arg-type]
    same = (function["rsp_node"], abs(function["rsp_dir"])) == (function["ref_node"], abs(function["ref_dir"]))
    motion = out_unit in ("m", "m/s", "m/s2")
    role = "drive" if same and motion else "response" if motion else "monitor"
    return value, (
        Channel(output, role, out_unit),  # type: ignore[arg-type]
        Channel(source, "force" if in_unit == "N" else "monitor", in_unit),
    )


def _stepped_sines(datasets: Sequence[Dataset], functions: Sequence[Dataset]) -> tuple[FrequencyResponse, ...]:
    """Return the levels of a stepped sine as this package writes them: response over force, and the force."""
    forces = {d["func_id"]: d for d in datasets if d["type"] == 58 and d["func_type"] == 0}
    out = []
    for function in functions:
        told = re.fullmatch(r"controlled (\w+), level (\S+)", function["id5"])
        force = forces.get(function["func_id"])
        if told is None or force is None or len(force["data"]) != len(function["data"]):
            raise ImportFailed(f"{function['where']}: level or force of this stepped sine is missing")
        kind, controlled = function["ordinate_axis_lab"], cast(Any, told[1])
        label, specimen = ("" if function[key] == "NONE" else function[key] for key in ("id1", "id2"))
        drive = np.asarray(force["data"], dtype=np.complex128)
        response = FrequencyResponse(
            function["x"],
            drive,
            function["data"] * drive,
            kind,
            controlled,
            float(told[2]),
            label,
            specimen,
        )
        out.append(response)
    return tuple(out)
