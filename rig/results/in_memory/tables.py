"""Tables of results that have no file."""

from typing import TYPE_CHECKING

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
from rig.results.in_memory.figures import as_predictions
from rig.results.predictions.table import ERRORS, TABLE as PREDICTIONS
from rig.text.column import Column
from rig.text.console import print_columns, print_rows, print_table
from rig.tuning import Tuning
from rig.tuning.report import lines
from simulators.analysis import PeriodicResponses
from vibrolock.printable import printable

if TYPE_CHECKING:
    from rig.check.assessment import Assessment


def say_response(found: FrequencyResponse) -> None:
    """Print the points of a frequency response."""
    print(f"frequency response of {found.specimen or 'an unnamed specimen'}, {found.label or found.level_unit}")
    print_columns(
        ("frequency Hz", ".4f", found.frequency_hz),
        ("force N", ".4f", found.force_n),
        ("amplitude mm", ".5f", 1e3 * found.amplitude_m),
        ("phase lag deg", ".2f", found.phase_lag_deg),
    )


def say_surface(found: ForceSurface) -> None:
    """Print the levels of a force surface at phase resonance."""
    resonance = found.at_lag(90.0)
    print(
        f"force surface of {found.specimen or 'an unnamed specimen'}, {len(found.levels)} levels; at phase resonance:"
    )
    print_columns(
        ("amplitude mm", ".5f", 1e3 * resonance.amplitude_m),
        ("frequency Hz", ".4f", resonance.frequency_hz),
        ("force N", ".4f", resonance.force_n),
    )


def say_curve(found: ConstantForceCurve) -> None:
    """Print a curve at constant force with its 95 % intervals."""
    response = found.response
    print(f"{response.label}, cut from a force surface; +- are 95 %")
    columns = (
        *(response.phase_lag_deg, response.frequency_hz, 1.96 * found.frequency_std_hz),
        *(1e3 * response.amplitude_m, 1.96e3 * found.amplitude_std_m, found.stable),
    )
    print_table(
        ("lag deg", "frequency Hz", "+-", "amplitude mm", "+-", "stable"),
        [
            (f"{lag:.0f}", f"{f:.4f}", f"{df:.2g}", f"{x:.5f}", f"{dx:.2g}", "yes" if stable else "no")
            for lag, f, df, x, dx, stable in zip(*columns, strict=True)
        ],
    )


def say_continuous(found: ContinuousBackbone) -> None:
    """Print modal frequency and damping of both ramps."""
    print(f"continuous backbone of {found.backbone.specimen or 'an unnamed specimen'}, {found.periods:.0f} periods")
    omega = np.sqrt(found.stiffness)
    frequency, damping = omega / (2.0 * np.pi), 50.0 * found.damping_1_s / omega
    print_columns(
        ("amplitude mm", ".5f", 1e3 * found.amplitude_m),
        ("frequency up Hz", ".4f", frequency[0]),
        ("down Hz", ".4f", frequency[1]),
        ("damping up %", ".4f", damping[0]),
        ("down %", ".4f", damping[1]),
    )


def say_distortion(found: DistortionLevels) -> None:
    """Print distortion over signal of every channel."""
    print(f"distortion of what is driven by {found.input}, over the signal, root mean square of the band")
    names = [channel.name for channel in found.channels]
    print_columns(
        ("channel", "", names),
        *(
            (f"{lines} lines %", ".3g", [100.0 * found.ratio(name, lines) for name in names])
            for lines in ("excited", "odd", "even")
        ),
    )


def say_comparison(found: Comparison) -> None:
    """Print the errors of a prediction."""
    use = Column("range_use", "range use", "", ".2f")
    print_rows([dict(found.error.row())], Column("name", "prediction"), *ERRORS, use, Column("verdict", ""))


def say_band(found: ResponseBand) -> None:
    """Print the uncertainty of a peak."""
    print(f"of {found.draws} draws; +- are 95 %")
    print_columns(
        ("peak +- mm", ".2g", [1.96e3 * found.peak_amplitude_std_m]),
        ("at +- Hz", ".2g", [1.96 * found.peak_frequency_std_hz]),
    )


def say_stabilisation(found: StabilisationDiagram) -> None:
    """Print the stable poles of the highest order."""
    print(
        f"{found.order.size} poles, orders {found.orders.min()} to {found.orders.max()}; stable ones of the last order"
    )
    last = found.stable & (found.order == found.orders.max())
    print_columns(
        ("frequency Hz", ".4f", found.frequency_hz[last]), ("damping %", ".4f", 100.0 * found.damping_ratio[last])
    )


def say_periodic(found: PeriodicResponses) -> None:
    """Print vibrations by harmonic balance."""
    print(f"harmonic balance, {found.frequency_hz.size} points")
    print_columns(
        ("force N", ".4f", found.force_n),
        ("frequency Hz", ".4f", found.frequency_hz),
        ("amplitude mm", ".5f", 1e3 * found.amplitude_m),
        ("damping %", ".4f", 100.0 * found.damping_ratio),
    )


def say_spectra(found: PeriodicSpectra) -> None:
    """Print the RMS of every channel."""
    realisations, periods, _, lines = found.spectra.shape
    print(
        f"spectra of {realisations} realisations, {periods} periods each; {found.excited.sum()} of {lines} lines excited"
    )
    print_table(
        ("channel", "RMS", "unit"),
        [(channel.name, f"{found.rms(channel.name):.4g}", channel.unit) for channel in found.channels],
    )


def say_transient(found: Transient) -> None:
    """Print the extremes of every channel in a sweep."""
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


def say_prediction(found: SteadyPrediction | SweepPrediction) -> None:
    """Print a single prediction as a file of predictions is printed."""
    PREDICTIONS.say(PREDICTIONS.summarise(as_predictions(found)))


def say_tuning(found: Tuning) -> None:
    """Print what was tuned."""
    for line in lines(found):
        print(printable(line))


def say_check(found: "Assessment") -> None:
    """Print the findings of a check."""
    checks.print_summary(checks.summary(found))
