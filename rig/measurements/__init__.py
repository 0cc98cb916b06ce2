"""Read recordings as measurements in memory, and as experiments for nonlinear state-space models.

What reads a recording raises `rig.errors.RecordingError` for one of another kind, and `identification.IdentificationError` if
nothing in it was accepted.
"""

from identification.common import Estimator
from rig.campaigns.evaluation.recorded import bench_of_recording, point_rows
from rig.measurements.measurements import (
    STEPPED,
    backbone,
    continuous_backbones,
    decays,
    dwell_course,
    force_surface,
    frequency_responses,
    load_backbone,
    response_matrices,
    spectra,
    sweeps,
)

__all__ = [
    "STEPPED",
    "Estimator",
    "backbone",
    "bench_of_recording",
    "continuous_backbones",
    "decays",
    "dwell_course",
    "force_surface",
    "frequency_responses",
    "load_backbone",
    "point_rows",
    "response_matrices",
    "spectra",
    "sweeps",
]
