"""Checks before a fit: raise an error if data, model or available memory do not permit it."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.checks import belongs
from identification.experiments.experiment import Experiment, same_channels, same_data
from identification.fitting.threads import available_threads
from identification.models.pnlss.best_linear import check_periodic
from identification.models.pnlss.fitting.blocks import block_samples
from identification.models.pnlss.fitting.parameters import Parameters
from identification.models.pnlss.fitting.result import PnlssFit
from identification.models.pnlss.model import PnlssModel

_SQUARES = 6
"""Parameter-sized square matrices held at once: normal equations, those of one experiment, eigenvectors, work space."""


def check_signals(experiments: Sequence[Experiment]) -> None:
    """Raise `IdentificationError` if channels differ between experiments or a channel is zero throughout."""
    same_channels(experiments)
    for kind, rows, channels in (
        ("input", [e.inputs for e in experiments], experiments[0].input_channels),
        ("output", [e.counted_outputs for e in experiments], experiments[0].output_channels),
    ):
        for index, channel in enumerate(channels):
            if not any(np.any(row[index]) for row in rows):
                raise IdentificationError(
                    f"{kind} '{channel.name}': is zero throughout the training data; leave it out"
                )


def check_enough(experiments: Sequence[Experiment], parameters: int) -> None:
    """Raise `IdentificationError` if there are fewer values than parameters."""
    values = sum(e.counted * len(e.output_channels) for e in experiments)
    if values < parameters:
        raise IdentificationError(
            f"{values} values of outputs count, fewer than the {parameters} parameters; give more data, or "
            "take fewer features or states",
            field="experiments",
        )


def check_data(
    start: PnlssModel,
    experiments: Sequence[Experiment],
    validation: Sequence[Experiment],
    parameters: int,
    by_frequency: bool,
) -> None:
    """Raise `IdentificationError` if data and model do not match or the data cannot determine the parameters."""
    check_signals(experiments)
    if not np.array_equal(start.state_features.limits, start.output_features.limits):
        raise IdentificationError(
            "have other limits than state_features; a fit needs the same for both", field="output_features"
        )
    for kind, group in (("experiments", experiments), ("validation", validation)):
        for index, experiment in enumerate(group):
            what = f"{kind}[{index}]{f' ({experiment.name})' if experiment.name else ''}"
            belongs(start, experiment, what)
            if by_frequency and experiment.period_samples:
                check_periodic(experiment, what)
    _check_validation(experiments, validation)
    check_enough(experiments, parameters)
    inputs = np.concatenate([e.inputs for e in experiments], axis=1)
    unit = inputs / np.max(np.abs(inputs), axis=1, keepdims=True)
    values_of = np.linalg.eigvalsh(unit @ unit.T)
    if values_of[0] < 1e-12 * values_of[-1]:
        names = ", ".join(c.name for c in start.inputs)
        raise IdentificationError(
            f"inputs {names}: one is a combination of the others throughout the training data, so that their effects "
            "cannot be separated; leave one out, or add experiments that drive them differently"
        )


def _check_validation(experiments: Sequence[Experiment], validation: Sequence[Experiment]) -> None:
    for index, one in enumerate(validation):
        twin = next((k for k, other in enumerate(experiments) if same_data(one, other)), None)
        if twin is not None:
            name = f" ({one.name})" if one.name else ""
            raise IdentificationError(
                f"has the samples of experiments[{twin}]; validate on data that is not trained on",
                where=f"validation[{index}]{name}",
            )
    for row, channel in enumerate(validation[0].output_channels if validation else ()):
        if not any(np.any(one.counted_outputs[row]) for one in validation):
            raise IdentificationError(f"output '{channel.name}': is zero throughout the validation data; leave it out")


def check_resumed(start: PnlssModel, resume: PnlssFit, estimated: int, validated: bool) -> None:
    """Raise `IdentificationError` unless ``resume`` is a fit of the same structure and kind of data."""
    for name in ("a", "b", "c", "e", "f"):
        mine, theirs = getattr(start, name).shape, getattr(resume.last, name).shape
        if mine != theirs:
            raise IdentificationError(
                f"its {name} has shape {theirs}, that of the start {mine}; give the same start", field="resume"
            )
    for name in ("state_features", "output_features"):
        mine, theirs = getattr(start, name), getattr(resume.last, name)
        if not np.array_equal(mine.exponents, theirs.exponents) or mine.functions != theirs.functions:
            raise IdentificationError(
                f"its {name} differ from those of the start", field="resume", hint="give the same start"
            )
    if len(resume.last_initial_states) != estimated:
        raise IdentificationError(
            f"has {len(resume.last_initial_states)} estimated initial states, the experiments {estimated}; "
            "give the same experiments",
            field="resume",
        )
    before = not bool(np.all(np.isnan(resume.history.validation_error)))
    if before != validated:
        had, has = ("validation data" if there else "no validation data" for there in (before, validated))
        raise IdentificationError(
            f"was fitted with {had}, now there is {has}", field="resume", hint="give the same validation"
        )


def needed_bytes(parameters: Parameters, experiments: Sequence[Experiment], by_frequency: bool) -> dict[str, int]:
    """Estimate of the peak memory of a fit, by purpose."""
    outputs, states = len(parameters.start.outputs), parameters.start.states
    columns = parameters.shared - states * max(parameters.estimated - 1, 0)
    widest = max(e.inputs.shape[1] for e in experiments)
    need = {
        "data": 8 * sum(e.inputs.size + e.outputs.size for e in experiments),
        "simulation": 8 * widest * (2 * outputs + states),
        "normal equations": 8 * _SQUARES * parameters.count**2,
        "blocks": 16 * block_samples(states, outputs, columns) * (states + outputs) * columns * available_threads(),
    }
    if by_frequency:
        need["Jacobian of a period"] = 8 * (outputs + 1) * max(e.period_samples for e in experiments) * columns
    return need


def available_bytes() -> int | None:
    """Memory available to programs, caches included; None if the system does not report it."""
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
    except OSError:
        pass
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def check_memory(parameters: Parameters, experiments: Sequence[Experiment], by_frequency: bool) -> None:
    """Raise `IdentificationError` if a fit needs more memory than is available."""
    need, there = needed_bytes(parameters, experiments, by_frequency), available_bytes()
    if there is None or sum(need.values()) <= there:
        return
    parts = ", ".join(f"{name} {value / 1e9:.2f}" for name, value in need.items())
    advice = "leave the frequency weighting out, or " if by_frequency else ""
    raise IdentificationError(
        f"the fit needs {sum(need.values()) / 1000000000.0:.2f} GB ({parts}), {there / 1000000000.0:.2f} "
        f"GB are free; {advice}give shorter experiments or take fewer features",
        field="memory",
    )
