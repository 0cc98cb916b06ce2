"""Files of nonlinear state-space models: the fit, its errors by experiment, and the spectra of one experiment."""

from collections import Counter
from typing import Any

import numpy as np

from identification import (
    Features,
    PnlssModel,
)
from rig.results.kind import Table
from rig.results.pnlss.model import IdentifiedPnlss
from rig.results.simulated.table import errors_in, say_errors, say_scatter, scatter_in
from rig.text.console import number


def poles_of(model: PnlssModel) -> list[dict[str, float]]:
    """Natural frequencies (Hz) and damping ratios of the linear part, lowest first, one per pair of poles."""
    values = np.linalg.eigvals(model.a).astype(complex)
    s = np.log(values[(np.abs(values) > 0.0) & (values.imag >= 0.0)]) * model.sample_rate_hz
    rows = [{"frequency_hz": float(abs(p) / (2.0 * np.pi)), "damping_ratio": float(-p.real / abs(p))} for p in s]
    return sorted(rows, key=lambda row: row["frequency_hz"])


def _features(features: Features) -> dict[str, Any]:
    """Count the features of each kind."""
    functions = Counter(features.functions or ("tanh",) * len(features.weights))
    degrees = Counter(int(degree) for degree in features.exponents.sum(axis=1))
    return {
        "monomials": {str(degree): degrees[degree] for degree in sorted(degrees)},
        "saturating": functions["tanh"],
        "functions": dict(functions),
        "bounded": bool(np.isfinite(features.limits).any()),
    }


def _summarise(found: IdentifiedPnlss) -> dict[str, Any]:
    model, fit = found.model, found.fit
    return {
        "specimen": model.specimen,
        "states": model.states,
        "inputs": [channel.name for channel in model.inputs],
        "outputs": [channel.name for channel in model.outputs],
        "sample_rate_hz": model.sample_rate_hz,
        "state_features": _features(model.state_features),
        "output_features": _features(model.output_features),
        "nonlinear_coefficients": model.nonlinear_coefficients,
        "poles": poles_of(model),
        "fit": None
        if fit is None
        else {
            "iterations": fit.history.iterations,
            "chosen": fit.chosen,
            "training_error": fit.training_error,
            "validation_error": fit.validation_error,
            "stopped": fit.message,
            "limited": fit.limited,
            "interrupted": fit.interrupted,
            "seconds": float(fit.history.seconds[-1]),
        },
        "scatter": scatter_in(found),
        **errors_in(found),
        "training": list(model.training),
        "state_range": model.state_range.tolist(),
        "input_range": model.input_range.tolist(),
        "seconds": found.seconds,
        "notes": list(dict.fromkeys([*found.notes, *model.notes])),
    }


def _said(features: dict[str, Any]) -> str:
    """Describe features in words."""
    parts = [f"{count} of degree {degree}" for degree, count in features["monomials"].items()]
    parts += [f"{count} {name}" for name, count in features["functions"].items()]
    return (", ".join(parts) or "none") + (", bounded" if features["bounded"] else "")


def _say(summary: dict[str, Any]) -> None:
    inputs, outputs = ", ".join(summary["inputs"]), ", ".join(summary["outputs"])
    print(f"{summary['states']} states at {summary['sample_rate_hz']:g} Hz; {inputs} to {outputs}")
    print(
        f"{summary['nonlinear_coefficients']} nonlinear coefficients; features of the states: "
        f"{_said(summary['state_features'])}; of the outputs: {_said(summary['output_features'])}"
    )
    modes = (f"{p['frequency_hz']:.4f} Hz, {100.0 * p['damping_ratio']:.3f} %" for p in summary["poles"])
    print(f"poles of the linear part: {'; '.join(modes)}")
    if summary["fit"] is not None:
        fit = summary["fit"]
        judged = number(fit["validation_error"], ".3f", 100.0)
        print(
            f"iteration {fit['chosen']} of {fit['iterations']} chosen: error {number(fit['training_error'], '.3f', 100.0)} % "
            f"in training, {'no validation data' if judged == '-' else f'{judged} % in validation'}; "
            f"{number(summary['seconds'], '.1f')} s in all"
        )
        more = "; more --iterations go on with --resume" if fit["limited"] else ""
        print(f"why the fit ended: {fit['stopped']}{more}")
    say_scatter(summary["scatter"])
    say_errors(summary)


TABLE = Table(_summarise, _say)
