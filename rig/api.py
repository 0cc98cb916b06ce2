"""The bench from Python: what ``rig run`` and ``rig resume`` do, in one call each."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from identification import (
    Backbone,
    Experiment,
    ForceSurface,
    FrequencyResponse,
    FrequencyResponseMatrix,
    PeriodicSpectra,
    Transient,
)
from rig.arming.arming import Arm
from rig.arming.run_facts import About
from rig.arming.run_options import Progress, RunOptions, Silent
from rig.bench import Bench, load_bench
from rig.campaigns.planning.plan import Plan
from rig.campaigns.plans import bench_of, load_plan
from rig.campaigns.running.runner import carry_out, take_up
from rig.measurements import Estimator, backbone, force_surface, frequency_responses, response_matrices, spectra, sweeps
from rig.measurements.experiments import experiments
from rig.measurements.experiments.periods import Periods
from rig.recording.reader import Recording

__all__ = ["Run", "resume", "run"]


class Run:
    """A new recording and its measurements. Without an output file the recording is removed with this object."""

    def __init__(self, recording: Recording, folder: "TemporaryDirectory[str] | None" = None) -> None:
        self.recording = recording
        self._folder = folder

    @property
    def complete(self) -> bool:
        """Whether every point of the plan was measured and accepted."""
        return self.recording.complete

    def backbone(self) -> Backbone:
        """The accepted points as a backbone."""
        return backbone(self.recording)

    def frequency_responses(self) -> tuple[FrequencyResponse, ...]:
        """The accepted points of a stepped sine, stepped phase or response-controlled test, one response per level and pass."""
        return frequency_responses(self.recording)

    def force_surface(self) -> ForceSurface:
        """The force over frequency and displacement, from held displacements: curves at constant force are cut from it."""
        return force_surface(self.recording)

    def sweeps(self) -> dict[int, Transient]:
        """Fundamentals over time of every sweep, by the number of its point."""
        return sweeps(self.recording)

    def spectra(self) -> dict[float, PeriodicSpectra]:
        """Spectra of all realisations of a multisine test, by level in V RMS."""
        return spectra(self.recording)

    def response_matrices(self, *, estimator: Estimator = "instrument") -> dict[float, FrequencyResponseMatrix]:
        """Frequency responses from the force to every motion of a multisine test, by level in V RMS."""
        return response_matrices(self.recording, estimator=estimator)

    def experiments(
        self,
        *,
        inputs: Sequence[str] = ("force",),
        outputs: Sequence[str] | None = None,
        rate_hz: float | None = None,
        periods: Periods = "mean",
        transient_periods: float | None = None,
        segment_periods: int = 30,
    ) -> tuple[Experiment, ...]:
        """The accepted points as data of nonlinear state-space models (`rig.measurements.experiments.experiments`)."""
        return experiments(
            self.recording,
            inputs=inputs,
            outputs=outputs,
            rate_hz=rate_hz,
            periods=periods,
            transient_periods=transient_periods,
            segment_periods=segment_periods,
        )

    def close(self) -> None:
        """Close the file; a temporary one is removed."""
        self.recording.close()
        if self._folder is not None:
            self._folder.cleanup()

    def __enter__(self) -> "Run":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()


def run(
    plan: Plan | str | Path,
    *,
    bench: Bench | str | Path | None = None,
    output: str | Path | None = None,
    seed: int = 0,
    realtime: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    arm: Arm = None,
    operator: str | None = None,
    specimen_serial: str = "",
    notes: Sequence[str] = (),
) -> Run:
    """Carry out a plan: a plan object, the name of a shipped one (``"magnet-beam/backbone"``) or a TOML file.

    ``bench`` replaces the bench that the plan names. ``seed`` draws the noise of a virtual rig; the same seed gives the
    same recording bit for bit on the same machine. ``realtime`` holds a virtual rig back to the wall clock.

    A bench on which something physical moves must be armed by a person: ``arm`` is True, or a callable that receives a
    `rig.arming.arming.ArmingRequest` and returns whether to go on. ``operator`` (the user if not given),
    ``specimen_serial`` and ``notes`` are recorded.

    Raises `rig.errors.ConfigurationError` for a plan or bench that is not allowed, `rig.errors.RecordingError` for a
    file that cannot be written, `rig.errors.DaqError` for a device that cannot be started, `rig.errors.NotArmed`. A run that
    ends early raises nothing; ``complete`` is false and the recording says why.
    """
    options = RunOptions(
        seed=seed,
        realtime=realtime,
        overwrite=overwrite,
        progress=progress or Silent(),
        arm=arm,
        about=About(operator, specimen_serial, tuple(notes)),
    )
    source = "" if isinstance(plan, Plan) else plan
    plan = plan if isinstance(plan, Plan) else load_plan(plan)
    if bench is None:
        bench = bench_of(plan, source)
    elif not isinstance(bench, Bench):
        bench = load_bench(bench)
    folder = TemporaryDirectory(prefix="vibrolock-") if output is None else None
    path = Path(output) if output is not None else Path(folder.name if folder else "") / "run.h5"
    try:
        recording = carry_out(plan, bench, path, options)
    except BaseException:
        if folder is not None:
            folder.cleanup()
        raise
    return Run(recording, folder)


def resume(
    output: str | Path,
    *,
    plan: Plan | str | Path | None = None,
    seed: int | None = None,
    realtime: bool = False,
    progress: Progress | None = None,
    arm: Arm = None,
    operator: str | None = None,
    specimen_serial: str = "",
    notes: Sequence[str] = (),
    retry_tripped: bool = False,
    trust_code: bool = False,
) -> Run:
    """Continue a recording: accepted points stay, the others are measured in a further part.

    A changed ``plan`` of the same kind and bench replaces the plan in force. Points that it asks for and that were accepted
    under any earlier plan are not measured again; points that it does not ask for stay in the file but no longer count.
    ``seed`` draws the noise of the further part; if None, a seed that no part had. ``arm`` to ``notes``: as for `run`.
    A level that tripped, and any higher one, is not tried again unless ``retry_tripped``. Functions of the user's own that
    the recorded bench names are code chosen by the author of the file: they are imported only with ``trust_code``.

    Raises `rig.errors.ConfigurationError` for a plan that cannot follow or asks for a level that tripped,
    `rig.errors.RecordingError` for a file that cannot be read or written.
    """
    options = RunOptions(
        seed=seed,
        realtime=realtime,
        progress=progress or Silent(),
        arm=arm,
        about=About(operator, specimen_serial, tuple(notes)),
    )
    source = "" if plan is None or isinstance(plan, Plan) else plan
    change = plan if plan is None or isinstance(plan, Plan) else load_plan(plan)
    recording = take_up(
        Path(output), options, change=change, source=source, retry_tripped=retry_tripped, trust_code=trust_code
    )
    return Run(recording)
