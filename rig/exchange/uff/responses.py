"""Read frequency responses from the datasets of a universal file."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from identification import Channel, FrequencyResponse, FrequencyResponseMatrix, IdentificationError
from identification.common import Controlled, Motion, Role
from identification.mapping import without_line_at_0_hz
from rig.exchange.child_reading import ImportFailed
from rig.exchange.uff.units import FileUnits, file_units, hertz_of
from rig.exchange.universal_file import FREQUENCY_RESPONSE, GENERAL, Function, UniversalFile, degree_name
from vibrolock.arrays import Complex, Float


def _names(function: Function) -> tuple[str, str]:
    """Return the names of response and reference as written by this package, otherwise node and direction."""
    parts = function.lines[0].split(" / ")
    if function.own and len(parts) == 2:
        return parts[0], parts[1]
    return degree_name(function.response), degree_name(function.reference)


def responses_in(
    file: UniversalFile, assumed: str = ""
) -> Sequence[FrequencyResponseMatrix | tuple[FrequencyResponse, ...]]:
    """Return the functions of type 4 as one or several objects: `FrequencyResponseMatrix`, or levels of a stepped sine.

    Where a response is there more than once, each load case is a matrix of its own, in the order of the file: a level of a
    multisine, in a file of this package. The levels of a stepped sine of this package are one object. A response with the node
    and axis of a reference is the drive point; one in the opposite direction is turned. Responses in units of something else,
    such as a pressure, and functions of other types are left out, and a line at 0 Hz that says nothing, each with a note.
    Raises `ImportFailed` for missing or duplicate paths, unequal frequencies, or unclear units.
    """
    functions = file.of_type(FREQUENCY_RESPONSE)
    units = file_units(file, assumed)
    if functions and all(function.lines[3] == "vibrolock frequency-responses" for function in functions):
        return [_stepped_sines(file, functions)]
    if not functions:
        raise ImportFailed(f"no frequency response (dataset 58 of function type 4) among {file.count} datasets")
    functions, notes = _turned(*_of_motions(functions, units))
    notes = (*file.left_out(FREQUENCY_RESPONSE), *notes)
    names = [_names(function) for function in functions]
    if len(set(names)) == len(names):
        return [_matrix(functions, units, notes)]
    cases = dict.fromkeys(function.load_case for function in functions)
    return [_matrix([one for one in functions if one.load_case == case], units, notes) for case in cases]


def _of_motions(functions: Sequence[Function], units: FileUnits) -> tuple[list[Function], tuple[str, ...]]:
    """Return the functions whose units are understood, and a note on the others; raise the first error if all are others."""
    kept, errors, labels = [], list[IdentificationError](), dict[str, None]()
    for function in functions:
        try:
            units.of_response(function)
            kept.append(function)
        except IdentificationError as error:
            errors.append(error)
            labels[f"{function.ordinate.unit or '?'}/{function.denominator.unit or '?'}"] = None
    if not kept:
        raise errors[0]
    told = f"left out of the universal file: {len(errors)} frequency responses in {', '.join(labels)}"
    return kept, (told,) if errors else ()


def _turned(functions: Sequence[Function], notes: tuple[str, ...]) -> tuple[list[Function], tuple[str, ...]]:
    """Return the functions with the responses turned that are opposite to the direction of a force at their node."""
    forces = {(one.reference[0], one.reference[1]) for one in functions}
    against = {(node, -direction) for node, direction in forces if direction} - forces
    turned = {(one.response[0], one.response[1]) for one in functions if not one.own} & against
    notes += tuple(
        f"{degree_name(one)} is turned to {degree_name((one[0], -one[1]))}, the direction of the force there"
        for one in sorted(turned)
    )
    return [
        replace(one, response=(one.response[0], -one.response[1]), data=-np.asarray(one.data))
        if tuple(one.response) in turned
        else one
        for one in functions
    ], notes


def _frequencies(function: Function) -> Float:
    return np.asarray(function.x * hertz_of(function))


def _matrix(functions: Sequence[Function], units: FileUnits, notes: tuple[str, ...]) -> FrequencyResponseMatrix:
    paths: dict[tuple[str, str], Complex] = {}
    outputs: dict[str, Channel] = {}
    inputs: dict[str, Channel] = {}
    rms: dict[str, float] = {}
    frequency_hz = _frequencies(functions[0])
    for function in functions:
        where, x = function.where, _frequencies(function)
        if len(x) != frequency_hz.size or not np.allclose(x, frequency_hz, rtol=1e-6):
            raise ImportFailed(f"{where}: its frequencies are not those of the first; import such files one by one")
        output, source = _names(function)
        if (output, source) in paths:
            raise ImportFailed(
                f"{where}: a second response of {output} to {source} in load case {function.load_case}; expected one"
            )
        value, channels = _path(function, units, output, source)
        paths[output, source] = value
        if level := re.search(r", input RMS (\S+) ", function.lines[4] + " "):
            rms[source] = float(level[1])
        for known, channel in zip((outputs, inputs), channels, strict=True):
            if known.setdefault(channel.name, channel).unit != channel.unit:
                raise ImportFailed(
                    f"{where}: {channel.name} is in {channel.unit}, before in {known[channel.name].unit}"
                )
            if channel.role == "drive":
                known[channel.name] = channel
    _check_complete(paths, outputs, inputs)
    estimator = re.search(r", estimator ([^,]+)", functions[0].lines[4])
    value = np.array([[paths[o, i] for i in inputs] for o in outputs]).transpose(2, 0, 1)
    frequency_hz, value, zero = without_line_at_0_hz(frequency_hz, value, tuple(outputs.values()), functions[0].where)
    return FrequencyResponseMatrix(
        outputs=tuple(outputs.values()),
        inputs=tuple(inputs.values()),
        frequency_hz=frequency_hz,
        value=value,
        notes=(*notes, *zero),
        estimator=estimator[1] if estimator else "imported",
        input_rms=tuple(rms[name] for name in inputs) if set(rms) == set(inputs) else (),
        specimen=_text(functions[0].lines[1]),
    )


def _check_complete(paths: Mapping[tuple[str, str], Complex], outputs: Iterable[str], inputs: Iterable[str]) -> None:
    sources = list(inputs)
    if missing := [f"{o} to {i}" for o in outputs for i in sources if (o, i) not in paths]:
        raise ImportFailed(
            f"frequency responses: there is none of {', '.join(missing)}; expected all outputs to all inputs"
        )


def _text(line: str) -> str:
    return "" if line == "NONE" else line


def _path(function: Function, units: FileUnits, output: str, source: str) -> tuple[Complex, tuple[Channel, Channel]]:
    """Return one response in SI, and its two channels."""
    out_unit, in_unit, factor = units.of_response(function)
    if not np.iscomplexobj(function.data):
        raise ImportFailed(
            f"{function.where}: the frequency response is stored as real numbers; expected complex ones, with their phases"
        )
    value = np.asarray(function.data, dtype=np.complex128) * factor
    if roles := re.match(r"(\w+) / (\w+), estimator", function.lines[4]):
        return value, (Channel(output, cast(Role, roles[1]), out_unit), Channel(source, cast(Role, roles[2]), in_unit))
    (node, direction), (at, along) = function.response, function.reference
    same = (node, abs(direction)) == (at, abs(along))
    motion = out_unit in ("m", "m/s", "m/s2")
    role: Role = "drive" if same and motion else "response" if motion else "monitor"
    return value, (Channel(output, role, out_unit), Channel(source, "force" if in_unit == "N" else "monitor", in_unit))


def _stepped_sines(file: UniversalFile, functions: Sequence[Function]) -> tuple[FrequencyResponse, ...]:
    """Return the levels of a stepped sine as this package writes them: response over force, and the force."""
    forces = {one.number: one for one in file.of_type(GENERAL)}
    out = []
    for function in functions:
        level = re.fullmatch(r"controlled (\w+), level (\S+)", function.lines[4])
        force = forces.get(function.number)
        if level is None or force is None or force.data.size != function.data.size:
            raise ImportFailed(f"{function.where}: level or force of this stepped sine is missing")
        drive = np.asarray(force.data, dtype=np.complex128)
        out.append(
            FrequencyResponse(
                frequency_hz=function.x,
                force=drive,
                response=np.asarray(function.data, np.complex128) * drive,
                kind=cast(Motion, function.ordinate.label),
                controlled=cast(Controlled, level[1]),
                level=float(level[2]),
                label=_text(function.lines[0]),
                specimen=_text(function.lines[1]),
            )
        )
    return tuple(out)
