"""Training data of nonlinear state-space models: experiments of all files at one rate, and what is held out."""

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
"""One of so many settled points chooses the iterate."""
_FEWEST_POINTS = 5
"""Settled points of a recording from which on one of them does."""


@dataclass(frozen=True, eq=False)
class PnlssData:
    """What a fit is given."""

    training: tuple[Experiment, ...]
    """Experiments that it is fitted to."""
    validation: tuple[Experiment, ...]
    """Experiments that choose the iterate."""
    notes: tuple[str, ...]
    """What a user should know of them, one line each."""

    @property
    def fingerprint(self) -> str:
        """A text that is the same for the same data in the same use, weighted alike, alone."""
        digest = hashlib.sha256()
        for use, several in (("training", self.training), ("validation", self.validation)):
            for one in several:
                digest.update(f"{use} {one.weight:.5e} {features_of(one)}".encode())
        return digest.hexdigest()


def pnlss_data(paths: Sequence[Path], options: PnlssOptions, earlier: IdentifiedPnlss | None) -> PnlssData:
    """Experiments of all files at one rate, and those that choose the iterate; rate and channels are those of ``earlier``.

    Raises `RecordingError` for files that hold something else, `ConfigurationError` for files and options that do not go
    together, `identification.IdentificationError` where the data does not allow it.
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
    """Refuse an output that stands still in any experiment: no error can be relative to it."""
    for one in experiments:
        for channel, values in zip(one.output_channels, one.counted_outputs, strict=True):
            if not np.any(values):
                raise ConfigurationError(
                    f"{one.name}: output {channel.name} is zero throughout (dead channel); leave it out with `outputs`"
                )


def _check_files(paths: Sequence[Path], validation: Sequence[Path], *, needs_lines: bool) -> None:
    """Refuse files of other kinds, of other specimens, and those that would choose the iterate on what it is fitted to."""
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
    """The highest of what the recordings ask for, and no more than the slowest of them was recorded at."""
    rates, most = [], float("inf")
    for path in paths:
        with Recording(path) as recording:
            rates.append(default_rate_hz(recording))
            most = min(most, float(recording.configuration["bench"]["sample_rate_hz"]))
    return min(max(rates), most)


def _held_out(found: Sequence[Experiment], count: int) -> tuple[list[Experiment], list[Experiment]]:
    """What chooses the iterate apart from the others: the last realisations of each level, and every fourth settled point.

    One realisation stays. Without settled points an iterate would be taken that is good at the multisine's levels alone.
    """
    out = [one for same in _alike(found) for one in same[max(1, len(same) - count) :] if count]
    settled = [
        one for one in found if not one.period_samples and one.initial_state == "estimated"
    ]  # no sweep from rest
    if count and len(settled) >= _FEWEST_POINTS:
        out += settled[_EVERY // 2 : -1 : _EVERY]
    chosen = {id(one) for one in out}
    return [one for one in found if id(one) not in chosen], out


def _alike(found: Sequence[Experiment]) -> list[list[Experiment]]:
    """Realisations, by level and period."""
    alike: dict[tuple[float, int], list[Experiment]] = {}
    for one in found:
        if one.period_samples:
            alike.setdefault((one.level, one.period_samples), []).append(one)
    return list(alike.values())


def _relative(experiments: Sequence[Experiment]) -> tuple[Experiment, ...]:
    """Weighted so that errors of all count relative to their own outputs, whatever the level: by the mean square ratio."""
    power = np.array([np.mean(one.counted_outputs**2, axis=1) for one in experiments])
    pooled = np.mean(power, axis=0)
    pooled = np.where(pooled > 0.0, pooled, 1.0)
    return tuple(
        one.weighted(1.0 / max(float(np.mean(own / pooled)), 1e-12))
        for one, own in zip(experiments, power, strict=True)
    )
