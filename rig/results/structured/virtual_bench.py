"""A bench with a virtual rig from an identified structured model: its modes and elements behind the exciter of a bench."""

import math
from pathlib import Path

import numpy as np

from identification import IdentificationError, NonlinearElement, StructuredModel
from identification.common import find_role
from identification.models import Joint
from rig.bench import Bench, load_bench
from rig.bench.bench import DriverChoice
from rig.bench.channels import Channel
from rig.bench.configuration import Table, validated
from rig.bench.cross_checks import refuse
from rig.bench.user_code import refuse_code
from rig.drivers.virtual import VirtualDAQ
from rig.errors import ConfigurationError
from rig.measurements import bench_of_recording
from rig.recording.reader import Recording
from rig.results.files import load_as
from rig.results.structured.model import IdentifiedStructured
from vibrolock.arrays import Float

_FAITHFUL = 1e-6
"""Largest error of a spline through fewer nodes, over the largest force, in the range of the training data and in the reach."""
_FAITHFUL_DAMPING = 1e-3
"""The same of straight lines through a damping."""
_STRIDES = (32, 16, 8, 4, 2, 1)
"""Distances of the nodes that are kept, in nodes of the model's tables."""
_DIGITS = 10
"""Significant digits of the numbers in the table; chosen."""
_LEAST_FREE = 0.01
"""Mass line below the band, over that of the modes, from which on it becomes a mode."""
_OF_A_SENSOR = {"name", "sensitivity_v_per_unit", "range_v", "noise_rms", "high_pass_hz"}
"""Keys of a channel that its virtual sensor has, too."""
_LEAST_SLIDER = 1e-12
"""Stiffness of a slider below which it is none, over that of all."""


def structured_model(path: Path, *, trust_code: bool = False) -> StructuredModel:
    """Load a structured model. Functions of the user, which it may name, are refused unless they are trusted.

    Raises `RecordingError` for another file, `ConfigurationError` for functions that are not trusted.
    """
    found = load_as(IdentifiedStructured, path)
    found.check_trusted(path, trust_code)
    return found.model


def bench_like(name_or_path: str, *, trust_code: bool = False) -> Bench:
    """Return a shipped bench, that of a .toml file, or the bench of a recording (.h5).

    Raises `ConfigurationError` if the bench of a recording names code that is not trusted.
    """
    if Path(name_or_path).suffix != ".h5":
        return load_bench(name_or_path)
    with Recording(Path(name_or_path)) as recording:
        bench = bench_of_recording(recording)
    if not trust_code:
        refuse_code(bench, name_or_path)
    return bench


def structured_bench(model: StructuredModel, like: Bench, *, shaker: str = "") -> Table:
    """Return the table of a bench whose virtual specimen is a structured model.

    All outputs become accelerometers. The support of the model is left out, as the exciter's suspension stands there itself. A
    feed-through from the force to its acceleration, ``direct``, is the mass line of modes below the band: above a hundredth of
    that of the modes, it becomes a free mode that only the exciter holds; else it is left out. Beyond the reach forces are
    straight lines, and samples are flagged.

    Raises
    ------
    ConfigurationError
        If the bench has no exciter and no shaker is given, or the parts do not fit together.
    IdentificationError
        If the model has not one input and a drive output at its place, or a force at rest.

    Parameters
    ----------
    model
        The model. Its modes become a structure that is given by modes, every element a direction in their space with a force
        table, a damping table and a friction joint. As the model's linear part is that of the structure with all joints
        slipping, a linear spring beside each joint holds the stiffness that the joint takes from its structure while it slips.
    like
        The bench that it was measured with, or another: rate, limits, force sensor and, of channels with the names of the
        outputs, ranges and noise are taken from it (of the others, those of its drive channel); of a virtual one exciter,
        stinger and converter, too.
    shaker
        A shaker by its name (`rig list`) in place of the bench's; a bench that is not virtual needs one.
    """
    drive = _drive_of(model)
    points = {f"element_{number}": element for number, element in enumerate(model.elements, 1)}
    sensors = _channels(model, like)
    options: Table = {
        "structure": _structure(model, {name: element.direction for name, element in points.items()}),
        **_nonlinear(model, list(points)),
        **_exciter(like, shaker, drive),
        "sensors": [
            {
                "kind": "force" if channel.role == "force" else "acceleration",
                **({} if channel.role == "force" else {"at": channel.name}),
                **channel.model_dump(include=_OF_A_SENSOR),
            }
            for channel in sensors
        ],
    }
    feeds = [
        f"{value:.2g} {c.unit} per N to {c.name}" for c, value in zip(model.outputs, model.direct[:, 0], strict=True)
    ]
    left = f"; left out: {', '.join(feeds)}" if np.any(model.direct) and not _free_mode(model) else ""
    what = f"structured model of {model.specimen or 'a specimen'} behind the exciter of the bench {like.name}{left}"
    bench = like.model_copy(
        update={
            "name": f"{like.name}-identified",
            "description": what,
            "driver": DriverChoice(name="virtual", options=options),
            "channels": tuple(sensors),
            "emergency_stop": None,
        }
    )
    return _with_modes(bench, model)


def _structure(model: StructuredModel, directions: dict[str, Float]) -> Table:
    order = np.argsort(model.frequency_hz, kind="stable")
    shapes = {c.name: model.output_shapes[row, order] for row, c in enumerate(model.outputs)}
    shapes |= {name: direction[order] for name, direction in directions.items()}
    hertz, damping = model.frequency_hz[order], model.damping_ratio[order]
    free = _free_mode(model)
    if free:
        hertz, damping = np.append(0.0, hertz), np.append(0.0, damping)
        shapes = {name: np.append(free.get(name, 0.0), shape) for name, shape in shapes.items()}
    return {
        "kind": "modal",
        "frequency_hz": hertz.tolist(),
        "damping_ratio": damping.tolist(),
        "shapes": {name: shape.tolist() for name, shape in shapes.items()},
    }


def _free_mode(model: StructuredModel) -> dict[str, float]:
    """Return the shape of a mode at 0 Hz with the acceleration ``direct`` per force, or none where that is small."""
    row = find_role(model.outputs, "drive")
    at_drive = float(model.direct[row, 0]) if model.outputs[row].motion == "acceleration" else 0.0
    if at_drive < _LEAST_FREE * float(np.sum(model.input_shapes[:, 0] ** 2)):
        return {}
    moving = [
        (c.name, value)
        for c, value in zip(model.outputs, model.direct[:, 0], strict=True)
        if c.motion == "acceleration"
    ]
    return {name: float(value) / math.sqrt(at_drive) for name, value in moving}


def _drive_of(model: StructuredModel) -> str:
    """Return the name of the drive output of a model that a rig with one exciter can be."""
    if [channel.role for channel in model.inputs] != ["force"]:
        names = ", ".join(f"{channel.name} ({channel.role})" for channel in model.inputs)
        raise IdentificationError(f"inputs: are {names}, allowed is one force, as a virtual rig has one exciter")
    if sum(channel.role == "drive" for channel in model.outputs) != 1:
        names = ", ".join(f"{channel.name} ({channel.role})" for channel in model.outputs)
        raise IdentificationError(f"outputs: are {names}, allowed is exactly one of role drive, where the force acts")
    row = find_role(model.outputs, "drive")
    at_force, name = model.input_shapes[:, 0], model.outputs[row].name
    if not np.allclose(model.output_shapes[row], at_force, rtol=1e-6, atol=1e-9 * np.max(np.abs(at_force))):
        raise IdentificationError(
            f"output_shapes: that of {name} is not the one of the force, allowed is the same place"
        )
    return name


def _channels(model: StructuredModel, like: Bench) -> list[Channel]:
    known = {channel.name: channel for channel in like.channels if channel.role in ("drive", "response")}
    usual = like.channels[like.index_of("drive")]
    out = [_virtual(like.channels[like.index_of("force")])]
    for output in model.outputs:
        channel = _virtual(known.get(output.name, usual))
        out.append(channel.model_copy(update={"name": output.name, "role": output.role}))
    return out


def _virtual(channel: Channel) -> Channel:
    """Return a channel with an ideal mounting and without the papers of a real sensor."""
    kept = ("name", "role", "unit", "range_v", "resolution_v", "noise_rms", "high_pass_hz", "sensor")
    return Channel(
        **{key: getattr(channel, key) for key in kept}, sensitivity_v_per_unit=abs(channel.sensitivity_v_per_unit)
    )


def _exciter(like: Bench, shaker: str, drive: str) -> Table:
    """Return exciter, stinger and converter: those of a virtual bench, else a shaker by name behind a steel stinger."""
    if like.driver.name != "virtual":
        if not shaker:
            raise ConfigurationError(
                f"`shaker`: is missing; the bench {like.name} is not virtual, its exciter is not known: allowed is a shaker "
                "that `rig list` shows"
            )
        substeps = max(2, math.ceil(_INTEGRATION_HZ / like.sample_rate_hz))
        return {
            "exciter": {"shaker": shaker},
            "stinger": {"at": drive, **_STINGER},
            "converter": {"substeps": substeps},
        }
    rig = VirtualDAQ(like).rig
    own = rig.exciter.model_dump(exclude_defaults=True)
    stinger = {"stiffness_n_m": rig.stinger.stiffness_n_m, "damping_n_s_m": rig.stinger.damping_n_s_m}
    converter = rig.converter.model_dump(exclude_defaults=True, exclude={"sample_rate_hz", "dac_range_v"})
    device = {key: value for key, value in like.driver.options.items() if key in _DEVICE}
    exciter = {"shaker": shaker} if shaker else own
    return {"exciter": exciter, "stinger": {"at": drive, **stinger}, "converter": converter, **device}


_STINGER = {"material": "steel", "diameter_m": 0.002, "length_m": 0.1, "damping_n_s_m": 31.7}
"""A common stinger; the damping is that of the shipped rigs."""
_INTEGRATION_HZ = 20_000.0
"""Least rate of integration steps."""
_DEVICE = ("queue_blocks", "delay_samples", "faults")
"""Options of a virtual device, which it keeps."""


def _nonlinear(model: StructuredModel, points: list[str]) -> Table:
    tables = model.system.tables
    elements: list[Table] = []
    friction: list[Table] = []
    for e, (at, element) in enumerate(zip(points, model.elements, strict=True)):
        scale = element.scale_m
        force_n, damping = tables.springs[e, 0] / scale, tables.dampers[e] / scale**2
        if np.any(force_n):
            elements.append(_force_table(at, element, force_n, float(tables.limits[e, 1] / scale**2)))
        if np.any(damping):
            kept = _kept(element, damping, _FAITHFUL_DAMPING, smooth=False)
            numbers = {"deflection_m": _deflections(element, kept), "damping_n_s_m": _short(damping[kept])}
            elements.append({"kind": "damping-table", "at": at, **numbers})
        if strange := [law.kind for law in element.laws if isinstance(law, Joint) and np.any(law.bends())]:
            raise IdentificationError(
                f"{at}: has {', '.join(strange)}, which no virtual rig has; allowed joints are jenkins, iwan, masing"
            )
        stiffness, strength = (tables.sliders[tables.first[e] : tables.first[e + 1]] / [scale**2, scale]).T
        some = stiffness > _LEAST_SLIDER * np.sum(stiffness)
        if np.any(some):
            stiffness, slip = stiffness[some], strength[some] / stiffness[some]
            elements.append({"kind": "cubic", "at": at, "linear_n_m": float(np.sum(stiffness)), "stiffness_n_m3": 0.0})
            friction.append({"kind": "jenkins", "at": at, "stiffness": stiffness.tolist(), "slip": slip.tolist()})
    return {"elements": elements, "friction": friction}


def _force_table(at: str, element: NonlinearElement, force_n: Float, beyond_n_m: float) -> Table:
    middle = force_n.size // 2
    if abs(force_n[middle]) > _FAITHFUL * np.max(np.abs(force_n)):
        raise IdentificationError(f"{at}: its springs have {force_n[middle]:g} N at rest, allowed is 0")
    force_n = force_n.copy()
    force_n[middle] = 0.0
    kept = _kept(element, force_n, _FAITHFUL, smooth=True)
    numbers = {"deflection_m": _deflections(element, kept), "force_n": _short(force_n[kept]), "beyond_n_m": beyond_n_m}
    return {"kind": "force-table", "at": at, **numbers}


def _kept(element: NonlinearElement, values: Float, tolerance: float, *, smooth: bool) -> slice:
    """Return the coarsest stride that keeps a table within tolerance, both in the training range and in the validity range."""
    from scipy.interpolate import CubicSpline  # only on use: it takes long to load

    x = element.nodes
    ranges = [np.abs(x) <= (element.largest or element.reach), np.abs(x) <= element.reach]
    for stride in _STRIDES:
        kept = slice(None, None, stride)
        found = CubicSpline(x[kept], values[kept])(x) if smooth else np.interp(x, x[kept], values[kept])
        missed = np.abs(found - values)
        if all(np.max(missed[inside]) <= tolerance * np.max(np.abs(values[inside])) for inside in ranges):
            break
    return kept


def _deflections(element: NonlinearElement, kept: slice) -> list[float]:
    z = element.nodes * element.scale_m
    z[z.size // 2] = 0.0
    return _short(z[kept])


def _short(values: Float) -> list[float]:
    return [float(f"{value:.{_DIGITS}g}") for value in values]


def _with_modes(bench: Bench, model: StructuredModel) -> Table:
    rig = VirtualDAQ(bench).rig
    modes = rig.linear_modes
    mode = modes.nearest(bench.specimen.linear_frequency_hz)
    at = {c.name: float(f"{modes.at(rig.shape(c.name))[mode]:.6g}") for c in bench.channels if c.role != "force"}
    specimen = {
        "name": model.specimen or bench.specimen.name,
        "linear_frequency_hz": float(f"{modes.frequency_hz[mode]:.6g}"),
        "drive_mode_shape": next(at[c.name] for c in bench.channels if c.role == "drive"),
    }
    channels = [
        channel.model_dump(exclude_defaults=True)
        | ({"mode_shape": at[channel.name]} if channel.role == "response" else {})
        for channel in bench.channels
    ]
    table = bench.model_dump(exclude_defaults=True, exclude_none=True)
    table |= {"specimen": specimen, "channels": channels}
    refuse(validated(Bench, table, "the bench of the model"))
    return table
