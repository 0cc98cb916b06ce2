"""Identify exciters from multisines."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from identification import Exciter, PeriodicSpectra, identify_exciter
from rig.campaigns.kinds import kinds_that_yield
from rig.errors import ConfigurationError, RecordingError
from rig.measurements import bench_of_recording, spectra
from rig.measurements.points_left_out import points_left_out
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.exciter.options import ExciterOptions
from rig.results.kind import Progress


def identify(paths: Sequence[Path], options: ExciterOptions, progress: Progress | None = None) -> Exciter:
    """Identify an exciter from the highest level of one multisine recording."""
    if len(paths) != 1:
        raise ConfigurationError(f"`kind` exciter: {len(paths)} files given, allowed is one multisine recording")
    kind = kind_of(paths[0])
    if kind not in kinds_that_yield(PeriodicSpectra):
        raise RecordingError(f"{paths[0]}: holds a {kind}; an exciter model comes from a multisine")
    low, high = options.band_hz or (None, None)
    with Recording(paths[0]) as recording:
        bench = bench_of_recording(recording)
        _, at_level = max(spectra(recording).items())
        notes = points_left_out(recording)
    found = identify_exciter(
        at_level,
        lowest_hz=low,
        highest_hz=high,
        sample_rate_hz=bench.sample_rate_hz,
        stinger_stiffness_n_m=options.stinger_stiffness_n_m,
        resistance_ohm=options.resistance_ohm,
        amplifier_gain=1.0 if options.amplifier_gain is None else options.amplifier_gain,
        source=f"{bench.name}, {bench.specimen.name}",
    )
    return replace(found, notes=(*notes, *found.notes))
