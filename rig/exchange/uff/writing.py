"""Write objects as datasets of a universal file.

Frequency responses are functions of type 4, time data are functions of type 1, and modes are dataset 55. Tables over points or
modes that have no type of their own (backbones, nonlinear modes) are written as functions of type 0: one function per column,
over the row number.
"""

import warnings
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np

from identification import Channel
from rig.errors import RecordingError
from rig.exchange.uff.codes import WIDTH, axis, channel_lines, degrees_of_freedom, evenly
from rig.exchange.universal_file import FREQUENCY_RESPONSE, GENERAL, TIME_RESPONSE
from rig.text.contents import Array, Contents

Dataset = dict[str, object]
"""Fields of a dataset, as pyuff writes them."""
_PROGRAM = "vibrolock"
_MATRIX = "frequency-response-matrix"


def write_uff(items: Sequence[Contents], path: Path, encoding: str = "") -> None:
    """Write header, units (SI) and the datasets of all items to an empty file; may raise any error of pyuff.

    ``encoding`` of the functions (dataset 58) is ``ascii`` (12 digits; 6 for uneven abscissas) or ``binary`` (every bit); by
    default time data are binary and all else is ASCII. Levels of frequency responses differ by their load case, from 1.

    Raises `RecordingError` for a kind that universal files cannot represent, and for NaN in a function.
    """
    import pyuff

    class Writer(pyuff.UFF):  # type: ignore[misc]
        def refresh(self) -> bool:
            """Do nothing, instead of reading the whole file again after every dataset."""
            return False

    writer = Writer(str(path))
    for dataset in [*_head(items), *_functions(items, encoding)]:
        if not np.all(np.isfinite(np.asarray(dataset.get("data", 0.0)))):
            raise RecordingError(f"'{dataset['id1']}' holds a number that is not finite, which universal files cannot")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves a binary file to the garbage collector
            writer.write_sets(dataset, "add")


def _functions(items: Sequence[Contents], encoding: str) -> Iterator[Dataset]:
    """Yield the datasets of all items in an encoding; levels of frequency responses with numbers as load cases."""
    several = sum(item.kind == _MATRIX for item in items) > 1
    level = 0
    for item in items:
        level += item.kind == _MATRIX
        for dataset in _DATASETS.get(item.kind, _refused)(item):
            case = {"load_case_id": level} if several and item.kind == _MATRIX else {}
            encoded = {"binary": int(encoding == "binary")} if encoding and dataset["type"] == 58 else {}
            yield {**dataset, **case, **encoded}


def _head(items: Sequence[Contents]) -> list[Dataset]:
    now = datetime.now()
    day, hour = now.strftime("%d-%b-%y"), now.strftime("%H:%M:%S")
    names = ("db_created", "db_saved", "file_written")
    dates = {f"{what}_{name}": value for name in names for what, value in (("date", day), ("time", hour))}
    header = {"type": 151, "model_name": _ascii(items[0].title), "description": items[0].kind, "db_app": _PROGRAM}
    units = {"type": 164, "units_code": 1, "units_description": "SI", "temp_mode": 1}
    factors = {"length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15}
    return [{**header, **dates, "program": _PROGRAM}, {**units, **factors}]


def _ascii(text: str) -> str:
    """Return a line of at most 80 ASCII characters; ``NONE`` if it would be empty."""
    return text.encode("ascii", "replace").decode().replace("\n", " ")[:WIDTH].strip() or "NONE"


def _function(kind: int, number: int, title: str, item: Contents, x: Array, data: Array) -> Dataset:
    """Return a function without its degrees of freedom. Its abscissa is marked as even if the header can represent it."""
    even = evenly(x)
    abscissa = x if len(x) > 1 else np.array([x[0], x[0] + 1.0])  # the writer needs a step
    out: Dataset = {"type": 58, "func_type": kind, "func_id": number, "ver_num": 1, "load_case_id": 0, "binary": 0}
    texts = {"id1": _ascii(title), "id2": _ascii(item.title), "id4": _ascii(f"{_PROGRAM} {item.kind}"), "id5": "NONE"}
    texts["id3"] = datetime.now().strftime("%d-%b-%y %H:%M:%S")
    double = {"x": abscissa if even else x, "data": np.array(data), "abscissa_spacing": int(even)}
    return {**out, **texts, **double, **axis("orddenom", "", ""), **axis("z_axis", "", "")}


def _at(prefix: str, name: str, degree: tuple[int, int]) -> Dataset:
    return {f"{prefix}_ent_name": _ascii(name)[:10], f"{prefix}_node": degree[0], f"{prefix}_dir": degree[1]}


def _channels(item: Contents, name: str = "channels") -> list[Channel]:
    return [Channel(**channel) for channel in item.attributes[name]]


def _time_data(item: Contents) -> Iterator[Dataset]:
    """Yield one binary function of type 1 per channel. Line 5 has the full sample rate; the header has only six digits."""
    channels, rate = _channels(item), item.attributes["sample_rate_hz"]
    degrees = degrees_of_freedom(channels)
    x = item.arrays["time_s"]
    for number, channel in enumerate(channels):
        samples = item.arrays["samples"][number].astype(np.float64)
        function = _function(TIME_RESPONSE, item.attributes["point"], channel.name, item, x, samples)
        function |= {"binary": 1, "abscissa_spacing": 1, "id5": _ascii(f"sample rate {rate!r} Hz, {channel.role}")}
        axes = axis("abscissa", "Time", "s") | axis("ordinate", channel.name, channel.unit)
        yield function | _at("rsp", channel.name, degrees[channel.name]) | _at("ref", "NONE", (0, 0)) | axes


def _response_matrix(item: Contents) -> Iterator[Dataset]:
    """Yield one function of type 4 per output and input. Covariances are written only to MAT and CSV."""
    outputs, inputs = _channels(item, "outputs"), _channels(item, "inputs")
    degrees = degrees_of_freedom([*outputs, *inputs])
    x = item.arrays["frequency_hz"]
    for column, source in enumerate(inputs):
        for row, output in enumerate(outputs):
            title = f"{output.name} / {source.name}"
            function = _function(FREQUENCY_RESPONSE, row + 1, title, item, x, item.arrays["value"][:, row, column])
            rms = item.attributes["input_rms"][column] if item.attributes["input_rms"] else None
            level = "" if rms is None else f", input RMS {rms!r} {source.unit}"
            estimator = item.attributes["estimator"] or "unknown"
            function["id5"] = _ascii(f"{output.role} / {source.role}, estimator {estimator}{level}")
            function["id2"] = _ascii(item.attributes["specimen"])
            axes = axis("abscissa", "Frequency", "Hz") | axis("ordinate", output.name, output.unit)
            places = _at("rsp", output.name, degrees[output.name]) | _at("ref", source.name, degrees[source.name])
            yield function | places | axes | axis("orddenom", source.name, source.unit)


def _table(item: Contents) -> Iterator[Dataset]:
    """Yield one function of type 0 per column, over the row number from 1. Rows that are NaN are left out."""
    number = 0
    for name in item.rows:
        for title, unit, values in _complex_columns(item, name):
            number += 1
            known = np.isfinite(values)
            if not known.any():
                continue
            rows = np.flatnonzero(known) + 1.0
            function = _function(GENERAL, number, title, item, rows, values[known])
            nowhere = _at("rsp", "NONE", (0, 0)) | _at("ref", "NONE", (0, 0))
            yield function | nowhere | axis("abscissa", "Point", "") | axis("ordinate", name, unit)


def _complex_columns(item: Contents, name: str) -> Iterator[tuple[str, str, Array]]:
    columns = item.columns(name)
    if not np.iscomplexobj(item.arrays[name]):
        yield from ((title, unit, values.astype(np.float64)) for title, unit, values in columns)
        return
    for (title, unit, real), (_, _, imaginary) in zip(columns[::2], columns[1::2], strict=True):
        yield title.removesuffix(".re"), unit, real + 1j * imaginary


def _frequency_responses(item: Contents) -> Iterator[Dataset]:
    """Yield for each level: response over force (type 4) and force (type 0), over the measured frequencies."""
    ends = np.cumsum(item.arrays["points_per_level"])
    for number, end in enumerate(ends):
        rows = slice(end - item.arrays["points_per_level"][number], end)
        level = item.attributes["levels"][number]
        unit = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s2"}[level["kind"]]
        x, force = item.arrays["frequency_hz"][rows], item.arrays["force"][rows]
        level_line = _ascii(f"controlled {level['controlled']}, level {float(item.arrays['level'][number])!r}")
        ratio = _function(
            FREQUENCY_RESPONSE, number + 1, level["label"], item, x, item.arrays["response"][rows] / force
        )
        forces = _function(GENERAL, number + 1, level["label"], item, x, force)
        abscissa, drive = axis("abscissa", "Frequency", "Hz"), _at("rsp", "drive", (1, 3))
        ratio |= abscissa | axis("ordinate", level["kind"], unit) | axis("orddenom", "force", "N") | drive
        forces |= abscissa | axis("ordinate", "force", "N") | _at("rsp", "force", (1, 3)) | _at("ref", "NONE", (0, 0))
        yield ratio | _at("ref", "force", (1, 3)) | {"id2": _ascii(level["specimen"]), "id5": level_line}
        yield forces | {"id2": _ascii(level["specimen"]), "id5": level_line}


def _modes(item: Contents) -> Iterator[Dataset]:
    """Yield one dataset 55 per normal mode: modal mass 1 kg, shape in +Z; lines 3 to 5 name the channels of the nodes."""
    channels = _channels(item)
    if not any(channel.role == "drive" for channel in channels):
        raise RecordingError(
            "the modes have no drive point and so no modal mass, which universal files need; use mat or csv"
        )
    degrees = degrees_of_freedom(channels)
    lines = channel_lines(channels)
    for mode, frequency in enumerate(item.arrays["frequency_hz"]):
        shape = np.asarray(item.arrays["shapes"][:, mode], dtype=np.float64)
        nothing = np.zeros_like(shape)
        yield {
            **{"type": 55, "model_type": 1, "analysis_type": 2, "data_ch": 2, "spec_data_type": 8, "load_case": 1},
            **{"id1": _ascii(f"mode {mode + 1}, mass-normalised"), "id2": _ascii(item.title)},
            **dict(zip(("id3", "id4", "id5"), lines, strict=True)),
            **{"mode_n": mode + 1, "freq": float(frequency), "modal_m": 1.0},
            **{"modal_damp_vis": float(item.arrays["damping_ratio"][mode]), "modal_damp_his": 0.0},
            **{
                "node_nums": [degrees[channel.name][0] for channel in channels],
                "r1": nothing,
                "r2": nothing,
                "r3": shape,
            },
        }


def _refused(item: Contents) -> Iterator[Dataset]:
    raise RecordingError(f"a {item.kind} has no form in universal files; choose mat or csv")


_DATASETS = {
    "backbone": _table,
    "frequency-responses": _frequency_responses,
    "frequency-response-matrix": _response_matrix,
    "linear-modes": _modes,
    "nonlinear-mode": _table,
    "sweep": _refused,
    "time-data": _time_data,
}
