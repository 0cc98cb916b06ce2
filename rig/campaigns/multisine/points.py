"""Realisations of a multisine: contents of their points, evaluation from recorded rows, and spectra of a recording."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from identification import (
    FrequencyResponseMatrix,
    IdentificationError,
    PeriodicSpectra,
    best_linear_approximation,
    periodic_spectra,
)
from identification.common import Estimator
from rig.bench import Bench
from rig.bench.configuration import validated
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.lost_samples import lost_rows, rms_of
from rig.campaigns.evaluation.point import Point, Quality, planned_point, result_of
from rig.campaigns.evaluation.recorded import accepted_points, bench_of_recording, point_rows
from rig.campaigns.evaluation.vibrations import VOLTAGE, channel_factors, channels_of
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.planning.plan import Target
from rig.recording.reader import Recording
from rig.text.column import Column

MULTISINE_COLUMNS = (
    Column("realisation", "realisation", "", ".0f", counts_from=1),
    Column("force_rms_n", "force", "N RMS", ".4f", plain=True),
    Column("drive_rms_m_s2", "drive", "m/s^2 RMS", ".4f", plain=True),
    Column("voltage_peak_v", "peak", "V", ".3f"),
    Column("change", "change over the periods", "%", ".3f", 100.0),
)

_LINES = 50
"""Number of lines over which the noise is assumed to be constant."""


@dataclass(frozen=True, kw_only=True)
class MultisineResult:
    """Results of a realisation."""

    force_rms_n: float
    """RMS of the force over the band, N."""
    drive_rms_m_s2: float
    """RMS of the drive point's acceleration over the band, m/s^2."""
    voltage_rms_v: float
    """RMS of the output over the band, V."""
    voltage_peak_v: float
    """Peak of the output, V."""
    change: float | None
    """Relative difference of force or drive between the first period and the others; None if there is only one period."""
    periods: int
    """Number of periods recorded."""


def measure_multisine_point(
    bench: Bench, plan: MultisinePlan, target: Target, rows: np.ndarray, settling: np.void
) -> Point[object]:
    """Evaluate a recorded realisation and its quality."""
    spectra = spectra_of(bench, plan, {target.realisation or 0: rows})
    roles, names = {c.role: c.name for c in bench.channels}, [c.name for c in bench.channels]
    periods = spectra.spectra.shape[1]
    readings = rows["inputs"][~lost_rows(rows)]
    still = next((name for name in (roles["force"], roles["drive"]) if not np.ptp(readings[:, names.index(name)])), "")
    change = max(_change(spectra, roles[role]) for role in ("force", "drive")) if periods > 1 else math.nan
    warnings = [f"{plan.periods - periods} of {plan.periods} periods are left out"] if periods < plan.periods else []
    warnings += ["one period only: noise and transients cannot be estimated"] if periods == 1 else []
    reason = f"channel {still} does not change at all: sensor, cable or supply is dead" if still else ""
    if not reason and change > plan.accepted_change:
        reason = (
            f"force or drive of the first period differs by {100.0 * change:.1f} % from the others beyond noise, accepted "
            f"up to {100.0 * plan.accepted_change:g} %: more transient_periods, or less disturbance"
        )
    return replace(
        planned_point(plan, target),
        settled=not reason if periods > 1 else None,
        reason=reason,
        quality=Quality.of(reason),
        warnings=tuple(warnings),
        channel_rms=tuple(rms_of(rows)),
        result=MultisineResult(
            force_rms_n=spectra.rms(roles["force"]),
            drive_rms_m_s2=spectra.rms(roles["drive"]),
            voltage_rms_v=spectra.rms(VOLTAGE.name),
            voltage_peak_v=float(np.abs(rows["output_v"]).max()),
            change=None if math.isnan(change) else change,
            periods=plan.periods,
        ),
    )


def spectra_of(bench: Bench, plan: MultisinePlan, records: Mapping[int, np.ndarray]) -> PeriodicSpectra:
    """Return the spectra of recorded rows, which are given by the number of the realisation.

    Every period is rotated to begin where the signal begins. The skew of the channels and the high-pass of their sensors are
    removed. Periods with lost samples are left out.
    """
    design = plan.design(bench.sample_rate_hz)
    channels = len(bench.channels) + 1
    turned = [turned_periods(bench, plan, index, rows).reshape(channels, -1) for index, rows in records.items()]
    shortest = min(record.shape[1] for record in turned)  # all realisations get as many periods as the shortest has
    turned = [record[:, :shortest] for record in turned]
    spectra = periodic_spectra(turned, (*channels_of(bench), VOLTAGE), design)
    corrected = spectra.spectra.copy()
    corrected[:, :, :-1] *= channel_factors(bench, spectra.frequency_hz)
    return replace(spectra, spectra=corrected)


def turned_periods(bench: Bench, plan: MultisinePlan, index: int, rows: np.ndarray) -> np.ndarray:
    """Return whole periods of realisation ``index``, each rotated to begin where the signal does.

    The result is float[n_channels + 1, n_periods, n]; the output is the last channel. Periods with lost samples are left out.
    The skew of the channels is not removed. Raises `identification.IdentificationError` if the record is too short or no period
    is left.
    """
    design = plan.design(bench.sample_rate_hz)
    size = design.period_samples
    if rows.size < plan.periods * size:
        raise IdentificationError(f"has {rows.size} samples", field="record", allowed=f"{plan.periods * size}")
    rows = rows[: plan.periods * size]
    output, played = rows["output_v"][:size].astype(float), design.realisation(plan.phase_seed, index)
    # The sample of the played period at which the recorded one starts.
    begun = int(np.argmax(np.fft.irfft(np.conj(np.fft.rfft(output)) * np.fft.rfft(played), size)))
    signals = np.vstack([rows["inputs"].T.astype(float), rows["output_v"].astype(float)])
    periods = signals.reshape(signals.shape[0], plan.periods, size)
    whole = ~lost_rows(rows).reshape(plan.periods, size).any(axis=1)
    IdentificationError.raise_if(not whole.any(), "samples were lost in transmission in every period", field="record")
    return np.asarray(np.roll(periods[:, whole], begun, axis=2))


def _change(spectra: PeriodicSpectra, name: str) -> float:
    """Return the difference between the first period and the mean of the others beyond noise: RMS over the band, relative.

    The result is 0 if the other periods contain no signal, as for a channel that does not change.
    """
    periods = spectra.spectra[0, :, spectra.index(name)]
    count, others = periods.shape[0], periods[1:].mean(axis=0)
    difference = periods[0] - others
    if count > 2:  # noise from the scatter of the other periods
        noise = np.sum(np.abs(periods[1:] - others) ** 2) / (count - 2) * count / (count - 1)
    else:
        noise = _rough_power(difference)
    beyond = max(float(np.linalg.norm(difference) ** 2 - noise), 0.0)
    size = float(np.linalg.norm(others))
    return math.sqrt(beyond) / size if size > 0.0 else 0.0


def _rough_power(difference: np.ndarray) -> float:
    """Power of the part that varies from line to line. Noise does; a decaying vibration away from its resonance does not."""
    if difference.size < 2 * _LINES:
        return 0.0
    bends = np.abs(difference[1:-1] - 0.5 * (difference[:-2] + difference[2:])) ** 2
    used = bends[: bends.size // _LINES * _LINES].reshape(-1, _LINES)
    # Noise power with two degrees of freedom has its median at log 2 of its mean; the bend of noise has 3/2 of the noise power.
    return float(np.mean(np.median(used, axis=1)) / (1.5 * math.log(2.0)) * difference.size)


def recorded_spectra(recording: Recording) -> dict[float, PeriodicSpectra]:
    """Return the spectra of every accepted realisation, by level (V RMS). The output is channel ``voltage``."""
    bench = bench_of_recording(recording)
    plan = validated(MultisinePlan, recording.configuration["plan"], "plan of the recording")
    levels: dict[float, dict[int, np.ndarray]] = {}
    periods: dict[float, int] = {}
    for point in accepted_points(recording, MultisineResult):
        level, recorded = point.level, result_of(point).periods
        levels.setdefault(level, {})[point.realisation or 0] = point_rows(recording, point.number)
        periods[level] = min(periods.get(level, recorded), recorded)  # a changed plan may change their number
    return {
        level: spectra_of(bench, plan.model_copy(update={"periods": periods[level]}), records)
        for level, records in levels.items()
    }


def recorded_response_matrices(
    recording: Recording, *, estimator: Estimator = "instrument"
) -> dict[float, FrequencyResponseMatrix]:
    """Return the frequency responses from the force to every motion, by level (V RMS), with their covariance."""
    specimen = bench_of_recording(recording).specimen.name
    return {
        level: best_linear_approximation(measured, estimator=estimator, specimen=specimen)
        for level, measured in recorded_spectra(recording).items()
    }


MULTISINE = Campaign(
    plan=MultisinePlan,
    result=MultisineResult,
    measure=measure_multisine_point,
    columns=MULTISINE_COLUMNS,
    draw="rig.campaigns.multisine.figure:draw",
    identity=("lowest_hz", "highest_hz", "resolution_hz", "grid", "detection_group", "phase_seed"),
    measurements={PeriodicSpectra: recorded_spectra, FrequencyResponseMatrix: recorded_response_matrices},
    exchanged=lambda recording: list(recorded_response_matrices(recording).values()),
    experiments="realisations",
)
