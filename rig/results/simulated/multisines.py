"""Recorded multisines as a model simulates them."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from identification import PeriodicSpectra, SimulatedRun, simulated_run
from rig.campaigns.kinds import kinds_that_yield
from rig.errors import RecordingError
from rig.measurements import bench_of_recording
from rig.measurements.experiments import experiments
from rig.measurements.points_left_out import points_left_out
from rig.recording.reader import Recording
from rig.results.predictions.sweeps import strangers
from rig.results.simulated.data_files import fingerprint
from rig.results.simulated.driven_models import driving, with_constants
from rig.results.simulated.model import SimulatedModel


def simulated_multisines(
    paths: Sequence[Path], identified: SimulatedModel, specimen: str, constants: Mapping[str, float]
) -> tuple[tuple[SimulatedRun, ...], tuple[str, ...]]:
    """Simulate every realisation of recordings; return the runs with their use in the identification, and notes.

    ``specimen``: that of the model. ``constants``: inputs that are no channels of the recordings, with their values.
    Raises `RecordingError` for recordings that are no multisines.
    """
    model, uses = identified.model, identified.uses
    runs: list[SimulatedRun] = []
    notes: list[str] = []
    for path in paths:
        with Recording(path) as recording:
            if recording.kind not in kinds_that_yield(PeriodicSpectra):
                raise RecordingError(f"{path}: holds a {recording.kind}, wanted is a multisine recording")
            found = experiments(
                recording,
                inputs=[channel.name for channel in driving(model.inputs, constants)],
                outputs=[channel.name for channel in model.outputs],
                rate_hz=model.sample_rate_hz,
            )
            notes += strangers(bench_of_recording(recording), specimen, None, str(path))
            notes += points_left_out(recording)
        for one in found:
            whole = with_constants(one, model, constants)
            runs.append(simulated_run(model, whole, use=uses.get(fingerprint(whole), "test" if uses else "unknown")))
        if not uses:
            notes.append("the model does not say what it was identified with: these may be its training data")
    return tuple(runs), tuple(notes)
