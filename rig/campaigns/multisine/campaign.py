"""The multisine campaign: its declaration, and the spectra and frequency responses in a recording."""

import numpy as np

from identification import FrequencyResponseMatrix, PeriodicSpectra, best_linear_approximation
from identification.multisine.best_linear_approximation import Estimator
from rig.bench.configuration import validated
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.point import result_of
from rig.campaigns.evaluation.recorded import accepted_points, bench_of_recording, point_rows
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.multisine.points import MULTISINE_COLUMNS, MultisineResult, measure_multisine_point, spectra_of
from rig.recording.reader import Recording

__all__ = ["MULTISINE", "recorded_response_matrices", "recorded_spectra"]


def recorded_spectra(recording: Recording) -> dict[float, PeriodicSpectra]:
    """Spectra of every accepted realisation, by level (V RMS); the output is channel ``voltage``."""
    bench = bench_of_recording(recording)
    plan = validated(MultisinePlan, recording.configuration["plan"], "plan of the recording")
    levels: dict[float, dict[int, np.ndarray]] = {}
    periods: dict[float, int] = {}
    for point in accepted_points(recording, MultisineResult):
        level, recorded = point.level, result_of(point).periods
        levels.setdefault(level, {})[point.realisation or 0] = point_rows(recording, point.number)
        periods[level] = min(periods.get(level, recorded), recorded)  # a change of plan may change them
    return {
        level: spectra_of(bench, plan.model_copy(update={"periods": periods[level]}), records)
        for level, records in levels.items()
    }


def recorded_response_matrices(
    recording: Recording, *, estimator: Estimator = "instrument"
) -> dict[float, FrequencyResponseMatrix]:
    """Frequency responses from the force to every motion, by level (V RMS), with their covariance."""
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
