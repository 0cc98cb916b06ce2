"""Files of structured models: the model, its fit, its errors by experiment, and the spectra of one experiment."""

from contextlib import suppress
from dataclasses import asdict
from typing import Any

import numpy as np

from identification import IdentificationError, NonlinearElement, StructuredFit, StructuredModel
from identification.experiments import lacks_something
from identification.models import FittedNumber, Joint, std_of
from rig.results.kind import Table
from rig.results.simulated.table import say_errors, say_scatter, summary_of
from rig.results.structured.model import IdentifiedStructured
from rig.text.column import Column
from rig.text.console import number, print_rows

_LEAST_SUPPORT_N_M = 1e-3
"""Stiffness of the support below which it counts as none."""

_MISSING, _EXPLAINS = 4, 0.5
"""Forces that are listed, and the share of the squared residual from which one is named. Chosen."""
_ALIKE = 0.5
"""What a force may leave beyond the best one to count as alike, relative to what that leaves. Chosen."""


_Modes = list[dict[str, float | None]]
_SAME = 1e-6
"""Relative difference of frequencies below which small vibrations are those of the linear part."""


def _linear_part(model: StructuredModel, fit: StructuredFit | None) -> _Modes:
    """Natural frequencies (Hz) and damping ratios as they were fitted with their standard errors, None where unknown."""
    errors = {} if fit is None else dict(zip(fit.names, np.sqrt(np.diag(fit.covariance)).tolist(), strict=True))
    size = np.concatenate([model.frequency_hz, model.damping_ratio])
    names = [f"{name} {index + 1}" for name in ("frequency", "damping") for index in range(len(model.frequency_hz))]
    return _rows(model, size * np.array([errors.get(name, np.nan) for name in names]))


def _small_vibrations(found: IdentifiedStructured) -> _Modes | None:
    """Return the same at rest, where joints stick; None if the model does not vibrate there, or names code."""
    if found.functions:
        return None
    model, fit = found.model, found.fit
    std = np.full(2 * len(model.frequency_hz), np.nan)
    try:
        at_rest = model.linearised()
    except IdentificationError:
        return None
    if fit is not None:
        with suppress(IdentificationError):  # at a distance of the standard errors the model may not exist
            std = std_of(fit, _numbers_at_rest)
    return _rows(at_rest, std)


def _numbers_at_rest(model: StructuredModel) -> np.ndarray:
    at_rest = model.linearised()
    return np.concatenate([at_rest.frequency_hz, at_rest.damping_ratio])


def _rows(model: StructuredModel, std: np.ndarray) -> _Modes:
    """Rows of modes; ``std``: first those of the frequencies, then those of the damping ratios."""
    values = np.array([model.frequency_hz, std[: std.size // 2], model.damping_ratio, std[std.size // 2 :]])
    names = ("frequency_hz", "frequency_std_hz", "damping_ratio", "damping_ratio_std")
    return [
        {name: float(value) if np.isfinite(value) else None for name, value in zip(names, row, strict=True)}
        for row in values.T
    ]


def _differ(one: _Modes, other: _Modes) -> bool:
    pairs = [(a[name], b[name]) for a, b in zip(one, other, strict=True) for name in ("frequency_hz", "damping_ratio")]
    return any(a is not None and b is not None and abs(a - b) > _SAME * abs(b) for a, b in pairs)


def _element(element: NonlinearElement) -> dict[str, Any]:
    return {
        "direction": element.direction.tolist(),
        "scale_m": element.scale_m,
        "reach_m": element.reach * element.scale_m,
        "largest_m": None if element.largest is None else element.largest * element.scale_m,
        "between": list(element.between),
        "laws": [law.as_dict() for law in element.laws],
    }


def _number(number: FittedNumber) -> dict[str, Any]:
    finite = {end: value if np.isfinite(value) else None for end, value in (("low", number.low), ("high", number.high))}
    return number._asdict() | finite


def _summarise(found: IdentifiedStructured) -> dict[str, Any]:
    model, fit = found.model, found.fit
    fitted, at_rest = _linear_part(model, fit), _small_vibrations(found)
    return {
        **summary_of(found, model),
        "steps": model.steps,
        "modes": at_rest,
        "linear_part": None if at_rest is not None and not _differ(fitted, at_rest) else fitted,
        "elements": [_element(element) for element in model.elements],
        "joints": any(isinstance(law, Joint) for element in model.elements for law in element.laws),
        "support_n_m": model.support_n_m,
        "numbers": [] if fit is None else [_number(one) for one in fit.numbers],
        "not_identified": [] if fit is None else list(fit.not_identified),
        "fit": None
        if fit is None
        else {
            "numbers": len(fit.names),
            "training_error": fit.training_error,
            "evaluations": fit.evaluations,
            "stopped": fit.message,
            "seconds": fit.seconds,
            "trials": [asdict(trial) for trial in fit.trials],
            "transient": fit.transient,
            "missing": [asdict(force) for force in fit.missing],
        },
        "notes": [*found.notes, *(f"names a function, {one}: simulations import it" for one in found.functions)],
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
        if fit["transient"] > 0.0:
            print(
                f"the training data have not quite settled: their mean differs from the last period by up to "
                f"{100.0 * fit['transient']:.2g} % beyond noise, which the intervals include"
            )
    if summary["modes"] is not None:
        print("small vibrations, all joints stuck" if summary["joints"] else "small vibrations")
        _say_modes(summary["modes"])
    if summary["linear_part"] is not None:
        print("fitted linear part, all joints slipping" if summary["joints"] else "fitted linear part")
        _say_modes(summary["linear_part"])
    print("elements" if summary["elements"] else "no element: a linear structure")
    modes = len(summary["modes"] or summary["linear_part"])
    if summary["elements"]:
        _say_elements(summary["elements"], modes)
    _say_trials([] if summary["fit"] is None else summary["fit"]["trials"])
    _say_missing([] if summary["fit"] is None else summary["fit"]["missing"])
    _say_numbers(summary)
    say_scatter(summary["scatter"])
    say_errors(summary)


def _say_elements(elements: list[dict[str, Any]], modes: int) -> None:
    print_rows(
        [
            {
                **element,
                "number": index,
                "named": ", ".join(law["kind"] for law in element["laws"]),
                **{str(i): value for i, value in enumerate(element["direction"])},
            }
            for index, element in enumerate(elements, 1)
        ],
        Column("number", "element"),
        Column("named", "laws"),
        Column("largest_m", "largest", "mm", ".4f", 1e3),
        Column("reach_m", "reach", "mm", ".4f", 1e3),
        *(Column(str(i), f"direction {i + 1}", "", ".4f") for i in range(modes)),
    )


def _say_numbers(summary: dict[str, Any]) -> None:
    """Numbers of laws and support, then which modes are not identified."""
    of_modes = ("frequency ", "damping ")
    if told := [one for one in summary["numbers"] if not one["name"].startswith(of_modes)]:
        print("fitted numbers; displacements relative to the largest in training, support in N/m")
        print_rows(
            [
                one | {"value": f"not identified: {one['unknown']}" if one["unknown"] else f"{one['value']:.4g}"}
                for one in told
            ],
            Column("name", "number"),
            Column("value", "value"),
            Column("low", "95 % from", "", ".4g"),
            Column("high", "to", "", ".4g"),
        )
    if summary["support_n_m"] > _LEAST_SUPPORT_N_M and "support" not in [one["name"] for one in told]:
        print(f"unseen support at the drive point: {number(summary['support_n_m'], '.4g')} N/m")
    if unknown := [name for name in summary["not_identified"] if name.startswith(of_modes)]:
        print(f"not identified: {', '.join(name.replace(' ', ' of mode ') for name in unknown)}")


def _say_trials(trials: list[dict[str, Any]]) -> None:
    if len(trials) < 2 or not any(np.isfinite(trial["error"]) for trial in trials):
        return
    chosen = any(np.isfinite(trial["regression"]) for trial in trials)
    what = (
        f"laws that were tried, {len(trials)}"
        if chosen
        else f"models that were fitted, {len(trials)}, by the elements that they have"
    )
    print(what)
    print_rows(
        [
            {
                **trial,
                "has": " + ".join(trial["elements"] or trial["laws"]),
                "than": " + ".join(trial["compared"]) or "-",
                "verdict": "kept" if trial["kept"] else "-",
            }
            for trial in trials
        ],
        Column("has", "laws" if chosen else "elements"),
        *([Column("regression", "left by regression", "%", ".3g", 100.0)] if chosen else []),
        *([Column("screening", "short fit", "%", ".3g", 100.0)] if chosen else []),
        Column("error", "error in validation", "%", ".4g", 100.0),
        *([Column("over_noise", "residual/noise", "", ".3g")] if chosen else []),
        Column("gain", "times smaller", "", ".3g"),
        Column("than", "than with"),
        Column("likelihood", "log-likelihood ratio", "", ".3g"),
        Column("verdict", "then"),
    )
    best = next(trial for trial in reversed(trials) if trial["kept"])
    if chosen and lacks_something(best["over_noise"], best["error"]):
        print(
            f"none of these laws explains the data: the best leaves {number(best['error'], '.3g', 100.0)} % in validation, "
            f"{number(best['over_noise'], '.3g')} times the noise; try further elements, or laws that are not in the list"
        )


def _say_missing(missing: list[dict[str, Any]]) -> None:
    """What would explain the residual: the model's own numbers, and the forces that explain most."""
    if not missing:
        return
    told = [one for one in missing if one["place"]][:_MISSING]
    numbers = [one for one in missing if not one["place"]]
    print(f"what would explain the residual of the training data: {_missing(numbers, told)}")
    print_rows(
        [
            one | {"force": "other values of the numbers" if not one["place"] else one["force"]}
            for one in numbers + told
        ],
        Column("force", "force"),
        Column("place", "at"),
        Column("share", "share of the squared residual", "%", ".1f", 100.0),
    )


def _missing(numbers: list[dict[str, Any]], forces: list[dict[str, Any]]) -> str:
    if any(one["share"] > _EXPLAINS for one in numbers):
        return "other values of the model's own numbers, so that its fit ended in a local minimum"
    if forces and forces[0]["share"] > _EXPLAINS:
        best = forces[0]
        alike = [
            one["place"]
            for one in forces
            if one["force"] == best["force"] and one["share"] > best["share"] - _ALIKE * (1.0 - best["share"])
        ]
        among = ", which the data do not tell apart" if len(alike) > 1 else ""
        return f"a {best['force']} at {' or '.join(alike)}{among}"
    return "no spring, damper or joint at an output or along a mode"


def _say_modes(modes: _Modes) -> None:
    print_rows(
        [{"mode": index, **mode} for index, mode in enumerate(modes, 1)],
        Column("mode", "mode"),
        Column("frequency_hz", "frequency", "Hz", ".4f"),
        Column("frequency_std_hz", "+-", "", ".2g", 1.96),
        Column("damping_ratio", "damping", "%", ".4f", 100.0),
        Column("damping_ratio_std", "+-", "", ".2g", 196.0),
    )


TABLE = Table(_summarise, _say)
