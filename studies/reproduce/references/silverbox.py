"""Silverbox: a measured circuit like an oscillator with a hardening spring, tested far beyond the range of the estimation.

T. Wigren and J. Schoukens, Three free data sets for development and benchmarking in nonlinear system identification, European
Control Conference 2013. The record has an arrow (a noise of rising amplitude) and ten multisines; models are identified from
seven of these, chosen by the other three, and simulated on the whole arrow.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification import (
    Channel,
    Experiment,
    FitSettings,
    PnlssFit,
    PnlssModel,
    estimated_initial_state,
    identify_pnlss,
    pnlss_errors,
)
from rig.errors import RecordingError
from rig.text.column import Column
from studies.reproduce.references.data import DataFile, DataSet
from studies.reproduce.references.fits import fit_text, lines_of
from studies.reproduce.references.result import Curve, Line, Panel, ReferenceStudy, Say, StudyResult

_ARROW = 40_000
_FIRST_PERIOD, _PERIOD, _BLOCK, _AHEAD = 40_984, 8192, 8692, 500
"""The multisines: a block is 100 samples at zero, 400 of the end of the period, the period."""
_CHOOSING = 3
_CONSTANT = 0.02
"""Value of the constant input, V: of the size of the signals."""
_CANDIDATES = (0, 1, 2, 4)
"""Saturating features beside the monomials."""


@dataclass(frozen=True)
class Oscillator:
    """Data of the study."""

    estimation: list[Experiment]
    """Seven multisines."""
    validation: list[Experiment]
    """Three multisines."""
    test: list[Experiment]
    """The arrow."""


def read(path: Path) -> Oscillator:
    """Read the file, in volts, with offsets as measured and made up for by a constant input."""
    from scipy.io import loadmat

    try:
        data = loadmat(path)
        u, y = (np.asarray(data[name], dtype=float).reshape(1, -1) for name in ("V1", "V2"))
    except (OSError, KeyError, ValueError) as error:
        raise RecordingError(f"{path}: holds no signals V1 and V2 ({error})") from None
    offset = float(np.mean(y[0, _FIRST_PERIOD:]))

    def part(begin: int, end: int, counted_from: int, name: str) -> Experiment:
        return Experiment(
            inputs=u[:, begin:end],
            outputs=y[:, begin:end] - offset,
            sample_rate_hz=1e7 / 2**14,
            input_channels=(Channel("input", "monitor", "V"),),
            output_channels=(Channel("output", "monitor", "V"),),
            counted_from=counted_from,
            period_samples=_PERIOD if counted_from else 0,
            # The record begins while the output still swings.
            initial_state="zero" if counted_from else "estimated",
            name=name,
            specimen="Silverbox",
        ).with_constant_input(_CONSTANT)

    begins = [_FIRST_PERIOD + _BLOCK * number for number in range(10)]
    sines = [part(b - _AHEAD, b + _PERIOD, _AHEAD, f"multisine {k + 1}") for k, b in enumerate(begins)]
    return Oscillator(sines[:-_CHOOSING], sines[-_CHOOSING:], [part(0, _ARROW, 0, "arrow")])


def fitted(data: Oscillator, saturating: int, *, seed: int = 0, settings: FitSettings | None = None) -> PnlssFit:
    """Identify a model of two states with monomials of degrees 2 and 3 and saturating features, outputs linear."""
    return identify_pnlss(
        data.estimation,
        states=2,
        degrees=(2, 3),
        output_degrees=(),
        saturating=(saturating, 0),
        validation=data.validation,
        seed=seed,
        settings=settings,
    )


def _study(paths: tuple[Path, ...], models: int, seed: int, say: Say) -> StudyResult:
    data = read(paths[0])
    fits: dict[str, PnlssFit] = {}
    for count in _CANDIDATES[:models]:
        name = "degrees 2 and 3" + (f", {count} saturating" if count else "")
        fits[name] = fitted(data, count, seed=seed)
        say(fit_text(name, fits[name]))
    chosen = _chosen({name: fit.model for name, fit in fits.items()}, data)
    return StudyResult(
        title="Silverbox, a measured oscillator with a hardening spring",
        columns=(
            Column("arrow_mv", "whole arrow, mV RMS", pattern=".4f"),
            Column("validation_mv", "validation, mV RMS", pattern=".4f"),
            Column("estimation_mv", "estimation, mV RMS", pattern=".4f"),
            Column("range_use", "range use", pattern=".2f"),
            Column("parameters", "parameters", pattern=".0f"),
            Column("seconds", "s", pattern=".1f"),
        ),
        lines=lines_of(fits, chosen, lambda model: _figures(model, data)),
        published=_PUBLISHED,
        notes=(
            f"the arrow: the first {_ARROW} samples; models are judged by {_CHOOSING} multisines, which are not fitted",
            "chosen: the model with the fewest parameters within one standard error of the best on these multisines",
            "published figures are of the whole arrow and second-hand, from lists in later works",
        ),
        panels=(_panel(fits[chosen].model, data.test[0]),),
        models={"chosen": fits[chosen]},
    )


def _chosen(models: Mapping[str, PnlssModel], data: Oscillator) -> str:
    """Return the smallest model within one standard error of the best on validation data.

    The one-standard-error rule (Breiman, Friedman, Olshen and Stone, Classification and Regression Trees, 1984, Section 3.4.3):
    differences below it are chance, and of two models that fit alike the smaller one extrapolates better.
    """
    errors = {name: pnlss_errors(model, data.validation).rms[:, 0] for name, model in models.items()}
    best = min(errors.values(), key=lambda error: float(np.mean(error)))
    most = np.mean(best) + np.std(best, ddof=1) / np.sqrt(best.size)
    alike = [name for name, error in errors.items() if np.mean(error) <= most]
    return min(alike, key=lambda name: _parameters(models[name]))


def _parameters(model: PnlssModel) -> int:
    inner = model.state_features.parameters + model.output_features.parameters
    return sum(part.size for part in model.linear_part) + model.nonlinear_coefficients + inner


def _figures(model: PnlssModel, data: Oscillator) -> dict[str, float]:
    groups = {"arrow_mv": data.test, "validation_mv": data.validation, "estimation_mv": data.estimation}
    errors = {key: pnlss_errors(model, group) for key, group in groups.items()}
    found = {key: 1e3 * float(np.sqrt(np.mean(error.rms**2))) for key, error in errors.items()}
    return {
        **found,
        "range_use": float(errors["arrow_mv"].range_use[0]),
        "parameters": float(_parameters(model)),
    }


def _panel(model: PnlssModel, arrow: Experiment) -> Panel:
    run = model.simulate(arrow.inputs, initial_state=estimated_initial_state(model, arrow))
    time_s = np.arange(_ARROW) / arrow.sample_rate_hz
    return Panel(
        "time, s",
        "output, mV",
        (
            Curve("measured", time_s, 1e3 * arrow.outputs[0], "measured"),
            Curve("residual, 100 times", time_s, 1e5 * (run.outputs - arrow.outputs)[0], "residual"),
        ),
    )


def _published(method: str, source: str, rms_mv: float, parameters: int) -> Line:
    return Line(method, {"arrow_mv": rms_mv, "parameters": float(parameters)}, source)


_PUBLISHED = (
    _published("best linear approximation", "Paduart 2008", 13.7, 5),
    _published("multilayer perceptron", "Sragner et al. 2004", 7.8, 600),
    _published("local linear state space", "Verdult 2004", 1.3, 16),
    _published("nonlinear feedback, relaxation", "Hjalmarsson and Schoukens 2004", 0.96, 5),
    _published("polynomial LFR", "Van Mulders et al. 2011", 0.35, 11),
    _published("sigmoid state space", "Marconato et al. 2012", 0.34, 23),
    _published("nonlinear ARX", "Ljung et al. 2004", 0.30, 712),
    _published("PNLSS", "Paduart 2008", 0.26, 37),
)
"""Second-hand: lists in later works name these authors with these figures."""
SILVERBOX = ReferenceStudy(
    DataSet(
        name="silverbox",
        files=(
            DataFile(name="SNLS80mV.mat", sha256="5c7413a52255af0cb4e2f93fb6903beb92b08965ba1e6ad0a6ffedfed8477ed4"),
        ),
        source="https://www.nonlinearbenchmark.org/benchmarks/silverbox (SilverboxFiles.zip)",
        citation="T. Wigren and J. Schoukens, Three free data sets for development and benchmarking in nonlinear system "
        "identification, European Control Conference 2013, pp. 2933-2938",
    ),
    _study,
)
