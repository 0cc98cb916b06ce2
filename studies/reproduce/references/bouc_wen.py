"""Bouc-Wen: a simulated hysteresis, identified from one noisy multisine and tested on a clean multisine and a clean sweep.

J. P. Noel and M. Schoukens, Hysteretic benchmark with a dynamic nonlinearity, 4TU.ResearchData, doi 10.4121/12967592. The
training data, a multisine of five periods with noise, are those of M. Forgione and D. Piga, dynoNet: A neural network
architecture for learning dynamical systems, International Journal of Adaptive Control and Signal Processing 35, 2021.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification import (
    Channel,
    Experiment,
    FitSettings,
    PnlssFit,
    PnlssModel,
    identify_pnlss,
    linear_pnlss,
    pnlss_errors,
)
from rig.errors import RecordingError
from rig.text.column import Column
from studies.reproduce.references.data import DataFile, DataSet
from studies.reproduce.references.fits import fit_text, lines_of
from studies.reproduce.references.result import Curve, Line, Panel, ReferenceStudy, Say, StudyResult
from vibrolock.arrays import Float

_RATE_HZ = 750.0
_STATES, _FEATURES = 3, 10
_AHEAD = 1000
"""Samples of the period before, in which the transient decays."""
_SHOWN = 1200
"""Samples of the test that are drawn."""
_SETTINGS = FitSettings(iterations=300, patience=80)
"""The error of so short a validation record scatters from iterate to iterate, hence the patience."""
_NOISE = "noise of the averaged training data: -108 dB; the tests have none"


@dataclass(frozen=True)
class HystereticData:
    """Data of the study."""

    whole: Experiment
    """Mean of the last four periods of the training multisine, for the linear start."""
    estimation: Experiment
    """Its first seven eighths."""
    validation: Experiment
    """Its last eighth."""
    tests: tuple[Experiment, ...]
    """Multisine and sweep."""


def read(train: Path, test: Path) -> HystereticData:
    """Read the files; raise `RecordingError` if their contents are others."""
    import h5py

    def signals(path: Path, group: str) -> tuple[Float, Float]:
        try:
            with h5py.File(path) as file:
                return np.array(file[group]["u"]).reshape(1, -1), np.array(file[group]["y"]).reshape(1, -1)
        except (OSError, KeyError, ValueError) as error:
            raise RecordingError(f"{path}: holds no signals u and y in {group} ({error})") from None

    whole = _experiment(*signals(train, "multisine"), 8192, 8192, "multisine").averaged(transient_samples=_AHEAD)
    cut = _AHEAD + 7 * 1024
    first = _experiment(whole.inputs[:, :cut], whole.outputs[:, :cut], _AHEAD, 0, "seven eighths of the multisine")
    last = replace(whole, counted_from=cut, period_samples=0, name="last eighth")
    u, y = (np.tile(signal, 2)[:, 8192 - _AHEAD :] for signal in signals(test, "multisine"))
    settled = _experiment(u, y, _AHEAD, 8192, "test multisine")
    return HystereticData(whole, first, last, (settled, _experiment(*signals(test, "sinesweep"), 0, 0, "sine sweep")))


def _experiment(u: Float, y: Float, counted_from: int, period: int, name: str) -> Experiment:
    return Experiment(
        inputs=u,
        outputs=y,
        sample_rate_hz=_RATE_HZ,
        input_channels=(Channel("force", "force", "N"),),
        output_channels=(Channel("displacement", "drive", "m"),),
        counted_from=counted_from,
        period_samples=period,
        name=name,
        specimen="Bouc-Wen oscillator",
    )


def fitted(data: HystereticData, *, settings: FitSettings | None = None, **asked: object) -> PnlssFit:
    """Identify a model of three states; ``asked`` are further arguments of `identification.identify_pnlss`."""
    return identify_pnlss(
        [data.estimation],
        states=_STATES,
        linear=linear_pnlss([data.whole], states=_STATES),
        validation=[data.validation],
        settings=_SETTINGS if settings is None else settings,
        **asked,  # type: ignore[arg-type]
    )


def _study(paths: tuple[Path, ...], models: int, seed: int, say: Say) -> StudyResult:
    data = read(*paths)
    fits: dict[str, PnlssFit] = {"polynomials of degrees 2 and 3": fitted(data, degrees=(2, 3), output_degrees=())}
    for number in range(seed, seed + models):
        name = f"{_FEATURES} saturating features, seed {number}"
        fits[name] = fitted(data, saturating=_FEATURES, seed=number)
        say(fit_text(name, fits[name]))
    chosen = min(fits, key=lambda name: fits[name].validation_error)
    return StudyResult(
        title="Bouc-Wen, a simulated hysteresis",
        columns=(
            Column("multisine_db", "test multisine, dB", pattern=".1f"),
            Column("sweep_db", "sine sweep, dB", pattern=".1f"),
            Column("validation_percent", "validation, %", pattern=".2f"),
            Column("seconds", "s", pattern=".1f"),
        ),
        lines=lines_of(fits, chosen, lambda model: _figures(model, data)),
        published=_PUBLISHED,
        notes=(f"errors as 20 log10 of their RMS in m; {_NOISE}", _UNIT),
        panels=(_panel(fits[chosen], data.tests[0]),),
        models={"chosen": fits[chosen]},
    )


def _figures(model: PnlssModel, data: HystereticData) -> dict[str, float]:
    decibels = 20.0 * np.log10(pnlss_errors(model, data.tests).rms[:, 0])
    return dict(zip(("multisine_db", "sweep_db"), decibels.tolist(), strict=True))


def _panel(fit: PnlssFit, test: Experiment) -> Panel:
    run = fit.model.simulate(test.inputs)
    at = slice(test.counted_from, test.counted_from + _SHOWN)
    time_s = np.arange(_SHOWN) / _RATE_HZ
    measured, simulated = 1e3 * test.outputs[0, at], 1e3 * run.outputs[0, at]
    return Panel(
        "time, s",
        "displacement, mm",
        (
            Curve("exact", time_s, measured, "measured"),
            Curve("model", time_s, simulated),
            Curve("residual, 1000 times", time_s, 1e3 * (simulated - measured), "residual"),
        ),
    )


def _published(method: str, rms_m: float, source: str) -> Line:
    return Line(method, {"multisine_db": float(20.0 * np.log10(rms_m))}, source)


_DYNONET = "Forgione and Piga 2021, arXiv:2006.02250, Section 5.2"
_UNIT = "published RMS errors are those of the multisine; that source prints them in mm, its fit index shows that m is meant"
_PUBLISHED = (
    _published("nonlinear FIR (Belz et al. 2017)", 16.3e-5, f"as listed by {_DYNONET}"),
    _published("dynoNet", 4.52e-5, _DYNONET),
    _published("PNLSS (Esfahani et al. 2017)", 1.87e-5, f"as listed by {_DYNONET}"),
)
BOUC_WEN = ReferenceStudy(
    DataSet(
        name="bouc-wen",
        files=(
            DataFile(
                name="train.h5",
                sha256="a4df68f6101a22f9fc5032e98b3e773fc108a291378ef9cf69d1b128c7ac44a4",
                aliases=("boucwen_train_dynonet.h5",),
            ),
            DataFile(
                name="test.h5",
                sha256="822fe88df38cf41bffbebedb06af8d6c5eb2f808de0e2eefe6d78b215de53016",
                aliases=("boucwen_test_dynonet.h5",),
            ),
        ),
        source="https://github.com/forgi86/dynonet, folder examples/BW/data/Test signals",
        citation="J. P. Noel and M. Schoukens, Hysteretic benchmark with a dynamic nonlinearity, doi 10.4121/12967592",
    ),
    _study,
)
