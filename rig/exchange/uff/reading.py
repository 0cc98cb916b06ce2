"""Datasets of a universal file, and the objects in them."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from identification import Channel, FrequencyResponse, FrequencyResponseMatrix, IdentificationError, LinearModes
from rig.exchange.mat import ImportFailed
from rig.exchange.uff.codes import channels_in
from rig.exchange.uff.units import FileUnits, file_units

__all__ = ["modes_in", "read_uff", "responses_in", "time_data_in"]

Dataset = Mapping[str, Any]
_KNOWN = (55, 58, 151, 164)
_DIRECTION = {0: "", 1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}


def read_uff(path: Path) -> list[Dataset]:
    """Datasets 55, 58, 151 and 164 of a universal file, in their order.

    Raises `ImportFailed`: missing, no universal file, cut short, or a dataset that cannot be read.
    """
    import pyuff

    try:
        text = path.read_bytes()
    except OSError as error:
        raise ImportFailed(f"{path}: cannot be read ({error.strerror})") from None
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


def _degree(dataset: Dataset, prefix: str) -> str:
    """Node and direction as text, ``3+Z``."""
    direction = int(dataset[f"{prefix}_dir"])
    sign = _DIRECTION.get(abs(direction), f"?{direction}")
    return f"{dataset[f'{prefix}_node']}{sign.replace('+', '-') if direction < 0 else sign}"


def _names(dataset: Dataset) -> tuple[str, str]:
    """Names of response and reference: those that this package writes, else entity, else node and direction."""
    parts = dataset["id1"].split(" / ")
    if dataset["id4"].startswith("vibrolock") and len(parts) == 2:
        return parts[0], parts[1]
    return _degree(dataset, "rsp"), _degree(dataset, "ref")


def responses_in(datasets: Sequence[Dataset], assumed: str = "") -> Any:
    """The functions of type 4: a `FrequencyResponseMatrix`, or the levels of a stepped sine that this package wrote.

    A response whose node and axis are those of a reference is the drive point; opposite directions turn its sign.
    Raises `ImportFailed` on missing or double paths, unequal frequencies, or unclear units.
    """
    functions = [dataset for dataset in datasets if dataset["type"] == 58 and dataset["func_type"] == 4]
    units = file_units(datasets, assumed)
    if functions and all(function["id4"] == "vibrolock frequency-responses" for function in functions):
        return _stepped_sines(datasets, functions)
    if not functions:
        raise ImportFailed(f"no frequency response (dataset 58 of function type 4) among {len(datasets)} datasets")
    paths: dict[tuple[str, str], Any] = {}
    outputs: dict[str, Channel] = {}
    inputs: dict[str, Channel] = {}
    frequency_hz = np.asarray(functions[0]["x"], dtype=np.float64)
    for function in functions:
        where, x = function["where"], function["x"]
        if len(x) != frequency_hz.size or not np.allclose(x, frequency_hz, rtol=1e-6):
            raise ImportFailed(f"{where}: its frequencies are not those of the first; import such files one by one")
        output, source = _names(function)
        if (output, source) in paths:
            raise ImportFailed(f"{where}: a second response of {output} to {source}; wanted is one, take levels apart")
        value, channels = _path(function, units, output, source)
        paths[output, source] = value
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
        specimen="" if functions[0]["id2"] == "NONE" else functions[0]["id2"],
    )


def _estimator(function: Dataset) -> str:
    found = re.search(r", estimator ([^,]+)", function["id5"])
    return found.group(1) if found else "imported"


def _path(function: Dataset, units: FileUnits, output: str, source: str) -> tuple[Any, tuple[Channel, Channel]]:
    """One response in SI, and its two channels."""
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
    """The levels of a stepped sine as this package writes them: response over force, and the force."""
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


def modes_in(datasets: Sequence[Dataset], assumed: str = "", drive: str = "") -> LinearModes:
    """The normal modes (dataset 55, analysis type 2), mass-normalised by their modal mass.

    ``drive`` is the driven degree of freedom (``1+Z``), wanted where the file was not written by this package. Raises
    `ImportFailed` without modes or drive point, on modal masses that are not above zero, complex shapes.
    """
    modes = sorted((d for d in datasets if d["type"] == 55 and d["analysis_type"] == 2), key=lambda d: d["freq"])
    if not modes:
        raise ImportFailed(
            "no normal mode (dataset 55 of analysis type 2) in the file; complex modes are not understood"
        )
    first = modes[0]
    to_kg = file_units(datasets, assumed).mass_factor(first["where"])
    for mode in modes:
        if list(mode["node_nums"]) != list(first["node_nums"]):
            raise ImportFailed(f"{mode['where']}: its nodes are not those of the first mode")
        if np.iscomplexobj(mode["r1"]) or mode["modal_m"] <= 0.0:
            raise ImportFailed(
                f"{mode['where']}: modal mass {mode['modal_m']:g}, wanted is a real shape and a modal mass above zero; "
                "export the modes with their modal masses"
            )
    columns = np.array([[mode[axis] for axis in ("r1", "r2", "r3")] for mode in modes])  # mode, direction, node
    told = channels_in([first[f"id{line}"] for line in (3, 4, 5)])
    if told is not None and len(told) == columns.shape[2]:
        channels, shapes = told, columns[:, 2].T
    else:
        channels, shapes = _degrees(first["node_nums"], columns, drive)
    shapes = shapes / np.sqrt([mode["modal_m"] * to_kg for mode in modes])
    row = next(index for index, channel in enumerate(channels) if channel.role == "drive")
    shapes = shapes * np.where(shapes[row] < 0.0, -1.0, 1.0)
    return _linear_modes(modes, channels, shapes, first)


def _degrees(nodes: Any, columns: Any, drive: str) -> tuple[tuple[Channel, ...], Any]:
    """Channels and shapes of all degrees of freedom that move in any mode."""
    moving = [(k, j) for j in range(columns.shape[2]) for k in range(3) if np.any(columns[:, k, j])]
    names = [f"{int(nodes[j])}+{'XYZ'[k]}" for k, j in moving]
    if drive not in names:
        raise ImportFailed(f"--drive: is '{drive}', which says where the force acts; allowed are {', '.join(names)}")
    channels = tuple(Channel(name, "drive" if name == drive else "response", "m") for name in names)
    return channels, np.array([columns[:, k, j] for k, j in moving])


def _linear_modes(modes: Sequence[Dataset], channels: tuple[Channel, ...], shapes: Any, first: Dataset) -> LinearModes:
    unknown, nothing = np.full(len(modes), np.nan), np.zeros(len(channels), dtype=np.complex128)
    frequency_hz = np.array([mode["freq"] for mode in modes])
    return LinearModes(
        channels=channels,
        frequency_hz=frequency_hz,
        frequency_std_hz=unknown,
        damping_ratio=np.array([mode["modal_damp_vis"] for mode in modes]),
        damping_ratio_std=unknown,
        shapes=shapes,
        shapes_std=np.full_like(shapes, np.nan),
        phase_collinearity=unknown,
        lower=nothing,
        upper=nothing,
        lowest_hz=float(frequency_hz[0]),
        highest_hz=float(frequency_hz[-1]),
        specimen="" if first["id2"] == "NONE" else first["id2"],
        notes=("from a universal file: six digits, without residual terms and standard errors",),
    )


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
        name = function["id1"] if function["id4"].startswith("vibrolock") else _degree(function, "rsp")
        try:
            unit, factor = units.of(function, "ordinate", function["where"])
        except (ImportFailed, IdentificationError):
            if assumed or int(function["ordinate_spec_data_type"]):
                raise
            unit, factor = "", 1.0  # an unknown quantity without unit: the mapping says what it is
        stored.append(np.asarray(function["data"], dtype=np.float64) * factor)
        out.setdefault(name, []).append(stored[-1])
        if len(stored[-1]) != len(out[name][0]):
            raise ImportFailed(
                f"{function['where']}: {name} has {len(stored[-1])} samples, before {len(out[name][0])}; wanted are records "
                "of one length"
            )
        known[name] = unit
    return {
        **{name: np.column_stack(records) for name, records in out.items()},
        "sets": stored,
        "units": known,
        "sample_rate_hz": rates[0],
    }


def _rate(function: Dataset) -> float:
    """Sample rate: the header's, or line 5's where that is the same to the header's six digits."""
    if function["abscissa_spacing"] != 1 or function["abscissa_inc"] <= 0.0:
        raise ImportFailed(f"{function['where']}: is not evenly sampled; wanted is a step above zero")
    rate = 1.0 / float(function["abscissa_inc"])
    told = re.match(r"sample rate (\S+) Hz", function["id5"])
    return float(told[1]) if told and abs(float(told[1]) / rate - 1.0) < 1e-5 else rate
