"""Table and figure of a nonlinear state-space model: the fit, its errors by experiment, spectra and time of one experiment."""

from collections import Counter
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from identification import Features, PnlssModel
from rig.drawing.style import MAIN, REJECTED, SECOND, Axes, Figure, plain_log
from rig.results.kind import Table
from rig.results.pnlss.model import IdentifiedPnlss
from rig.results.simulated.figure import channels_of, draw_simulated
from rig.results.simulated.table import say_errors, say_scatter, summary_of
from rig.text.console import number

if TYPE_CHECKING:
    from identification import PnlssFit


def poles_of(model: PnlssModel) -> list[dict[str, float]]:
    """Natural frequencies (Hz) and damping ratios of the linear part, lowest first, one per pair of poles."""
    values = np.linalg.eigvals(model.a).astype(complex)
    s = np.log(values[(np.abs(values) > 0.0) & (values.imag >= 0.0)]) * model.sample_rate_hz
    rows = [{"frequency_hz": float(abs(p) / (2.0 * np.pi)), "damping_ratio": float(-p.real / abs(p))} for p in s]
    return sorted(rows, key=lambda row: row["frequency_hz"])


def _features(features: Features) -> dict[str, Any]:
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
        **summary_of(found, model),
        "states": model.states,
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
        "state_range": model.state_range.tolist(),
        "input_range": model.input_range.tolist(),
        "notes": list(dict.fromkeys([*found.notes, *model.notes])),
    }


def _said(features: dict[str, Any]) -> str:
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


def draw_pnlss(page: Figure, found: IdentifiedPnlss) -> None:
    """Draw the drive point's spectrum and a stretch of time, measured and simulated, the course of the fit, and all errors."""
    model, fit = found.model, found.fit
    heading = (
        f"PNLSS model of {model.specimen or 'an unnamed specimen'}: {channels_of(model)}, {model.states} states, "
        f"{model.nonlinear_coefficients} nonlinear coefficients, {model.sample_rate_hz:g} Hz"
    )
    draw_simulated(page, found, heading, {"fit": None if fit is None else partial(_history, fit=fit)})


def _history(axis: Axes, fit: "PnlssFit") -> None:
    from matplotlib.ticker import MaxNLocator

    past = fit.history
    at = np.arange(past.training_error.size)
    line = "o-" if at.size == 1 else "-"
    axis.semilogy(at, 100.0 * past.training_error, line, color=MAIN, label="training")
    shown = np.where(np.isfinite(past.validation_error), past.validation_error, np.nan)
    if np.isfinite(shown).any():
        axis.semilogy(at, 100.0 * shown, line, color=SECOND, label="validation")
    axis.axvline(fit.chosen, color=REJECTED, lw=0.9, ls="--", label=f"chosen: iteration {fit.chosen}")
    for index, bad in enumerate(at[np.isinf(past.validation_error)]):
        label = None if index else "validation run unbounded"
        axis.axvline(bad, color=SECOND, lw=0.5, alpha=0.3, label=label)
    axis.set(xlabel="iteration", ylabel="relative error, %")
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    if fit.limited:
        axis.set_title("stopped while still improving", loc="right")
    plain_log(axis)
    axis.legend()
