"""What is known of a rig before a rehearsal, collected from recordings, models and the plan."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from controller.tuning import PlantModel
from identification import (
    Backbone,
    Exciter,
    IdentificationError,
    LinearModes,
    ModalAnalysis,
    NonlinearMode,
    best_linear_approximation,
    nonlinear_mode,
)
from rig.bench import Bench
from rig.campaigns.kinds import kinds_that_yield
from rig.campaigns.planning.levels import Levels
from rig.campaigns.planning.plan import Plan
from rig.errors import ConfigurationError
from rig.measurements import backbone, spectra
from rig.recording.reader import Recording
from rig.rehearsal.linear.fit import posterior
from rig.rehearsal.linear.model import Prior, Responses
from rig.rehearsal.linear.posterior import Posterior
from vibrolock.arrays import Float

BAND = (0.5, 2.2)  # band in which the linear rig is fitted, over the linear frequency; chosen
NARROWER = (0.65, 1.6)
"""Band that is taken where the wider one shows modes at its edge that a fit does not find; chosen."""
OTHER_MODE = 0.1  # of the frequency: a backbone further off is of another mode or bench; chosen, as in a tuning
POOR_INFLATION = 10.0  # misfit of a fit over its expectation from which the narrower band is tried; chosen
KNOWN_LOG_STD = {"frequency_hz": 0.01, "damping_ratio": 0.5, "drive_shape": 0.2}
"""Standard deviations of the logarithms of a mode that the plan's ``[plant]`` names: wide, for its responses are fitted anew;
chosen so that no mode beside it takes its place."""
LINES = 400  # largest number of lines of a fit; chosen: more take time and narrow nothing
AVERAGED_LINES = 15
"""Lines over which variances are averaged; chosen: those of a few realisations scatter by themselves."""
Source = Recording | ModalAnalysis | LinearModes | Exciter | NonlinearMode
"""Recordings of multisines and models from which knowledge is collected."""


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What is known of a rig."""

    linear: Posterior
    """Posterior of the linear rig."""
    noise_rms: Mapping[str, float]
    """Noise of the channels that were listened to, RMS in the channel's unit."""
    loop_delay_samples: float | None
    """Samples from an output to the input that shows it, block included; None if it was not measured."""
    shape_measured: bool
    """Whether the drive point's mode shape comes from a measurement, and not from the bench."""
    mode: NonlinearMode | None
    """Measured frequency and damping over the amplitude."""
    sources: tuple[str, ...]
    """Where the knowledge comes from, one line each."""


@dataclass
class _Evidence:
    """What has been collected so far."""

    responses: Responses | None = None
    priors: dict[str, Prior] = field(default_factory=dict)
    start: dict[str, float] = field(default_factory=dict)
    noise: dict[str, float] = field(default_factory=dict)
    delay: float | None = None
    exciter: bool = False
    shape: bool = False
    mode: NonlinearMode | None = None
    sources: list[str] = field(default_factory=list)


def collect_knowledge(bench: Bench, plan: Plan, sources: Mapping[str, object]) -> Knowledge:
    """Collect what the plan's ``[plant]`` and the ``sources`` tell of a rig.

    ``sources`` are objects by the name of their file: a `Recording` of ``rig tune``, ``rig check`` or any multisine, or of a
    backbone, a `ModalAnalysis` or `LinearModes`, an `Exciter`, a `NonlinearMode`. Raises `ConfigurationError` for anything
    else, and if nothing tells of exciter and structure.
    """
    found = _Evidence()
    for name, source in sources.items():
        match source:
            case Recording() if source.kind in kinds_that_yield(Backbone):
                _mode(found, name, _mode_of(bench, name, source))
            case Recording():
                _recording(found, bench, name, source, plan.known_plant)
            case ModalAnalysis():
                _linear_modes(found, bench, name, source.modes)
            case LinearModes():
                _linear_modes(found, bench, name, source)
            case Exciter():
                _exciter(found, name, source)
            case NonlinearMode():
                _mode(found, name, source)
            case _:
                raise ConfigurationError(
                    f"holds a {type(source).__name__}",
                    field="sources",
                    value=name,
                    allowed="a recording of a multisine or a backbone, linear modes, an exciter, a nonlinear mode",
                )
    plant = plan.known_plant
    if found.responses is None and plant is not None:
        ratios = plan.ratios_to_drive(bench) if isinstance(plan, Levels) else bench.response_ratios
        _plant(found, bench, plant, ratios)
    if found.responses is None and not (found.exciter and found.shape):
        raise ConfigurationError(
            f"there is no measurement of the exciter and the structure of the bench {bench.name}: give a recording of "
            "`rig tune` or `rig check`, or both an exciter and linear modes, or a plan with [plant]; a "
            "virtual bench can be its own twin with `exact`",
            field="sources",
        )
    known = found.responses
    channels = [channel.name for channel in bench.channels if channel.role == "response"]
    facts = bench.specimen
    start = {
        "frequency_hz": facts.linear_frequency_hz,
        "drive_shape": abs(facts.drive_mode_shape) if facts.drive_mode_shape is not None else 1.0,
        **found.start,
    }
    linear = posterior(channels, start, found.priors, known)
    if known is not None and linear.inflation > POOR_INFLATION:
        narrow = posterior(channels, start, found.priors, _within(known, bench, NARROWER))
        linear = min(linear, narrow, key=lambda fit: fit.inflation)
    return Knowledge(
        linear=linear,
        noise_rms=found.noise,
        loop_delay_samples=found.delay,
        shape_measured=found.shape,
        mode=found.mode,
        sources=tuple(found.sources),
    )


def _mode_of(bench: Bench, name: str, recording: Recording) -> NonlinearMode:
    """Return the mode of a recorded backbone; refuse one without accepted points, or of another mode."""
    try:
        mode = nonlinear_mode(backbone(recording))
    except IdentificationError as error:
        raise ConfigurationError(
            f"{error}", field="sources", value=name, allowed="a backbone with accepted points"
        ) from None
    linear, lowest = bench.specimen.linear_frequency_hz, float(mode.modal_frequency_hz[0])
    if abs(lowest / linear - 1.0) > OTHER_MODE:
        raise ConfigurationError(
            f"its lowest level vibrates at {lowest:.5g} Hz",
            field="sources",
            value=name,
            allowed=f"a backbone near {linear:g} Hz",
        )
    return mode


def _mode(found: _Evidence, name: str, mode: NonlinearMode) -> None:
    found.mode = mode
    found.sources.append(f"{name}: frequency and damping over the amplitude, {mode.amplitude_m.size} levels")


def _recording(found: _Evidence, bench: Bench, name: str, recording: Recording, plant: PlantModel | None) -> None:
    if recording.kind != "multisine":
        raise ConfigurationError(
            f"is a recording of kind {recording.kind}", field="sources", value=name, allowed="a multisine, a backbone"
        )
    level, measured = list(spectra(recording).items())[-1]
    names = _names(bench)
    if missing := [one for one in names if one not in [channel.name for channel in measured.channels]]:
        raise ConfigurationError(
            f"has no channel {missing[0]!r} of the bench {bench.name}", field="sources", value=name
        )
    matrix = best_linear_approximation(measured, outputs=names, inputs=("voltage",), specimen=bench.specimen.name)
    total, noise = matrix.total_std[:, :, 0], matrix.noise_std[:, :, 0]
    variance = np.nan_to_num(np.where(np.isfinite(total), total, noise)) ** 2
    std = np.sqrt(scipy.ndimage.uniform_filter1d(variance, AVERAGED_LINES, axis=0, mode="nearest"))
    inside = _inside(bench, matrix.frequency_hz)
    found.responses = _thinned(
        Responses(matrix.frequency_hz[inside], matrix.value[inside, :, 0], std[inside], bench.sample_rate_hz)
    )
    step = float(np.diff(measured.frequency_hz).mean())
    for one in names:
        density = 0.5 * float(np.mean(measured.noise_variance[:, measured.index(one)])) / step
        found.noise[one] = float(np.sqrt(0.5 * density * bench.sample_rate_hz))
    about = recording.parts[-1].information.get("about", {})
    as_a_loop = about.get("queue", {}).get("how") != "open loop"  # whose queue a test in closed loop does not have
    delay = about.get("lead_samples") if as_a_loop else None
    found.delay = None if delay is None else float(delay)
    found.shape = True
    if plant is None:
        _start_from(found, bench, found.responses)
    else:
        _plant_start(found, plant)
        for key, log_std in KNOWN_LOG_STD.items():
            found.priors.setdefault(key, Prior(found.start[key], log_std))
    found.sources.append(f"{name}: responses to a multisine of {level:.3g} V RMS, {int(inside.sum())} lines")


def _names(bench: Bench) -> list[str]:
    return [c.name for role in ("force", "drive", "response") for c in bench.channels if c.role == role]


def _inside(bench: Bench, frequency_hz: Float) -> NDArray[np.bool_]:
    linear = bench.specimen.linear_frequency_hz
    return np.asarray((frequency_hz > BAND[0] * linear) & (frequency_hz < BAND[1] * linear))


def _within(responses: Responses, bench: Bench, band: tuple[float, float]) -> Responses:
    """Return the lines of a band, given as parts of the linear frequency."""
    part = responses.frequency_hz / bench.specimen.linear_frequency_hz
    kept = (part > band[0]) & (part < band[1])
    return replace(
        responses,
        frequency_hz=responses.frequency_hz[kept],
        value=responses.value[kept],
        std=responses.std[kept],
    )


def _thinned(responses: Responses) -> Responses:
    """Keep at most `LINES` lines: half of them the nearest to the mode, the others spread over the band."""
    frequency = responses.frequency_hz
    if frequency.size <= LINES:
        return responses
    mode = int(np.argmax(np.abs(responses.value[:, 1] / responses.value[:, 0])))
    near = np.argsort(np.abs(frequency - frequency[mode]))[: LINES // 2]
    far = np.linspace(0, frequency.size - 1, LINES // 2).round().astype(int)
    kept = np.union1d(near, far)
    return replace(responses, frequency_hz=frequency[kept], value=responses.value[kept], std=responses.std[kept])


def _start_from(found: _Evidence, bench: Bench, responses: Responses) -> None:
    try:
        plant = PlantModel.from_frequency_responses(
            responses.frequency_hz,
            responses.value[:, 0],
            responses.value[:, 1],
            sample_rate_hz=bench.sample_rate_hz,
            latency_samples=0.0,
        )
    except ValueError as error:
        raise ConfigurationError(
            f"the responses of the bench {bench.name} show no mode near "
            f"{bench.specimen.linear_frequency_hz:g} Hz: {error}",
            field="sources",
        ) from None
    _plant_start(found, plant)


def _plant_start(found: _Evidence, plant: PlantModel) -> None:
    """Take start values from a plant: its polynomials are products of the exciter's parameters."""
    alpha, beta, w = plant.force_v_n, plant.acceleration_v_s2_m, plant.centre_rad_s
    per_volt = 1.0 / alpha[0] if alpha[0] > 0.0 else 1.0 / plant.volts_per_newton()
    start = {"frequency_hz": plant.frequency_rad_s / (2.0 * np.pi), "damping_ratio": plant.damping_ratio}
    start |= {"drive_shape": plant.drive_shape, "force_per_volt_n_v": per_volt}
    coil_s = alpha[1] * per_volt / w
    if 1e-6 < coil_s < 1e-2:
        start["coil_time_constant_s"] = coil_s
    start["moving_mass_kg"] = float(np.clip(beta[2] * per_volt, 0.02 / plant.drive_shape**2, 1e3))
    start["suspension_stiffness_n_m"] = float(np.clip(beta[0] * w**2 * per_volt, 10.0, 1e7))
    start["exciter_damping_n_s_m"] = float(np.clip(beta[1] * w * per_volt, 0.1, 1e5))
    found.start |= start


def _plant(found: _Evidence, bench: Bench, plant: PlantModel, ratios: Mapping[str, float]) -> None:
    """Take the plant that the plan has measured, as responses as uncertain as its misfit."""
    low, high = (max(plant.band_hz[0], BAND[0] * bench.specimen.linear_frequency_hz), plant.band_hz[1])
    frequency = np.linspace(low, high, LINES)
    s = 2j * np.pi * frequency
    force, drive = plant.force_per_v(s), plant.acceleration_per_v(s)
    others = [drive * ratios.get(name, 1.0) for name in _names(bench)[2:]]
    value: NDArray[np.complex128] = np.stack([force, drive, *others], axis=1) * np.sinc(
        frequency / bench.sample_rate_hz
    )[:, None].astype(np.complex128)
    rms = np.sqrt(np.mean(np.abs(value) ** 2, axis=0))
    std = np.broadcast_to(max(plant.fit_error, 1e-3) * rms, value.shape).copy()
    for column, name in enumerate(_names(bench)[2:], 2):
        if name not in ratios:
            std[:, column] = 2.0 * rms[column]
    found.responses = Responses(frequency, value, std, bench.sample_rate_hz)
    found.delay = plant.latency_samples
    found.shape = True
    _plant_start(found, plant)
    found.sources.append(f"the plan's [plant]: {low:.4g} to {high:.4g} Hz, within {100.0 * plant.fit_error:.2g} %")


def _linear_modes(found: _Evidence, bench: Bench, name: str, modes: LinearModes) -> None:
    tested = int(np.argmin(np.abs(modes.frequency_hz - bench.specimen.linear_frequency_hz)))
    drive = modes.drive_row
    facts = {
        "frequency_hz": (modes.frequency_hz[tested], modes.frequency_std_hz[tested], 1e-3),
        "damping_ratio": (modes.damping_ratio[tested], modes.damping_ratio_std[tested], 0.2),
        "drive_shape": (modes.shapes[drive, tested], modes.shapes_std[drive, tested], 0.1),
    }
    for key, (value, std, otherwise) in facts.items():
        relative = float(std / abs(value)) if np.isfinite(std) and std > 0.0 else otherwise
        found.priors[key] = Prior(abs(float(value)), max(relative, 1e-5))
        found.start[key] = abs(float(value))
    for row, channel in enumerate(modes.channels):
        if row != drive:
            ratio = float(modes.shapes[row, tested] / modes.shapes[drive, tested])
            found.priors[f"ratio {channel.name}"] = Prior(ratio, max(0.02 * abs(ratio), 1e-4))
    found.shape = True
    found.sources.append(
        f"{name}: mode {tested + 1} of {modes.frequency_hz.size} at {modes.frequency_hz[tested]:.5g} Hz"
    )


def _exciter(found: _Evidence, name: str, exciter: Exciter) -> None:
    std = exciter.std
    names = ("force_per_volt_n_v", "coil_time_constant_s", "moving_mass_kg", "suspension_stiffness_n_m")
    values = {name: (getattr(exciter, name), std[name]) for name in names}
    values["force_per_volt_n_v"] = (abs(exciter.force_per_volt_n_v), std["force_per_volt_n_v"])
    values["exciter_damping_n_s_m"] = exciter.damping_n_s_m
    for key, (value, error) in values.items():
        if value > 0.0:
            relative = error / value if np.isfinite(error) and error > 0.0 else 0.02
            found.priors[key] = Prior(float(value), float(np.clip(relative, 1e-4, 1.0)))
            found.start[key] = float(value)
    found.exciter = True
    found.sources.append(f"{name}: exciter, {exciter.lowest_hz:.4g} to {exciter.highest_hz:.4g} Hz")
