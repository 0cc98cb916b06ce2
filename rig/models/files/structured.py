"""Files of structured models: the model, its fit, its errors by experiment, and the spectra of one experiment."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from identification import IdentificationError, NonlinearElement, StructuredFit, StructuredModel
from identification.structured.arrays import fit_arrays, fit_from, model_arrays, model_from
from identification.structured.laws import Joint, UserSpring
from rig.models.files.kind import Arrays, Attributes, FileKind
from rig.models.files.simulated import (
    SimulatedModel,
    errors_in,
    packed_errors,
    say_errors,
    say_scatter,
    scatter_in,
    unpacked_errors,
)
from rig.text.console import number, print_table

__all__ = ["STRUCTURED", "IdentifiedStructured", "functions_of"]


_LEAST_SUPPORT_N_M = 1e-3
"""Stiffness of the support below which it counts as none."""


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedStructured(SimulatedModel):
    """A structured model and its origin.

    Parameters
    ----------
    model
        The model.
    fit
        Its fit; None for a model from another source.
    linear
        Modes with which the fit began, without elements; None if unknown.
    """

    model: StructuredModel
    fit: StructuredFit | None = None
    linear: StructuredModel | None = None


_PARTS: dict[str, tuple[Any, Any]] = {
    "fit": (fit_arrays, fit_from),
    "model": (model_arrays, model_from),
    "linear": (model_arrays, model_from),
}
"""How the parts of a file are packed and unpacked. A file holds a fit, or a model from elsewhere."""


def _pack(found: IdentifiedStructured | StructuredFit | StructuredModel) -> tuple[Arrays, Attributes]:
    if isinstance(found, StructuredFit):
        found = IdentifiedStructured(model=found.model, fit=found)
    elif isinstance(found, StructuredModel):
        found = IdentifiedStructured(model=found)
    parts = {"fit": found.fit, "model": found.model if found.fit is None else None, "linear": found.linear}
    arrays, out = packed_errors(found)
    for name, part in parts.items():
        if part is not None:
            inside, out[name] = _PARTS[name][0](part)
            arrays |= {f"{name}/{key}": array for key, array in inside.items()}
    return arrays, out


def _unpack(arrays: Arrays, attributes: Attributes) -> IdentifiedStructured:
    parts: dict[str, Any] = {}
    for name in (name for name in _PARTS if name in attributes):
        head = f"{name}/"
        inside = {key.removeprefix(head): array for key, array in arrays.items() if key.startswith(head)}
        parts[name] = _PARTS[name][1](inside, attributes[name])
    if "fit" in parts:
        parts["model"] = parts["fit"].model
    if "model" not in parts:
        raise IdentificationError("structured file: holds neither a fit nor a model")
    return IdentifiedStructured(**parts, **unpacked_errors(arrays, attributes))


def _modes(model: StructuredModel, fit: StructuredFit | None) -> list[dict[str, float | None]]:
    """Natural frequencies (Hz) and damping ratios of the linear part with their standard errors, None where unknown."""
    errors = {} if fit is None else dict(zip(fit.names, np.sqrt(np.diag(fit.covariance)).tolist(), strict=True))
    rows: list[dict[str, float | None]] = []
    for index, (frequency, damping) in enumerate(zip(model.frequency_hz, model.damping_ratio, strict=True), 1):
        of_frequency, of_damping = (errors.get(f"{name} {index}") for name in ("frequency", "damping"))
        rows.append(
            {
                "frequency_hz": float(frequency),
                "frequency_std_hz": None if of_frequency is None else of_frequency * float(frequency),
                "damping_ratio": float(damping),
                "damping_ratio_std": None if of_damping is None else of_damping * float(damping),
            }
        )
    return rows


def _element(element: NonlinearElement) -> dict[str, Any]:
    """Describe an element in numbers."""
    return {
        "direction": element.direction.tolist(),
        "scale_m": element.scale_m,
        "reach_m": element.reach * element.scale_m,
        "largest_m": None if element.largest is None else element.largest * element.scale_m,
        "between": list(element.between),
        "laws": [law.as_dict() for law in element.laws],
    }


def functions_of(model: StructuredModel) -> list[str]:
    """Return the functions of the user, ``module:name``, that a model names. To simulate it, they are imported."""
    named = [law.function for element in model.elements for law in element.laws if isinstance(law, UserSpring)]
    return list(dict.fromkeys(named))


def _summarise(found: IdentifiedStructured) -> dict[str, Any]:
    model, fit = found.model, found.fit
    return {
        "specimen": model.specimen,
        "inputs": [channel.name for channel in model.inputs],
        "outputs": [channel.name for channel in model.outputs],
        "sample_rate_hz": model.sample_rate_hz,
        "steps": model.steps,
        "modes": _modes(model, fit),
        "elements": [_element(element) for element in model.elements],
        "joints": any(isinstance(law, Joint) for element in model.elements for law in element.laws),
        "support_n_m": model.support_n_m,
        "fit": None
        if fit is None
        else {
            "numbers": len(fit.names),
            "training_error": fit.training_error,
            "evaluations": fit.evaluations,
            "stopped": fit.stopped,
            "seconds": fit.seconds,
            "trials": [asdict(trial) for trial in fit.trials],
        },
        "scatter": scatter_in(found),
        **errors_in(found),
        "training": list(model.training),
        "seconds": found.seconds,
        "notes": [
            *found.notes,
            *(f"names a function, {one}: simulations import it" for one in functions_of(model)),
        ],
    }


def _say(summary: dict[str, Any]) -> None:
    inputs, outputs = ", ".join(summary["inputs"]), ", ".join(summary["outputs"])
    print(f"{summary['steps']} steps a sample at {summary['sample_rate_hz']:g} Hz; {inputs} to {outputs}")
    if summary["fit"] is not None:
        fit = summary["fit"]
        print(
            f"{fit['numbers']} numbers fitted, error {number(fit['training_error'], '.3f', 100.0)} % in training, "
            f"{fit['evaluations']} simulations; {number(summary['seconds'], '.1f')} s in all; {fit['stopped']}"
        )
    print("linear part, all joints slipping" if summary["joints"] else "linear part")
    print_table(
        ("mode", "frequency Hz", "+-", "damping %", "+-"),
        [
            (
                str(index),
                number(mode["frequency_hz"], ".4f"),
                number(mode["frequency_std_hz"], ".2g", 1.96),
                number(mode["damping_ratio"], ".4f", 100.0),
                number(mode["damping_ratio_std"], ".2g", 196.0),
            )
            for index, mode in enumerate(summary["modes"], 1)
        ],
    )
    print("elements")
    print_table(
        ("element", "laws", "largest mm", "reach mm", *(f"direction {i + 1}" for i in range(len(summary["modes"])))),
        [
            (
                str(index),
                ", ".join(law["kind"] for law in element["laws"]),
                number(element["largest_m"], ".4f", 1e3),
                number(element["reach_m"], ".4f", 1e3),
                *(number(value, ".4f") for value in element["direction"]),
            )
            for index, element in enumerate(summary["elements"], 1)
        ],
    )
    _say_trials([] if summary["fit"] is None else summary["fit"]["trials"])
    if summary["support_n_m"] > _LEAST_SUPPORT_N_M:
        print(f"unseen support at the drive point: {number(summary['support_n_m'], '.4g')} N/m")
    say_scatter(summary["scatter"])
    say_errors(summary)


def _say_trials(trials: list[dict[str, Any]]) -> None:
    """Say what further elements brought on the validation data."""
    for trial in (trial for trial in trials if np.isfinite(trial["gain"])):
        sure = f", {trial['at_least']:.3g} at least (95 %)" if np.isfinite(trial["at_least"]) else ", one experiment"
        what = "kept" if trial["kept"] else "left out"
        print(
            f"element with {', '.join(trial['laws'])}: errors in validation {trial['gain']:.3g} times smaller{sure}; {what}"
        )


STRUCTURED = FileKind(
    name="structured",
    holds=(IdentifiedStructured, StructuredFit, StructuredModel),
    pack=_pack,
    unpack=_unpack,
    summarise=_summarise,
    say=_say,
    draw="rig.models.files.structured_figure:draw_structured",
    figure_in=(12.0, 7.5),
)
