"""Run and resume campaigns from Python. Each call does what ``rig run`` or ``rig resume`` does."""

from collections.abc import Sequence
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any
from weakref import finalize

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
from rig.campaigns.running.runner import resume_run, run_plan
from rig.measurements import Estimator, backbone, force_surface, frequency_responses, response_matrices, spectra, sweeps
from rig.measurements.experiments import experiments
from rig.measurements.experiments.periods import Periods
from rig.measurements.sep005 import time_series
from rig.measurements.tables import points_table, telemetry
from rig.recording.reader import Recording
from rig.system.closing import Closing
from vibrolock.results import Result

if TYPE_CHECKING:
    import pandas
    import xarray


class Run(Result, Closing):
    """A new recording and its measurements. If no output file was given, the recording is deleted together with this object."""

    def __init__(self, recording: Recording, temporary: Path | None = None) -> None:
        self.recording = recording
        self._delete = None if temporary is None else finalize(self, rmtree, temporary, ignore_errors=True)

    def __repr__(self) -> str:
        """Return what the run is: its kind, bench, accepted points and file."""
        recording = self.recording
        accepted = sum(bool(point["accepted"]) for point in recording.latest.values())
        bench = recording.configuration["bench"]["name"]
        planned = "complete" if recording.complete else "not complete"
        return f"<Run: {recording.kind} on {bench}, {accepted} points accepted, {planned}, {recording.path}>"

    __str__ = __repr__  # a notebook shows the table of its points, and `to_pandas` has it

    @property
    def complete(self) -> bool:
        """Whether every point of the plan was measured and accepted."""
        return self.recording.complete

    def backbone(self) -> Backbone:
        """Return the accepted points as a backbone."""
        return backbone(self.recording)

    def frequency_responses(self) -> tuple[FrequencyResponse, ...]:
        """Return the frequency responses of a stepped-sine, stepped-phase or response-controlled test.

        Each response holds the accepted points of one level and pass.
        """
        return frequency_responses(self.recording)

    def force_surface(self) -> ForceSurface:
        """Return the force over frequency and displacement, measured at held displacements.

        Curves at constant force can be cut from this surface.
        """
        return force_surface(self.recording)

    def sweeps(self) -> dict[int, Transient]:
        """Return the fundamentals over time of every sweep, keyed by point number."""
        return sweeps(self.recording)

    def spectra(self) -> dict[float, PeriodicSpectra]:
        """Return the spectra of all realisations of a multisine test, keyed by level in V RMS."""
        return spectra(self.recording)

    def response_matrices(self, *, estimator: Estimator = "instrument") -> dict[float, FrequencyResponseMatrix]:
        """Return the frequency responses from the force to every motion of a multisine test, keyed by level in V RMS."""
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
        """Return the accepted points as data for nonlinear state-space models (`rig.measurements.experiments.experiments`)."""
        return experiments(
            self.recording,
            inputs=inputs,
            outputs=outputs,
            rate_hz=rate_hz,
            periods=periods,
            transient_periods=transient_periods,
            segment_periods=segment_periods,
        )

    def to_pandas(self) -> "pandas.DataFrame":
        """Return the points as a table, one row a point, with units in ``attrs`` (`rig.measurements.tables.points_table`)."""
        return points_table(self.recording)

    def to_xarray(
        self,
        *,
        columns: Sequence[str] | None = None,
        part: int | None = None,
        point: int | None = None,
        from_s: float | None = None,
        to_s: float | None = None,
        every: int = 1,
    ) -> "xarray.Dataset":
        """Return recorded rows over time with units: channels by their names, and the loop's own columns.

        By default all rows of the last part. ``columns``, ``part``, ``point``, ``from_s``, ``to_s`` and ``every`` select
        (`rig.measurements.tables.telemetry`).
        """
        return telemetry(self.recording, columns=columns, part=part, point=point, from_s=from_s, to_s=to_s, every=every)

    def to_sep005(
        self,
        *,
        columns: Sequence[str] | None = None,
        part: int | None = None,
        point: int | None = None,
        from_s: float | None = None,
        to_s: float | None = None,
    ) -> list[dict[str, Any]]:
        """Return channels and output voltage as time series of SEP005 (SDyPy), one dictionary a signal.

        By default all rows of the last part. ``columns``, ``part``, ``point``, ``from_s`` and ``to_s`` select
        (`rig.measurements.sep005.time_series`).
        """
        return time_series(self.recording, columns=columns, part=part, point=point, from_s=from_s, to_s=to_s)

    def close(self) -> None:
        """Close the file. A temporary file is deleted."""
        self.recording.close()
        if self._delete is not None:
            self._delete()

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
    """Carry out a plan.

    Parameters
    ----------
    plan
        A plan, the name of a shipped one (``"magnet-beam/backbone"``) or a TOML file.
    bench
        The bench in place of that which the plan names: a bench, the name of a shipped one or a TOML file.
    output
        Recording to write (.h5); by default one in a temporary folder.
    seed
        Seed of the noise of a virtual rig. The same seed gives the same recording bit for bit on the same machine.
    realtime
        Whether a virtual rig runs no faster than the wall clock.
    overwrite
        Whether an existing recording is replaced.
    progress
        Is told of points, warnings and the end as they come.
    arm
        Arms a bench on which something physical moves: True, or a callable that receives a
        `rig.arming.arming.ArmingRequest` and returns whether to go on.
    operator, specimen_serial, notes
        Recorded with the run; the operator is the user by default.

    Raises `rig.errors.ConfigurationError` for a plan or bench that is not allowed, `rig.errors.RecordingError` for a file that
    cannot be written, `rig.errors.DaqError` for a device that cannot be started, and `rig.errors.NotArmed` if the bench was not
    armed. A run that ends early raises no error: ``complete`` is then false and the recording gives the reason.
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
    if output is not None:
        return Run(run_plan(plan, bench, Path(output), options))
    folder = Path(mkdtemp(prefix="vibrolock-"))
    try:
        return Run(run_plan(plan, bench, folder / "run.h5", options), folder)
    except BaseException:
        rmtree(folder, ignore_errors=True)
        raise


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
    """Continue a recording: keep the accepted points and measure the remaining points in a new part.

    Parameters
    ----------
    output
        The recording.
    plan
        A changed plan of the same kind and bench, which replaces the current one. Points of it that were accepted under any
        earlier plan are not measured again. Recorded points that it does not contain stay in the file but no longer count.
    seed
        Seed of the noise of the new part; if None, one that no earlier part has used.
    realtime, progress, arm, operator, specimen_serial, notes
        As for `run`.
    retry_tripped
        Whether a level that tripped, and every higher level, is tried again.
    trust_code
        Whether functions of the user that the recorded bench names are imported. They are code chosen by the author of the
        file.

    Notes
    -----
    Raises `rig.errors.ConfigurationError` for a plan that cannot follow the recorded one or that asks for a level that tripped,
    and `rig.errors.RecordingError` for a file that cannot be read or written.
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
    recording = resume_run(
        Path(output), options, change=change, source=source, retry_tripped=retry_tripped, trust_code=trust_code
    )
    return Run(recording)
