"""Training and validation data of nonlinear state-space models: experiments of all files at one sample rate."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from identification import Experiment
from identification.validation import one_specimen
from rig.errors import ConfigurationError, RecordingError
from rig.measurements import bench_of_recording
from rig.measurements.experiments import default_rate_hz, experiments
from rig.measurements.experiments.build import KINDS
from rig.measurements.points_left_out import points_left_out
from rig.models.files.pnlss import IdentifiedPnlss
from rig.models.identify.data_fingerprints import features_of
from rig.models.identify.pnlss_request import PnlssOptions
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording

__all__ = ["PnlssData", "pnlss_data"]

_EVERY = 4
"""Every how many settled points one is used as validation data."""
_FEWEST_POINTS = 5
"""Fewest settled points of a recording from which validation points are taken."""


@dataclass(frozen=True, eq=False)
class PnlssData:
    """Data of a fit."""

    training: tuple[Experiment, ...]
    """Experiments to which the model is fitted."""
    validation: tuple[Experiment, ...]
    """Experiments by which the iterate is chosen."""
    notes: tuple[str, ...]
    """Remarks on the data for the user, one line each."""

    @property
    def fingerprint(self) -> str:
        """Fingerprint of the data, including use and weight of each experiment."""
        digest = hashlib.sha256()
        for use, several in (("training", self.training), ("validation", self.validation)):
            for one in several:
                digest.update(f"{use} {one.weight:.5e} {features_of(one)}".encode())
        return digest.hexdigest()


def pnlss_data(paths: Sequence[Path], options: PnlssOptions, earlier: IdentifiedPnlss | None) -> PnlssData:
    """Return the experiments of all files at one sample rate, split into training and validation data.

    If there is an ``earlier`` model, its sample rate and channels are used. Raises `RecordingError` for files with other
    contents, `ConfigurationError` for files and options that do not fit together, `identification.IdentificationError` if the
    data does not allow the identification.
    """
    _check_files(paths, options.validation, needs_lines=earlier is None)
    channels = options.channels
    if earlier is not None:
        rate_hz = earlier.model.sample_rate_hz
        channels = {
            "inputs": tuple(channel.name for channel in earlier.model.inputs),
            "outputs": [channel.name for channel in earlier.model.outputs],
        }
    else:
        rate_hz = options.rate_hz or _common_rate_hz(paths)
    held = options.hold_out if options.hold_out is not None else (0 if options.validation else 1)
    training: list[Experiment] = []
    validation: list[Experiment] = []
    notes: list[str] = []
    most = 0
    for path in paths:
        with Recording(path) as recording:
            found = experiments(recording, rate_hz=rate_hz, **channels)
            notes += points_left_out(recording)
        most = max(most, *(len(same) for same in _alike(found)), 0)
        kept, out = _held_out(found, held)
        training += kept
        validation += out
    if options.hold_out is not None and options.hold_out >= max(most, 2):
        raise ConfigurationError(
            f"`hold_out` = {options.hold_out}: no level has more than {most} realisations; allowed is 0 to {max(most - 1, 1)}"
        )
    for path in options.validation:
        with Recording(path) as recording:
            validation += experiments(recording, rate_hz=rate_hz, **channels)
    _check_alive([*training, *validation])
    if not validation:
        notes.append("no data to choose the iterate by: the last one is taken, however it does on other data")
    if "force" not in [channel.role for channel in (*training[0].input_channels, *training[0].output_channels)]:
        notes.append(
            "the force is neither input nor output: the model predicts multisines alone; add it to the outputs"
        )
    if "voltage" in [channel.name for channel in training[0].input_channels]:
        notes.append(f"the input is the voltage: the model holds for the exciter of {_benches(paths)} alone")
    if options.relative:
        training, validation = list(_relative(training)), list(_relative(validation) if validation else ())
    return PnlssData(tuple(training), tuple(validation), tuple(notes))


def _check_alive(experiments: Sequence[Experiment]) -> None:
    """Refuse an output that is zero throughout an experiment, because relative errors of it are undefined."""
    for one in experiments:
        for channel, values in zip(one.output_channels, one.counted_outputs, strict=True):
            if not np.any(values):
                raise ConfigurationError(
                    f"{one.name}: output {channel.name} is zero throughout (dead channel); leave it out with `outputs`"
                )


def _check_files(paths: Sequence[Path], validation: Sequence[Path], *, needs_lines: bool) -> None:
    """Refuse files of other kinds, of other specimens, and validation files that are also used for training."""
    kinds = {path: kind_of(path) for path in (*paths, *validation)}
    for path, kind in kinds.items():
        if kind not in KINDS:
            raise RecordingError(
                f"{path}: is a file of kind {kind}; a PNLSS model comes from recordings: {', '.join(KINDS)}"
            )
    for path in validation:
        if any(path.samefile(other) for other in paths):
            raise ConfigurationError(
                f"`validation` = {path}: is among the files that the model is fitted to; leave it out for `hold_out`, or take "
                "another recording"
            )
    if twice := next((one for one, other in combinations(validation, 2) if one.samefile(other)), None):
        raise ConfigurationError(f"`validation` = {twice}: is given twice; each file once")
    if needs_lines and "multisine" not in [kinds[path] for path in paths]:
        raise ConfigurationError(
            f"{', '.join(f'{path} ({kinds[path]})' for path in paths)}: no multisine among them, from which the linear model "
            "that a fit begins with comes; add one"
        )
    one_specimen(**{str(path): _bench_and_specimen(path)[1] for path in kinds})


def _bench_and_specimen(path: Path) -> tuple[str, str]:
    with Recording(path) as recording:
        bench = bench_of_recording(recording)
        return bench.name, bench.specimen.name


def _benches(paths: Sequence[Path]) -> str:
    return " and ".join(dict.fromkeys(_bench_and_specimen(path)[0] for path in paths))


def _common_rate_hz(paths: Sequence[Path]) -> float:
    """Return the highest rate that any recording needs, limited to the lowest rate at which any was recorded."""
    rates, most = [], float("inf")
    for path in paths:
        with Recording(path) as recording:
            rates.append(default_rate_hz(recording))
            most = min(most, float(recording.configuration["bench"]["sample_rate_hz"]))
    return min(max(rates), most)


def _held_out(found: Sequence[Experiment], count: int) -> tuple[list[Experiment], list[Experiment]]:
    """Separate validation data: the last realisations of each level, and every fourth settled point.

    At least one realisation of each level stays in training. Without settled points in validation, the chosen iterate would be
    good only at the multisine's levels.
    """
    out = [one for same in _alike(found) for one in same[max(1, len(same) - count) :] if count]
    settled = [
        one for one in found if not one.period_samples and one.initial_state == "estimated"
    ]  # without sweeps from rest
    if count and len(settled) >= _FEWEST_POINTS:
        out += settled[_EVERY // 2 : -1 : _EVERY]
    chosen = {id(one) for one in out}
    return [one for one in found if id(one) not in chosen], out


def _alike(found: Sequence[Experiment]) -> list[list[Experiment]]:
    """Group realisations by level and period."""
    alike: dict[tuple[float, int], list[Experiment]] = {}
    for one in found:
        if one.period_samples:
            alike.setdefault((one.level, one.period_samples), []).append(one)
    return list(alike.values())


def _relative(experiments: Sequence[Experiment]) -> tuple[Experiment, ...]:
    """Weight experiments by the mean square of their outputs, so that errors count relative to them at every level."""
    power = np.array([np.mean(one.counted_outputs**2, axis=1) for one in experiments])
    pooled = np.mean(power, axis=0)
    pooled = np.where(pooled > 0.0, pooled, 1.0)
    return tuple(
        one.weighted(1.0 / max(float(np.mean(own / pooled)), 1e-12))
        for one, own in zip(experiments, power, strict=True)
    )
