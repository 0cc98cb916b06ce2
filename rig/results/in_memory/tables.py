"""Tables of results that have no file."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from identification import (
    Comparison,
    ConstantForceCurve,
    ContinuousBackbone,
    DistortionLevels,
    ForceSurface,
    FrequencyResponse,
    PeriodicSpectra,
    ResponseBand,
    StabilisationDiagram,
    SteadyPrediction,
    SweepPrediction,
    Transient,
)
from rig.check import report as checks
from rig.results.in_memory.responses import as_predictions
from rig.results.kind import Table
from rig.results.predictions.table import TABLE as PREDICTIONS
from rig.text.console import number, print_table
from rig.tuning import Tuning
from rig.tuning.report import lines
from simulators.analysis import PeriodicResponses
from vibrolock.printable import printable

T = TypeVar("T")


def _say_response(found: FrequencyResponse) -> None:
    print(f"frequency response of {found.specimen or 'an unnamed specimen'}, {found.label or found.level_unit}")
    rows = zip(found.frequency_hz, found.force_n, found.amplitude_m, found.phase_lag_deg, strict=True)
    print_table(
        ("frequency Hz", "force N", "amplitude mm", "phase lag deg"),
        [(f"{f:.4f}", f"{n:.4f}", f"{1e3 * x:.5f}", f"{lag:.2f}") for f, n, x, lag in rows],
    )


def _say_surface(found: ForceSurface) -> None:
    resonance = found.at_lag(90.0)
    print(
        f"force surface of {found.specimen or 'an unnamed specimen'}, {len(found.levels)} levels; at phase resonance:"
    )
    rows = zip(resonance.amplitude_m, resonance.frequency_hz, resonance.force_n, strict=True)
    print_table(
        ("amplitude mm", "frequency Hz", "force N"), [(f"{1e3 * x:.5f}", f"{f:.4f}", f"{n:.4f}") for x, f, n in rows]
    )


def _say_curve(found: ConstantForceCurve) -> None:
    response = found.response
    print(f"{response.label}, cut from a force surface; +- are 95 %")
    rows = zip(
        response.phase_lag_deg,
        response.frequency_hz,
        found.frequency_std_hz,
        response.amplitude_m,
        found.amplitude_std_m,
        found.stable,
        strict=True,
    )
    print_table(
        ("lag deg", "frequency Hz", "+-", "amplitude mm", "+-", "stable"),
        [
            (
                f"{lag:.0f}",
                f"{f:.4f}",
                f"{1.96 * df:.2g}",
                f"{1e3 * x:.5f}",
                f"{1.96e3 * dx:.2g}",
                "yes" if ok else "no",
            )
            for lag, f, df, x, dx, ok in rows
        ],
    )


def _say_continuous(found: ContinuousBackbone) -> None:
    print(f"continuous backbone of {found.backbone.specimen or 'an unnamed specimen'}, {found.periods:.0f} periods")
    omega = np.sqrt(found.stiffness)
    frequency, damping = omega / (2.0 * np.pi), 50.0 * found.damping_1_s / omega
    columns = (1e3 * found.amplitude_m, frequency[0], frequency[1], damping[0], damping[1])
    rows = zip(*columns, strict=True)
    print_table(
        ("amplitude mm", "frequency up Hz", "down Hz", "damping up %", "down %"),
        [(f"{x:.5f}", *(f"{value:.4f}" for value in row)) for x, *row in rows],
    )


def _say_distortion(found: DistortionLevels) -> None:
    print(f"distortion of what is driven by {found.input}, over the signal, root mean square of the band")
    names = [channel.name for channel in found.channels]
    print_table(
        ("channel", "excited lines %", "odd lines %", "even lines %"),
        [
            (name, *(number(found.ratio(name, lines), ".3g", 100.0) for lines in ("excited", "odd", "even")))
            for name in names
        ],
    )


def _say_comparison(found: Comparison) -> None:
    row = found.error.row()
    values: dict[str, Any] = dict(row)
    print_table(
        ("prediction", "peak %", "frequency %", "envelope %", "range use", ""),
        [
            (
                values["name"],
                number(values["peak_error"], "+.2f", 100.0),
                number(values["peak_frequency_error"], "+.3f", 100.0),
                number(values["envelope_error"], ".2f", 100.0),
                number(values["range_use"], ".2f"),
                values["verdict"],
            )
        ],
    )


def _say_band(found: ResponseBand) -> None:
    print(f"of {found.draws} draws; +- are 95 %")
    print_table(
        ("peak +- mm", "at +- Hz"),
        [(f"{1.96e3 * found.peak_amplitude_std_m:.2g}", f"{1.96 * found.peak_frequency_std_hz:.2g}")],
    )


def _say_stabilisation(found: StabilisationDiagram) -> None:
    print(
        f"{found.order.size} poles, orders {found.orders.min()} to {found.orders.max()}; stable ones of the last order"
    )
    last = found.stable & (found.order == found.orders.max())
    rows = zip(found.frequency_hz[last], found.damping_ratio[last], strict=True)
    print_table(("frequency Hz", "damping %"), [(f"{f:.4f}", f"{100.0 * z:.4f}") for f, z in rows])


def _say_periodic(found: PeriodicResponses) -> None:
    print(f"harmonic balance, {found.frequency_hz.size} points")
    columns = (found.force_n, found.frequency_hz, 1e3 * found.amplitude_m, found.damping_ratio)
    rows = zip(*columns, strict=True)
    print_table(
        ("force N", "frequency Hz", "amplitude mm", "damping %"),
        [(f"{n:.4f}", f"{f:.4f}", f"{x:.5f}", number(z, ".4f", 100.0)) for n, f, x, z in rows],
    )


def _say_spectra(found: PeriodicSpectra) -> None:
    realisations, periods, _, lines = found.spectra.shape
    print(
        f"spectra of {realisations} realisations, {periods} periods each; {found.excited.sum()} of {lines} lines excited"
    )
    print_table(
        ("channel", "RMS", "unit"),
        [(channel.name, f"{found.rms(channel.name):.4g}", channel.unit) for channel in found.channels],
    )


def _say_transient(found: Transient) -> None:
    first, last = found.frequency_hz[[0, -1]]
    print(f"fundamentals from {first:.4g} to {last:.4g} Hz in {found.time_s[-1] - found.time_s[0]:.4g} s")
    rows = zip(found.channels, np.abs(found.fundamentals), strict=True)
    print_table(
        ("channel", "smallest", "largest", "at Hz", "unit"),
        [
            (one.name, f"{size.min():.4g}", f"{size.max():.4g}", f"{found.frequency_hz[size.argmax()]:.4f}", one.unit)
            for one, size in rows
        ],
    )


def _summarise_prediction(found: SteadyPrediction | SweepPrediction) -> dict[str, Any]:
    return PREDICTIONS.summarise(as_predictions(found))


def _say_tuning(found: Tuning) -> None:
    for line in lines(found):
        print(printable(line))


def _table(say: Callable[[T], None]) -> Table[T, T]:
    """Return the table of a result that is printed without a summary."""
    return Table(lambda result: result, say)


RESPONSE = _table(_say_response)
SURFACE = _table(_say_surface)
CURVE = _table(_say_curve)
CONTINUOUS = _table(_say_continuous)
DISTORTION = _table(_say_distortion)
COMPARISON = _table(_say_comparison)
BAND = _table(_say_band)
STABILISATION = _table(_say_stabilisation)
PERIODIC = _table(_say_periodic)
SPECTRA = _table(_say_spectra)
SWEEP = _table(_say_transient)
PREDICTION = Table(_summarise_prediction, PREDICTIONS.say)
TUNING = _table(_say_tuning)
CHECK = Table(checks.summary, checks.print_summary)
