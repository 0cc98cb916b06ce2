"""Training and test data of nonlinear state-space models: inputs and outputs over time, periodic or not."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.experiments.noise import PeriodChange, mean_covariance, period_change
from identification.validation import convert_fields, finite_array, positive
from vibrolock.arrays import Complex, Float

InitialState = Literal["zero", "estimated"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Experiment:
    """One record of inputs and outputs.

    Raises `IdentificationError` if values are NaN or infinite, shapes do not agree, no sample counts, or the counted
    part is not whole periods.

    Parameters
    ----------
    inputs, outputs
        float[n_inputs, n], float[n_outputs, n], in the units of the channels, without gaps.
    sample_rate_hz
        Samples per second.
    input_channels, output_channels
        One per row.
    counted_from
        First sample that counts in errors; earlier samples let transients decay: they are simulated but not compared.
    period_samples
        Number of samples in a period; the counted part is a whole number of periods. 0 for a record that is not periodic.
    initial_state
        Whether the state before the first sample is ``zero`` or ``estimated`` together with the model.
    weight
        Weight of the squared errors of this experiment relative to other experiments.
    name
        Name for tables and messages.
    level
        Level (RMS or peak, as specified) by which tables sort; NaN if there is none.
    specimen
        Name of the test specimen.
    excited_hz
        Lowest and highest excited frequency; None if unknown. Frequencies that the structure generates, such as harmonics in
        a measured force, do not count as excited.
    noise_covariance
        complex[n_lines, n, n], covariance of the amplitudes (peak) of the lines 1, 2, ... below half the sample rate, of all
        inputs and then all outputs, from the scatter of periods that were averaged; None if unknown.
    period_change
        Mean over the periods less the last of them, which tells a transient that was left; None if unknown.
    """

    inputs: Float
    outputs: Float
    sample_rate_hz: float
    input_channels: tuple[Channel, ...]
    output_channels: tuple[Channel, ...]
    counted_from: int = 0
    period_samples: int = 0
    initial_state: InitialState = "zero"
    weight: float = 1.0
    name: str = ""
    level: float = float("nan")
    specimen: str = ""
    excited_hz: tuple[float, float] | None = None
    noise_covariance: Complex | None = None
    period_change: PeriodChange | None = None

    def __post_init__(self) -> None:
        convert_fields(self, tuple, "input_channels", "output_channels")
        where = f"experiment '{self.name}', " if self.name else ""
        refused = partial(IdentificationError, where=where)
        for name, channels in (("inputs", self.input_channels), ("outputs", self.output_channels)):
            array = finite_array(f"{where}{name}", getattr(self, name), np.float64, 2)
            if array.shape[0] != len(channels) or not len(channels):
                raise IdentificationError(
                    f"shape {array.shape}", field=f"{where}{name}", allowed="a row for each channel, one at least"
                )
            object.__setattr__(self, name, array)
        n = self.inputs.shape[1]
        if self.outputs.shape[1] != n:
            raise refused(f"have {self.outputs.shape[1]} samples, inputs {n}", field="outputs")
        if np.ndim(self.sample_rate_hz):
            shape, hint = np.shape(self.sample_rate_hz), "resample what was sampled at unequal steps"
            raise refused(f"has shape {shape}", field="sample_rate_hz", allowed="one number", hint=hint)
        positive(f"{where}sample_rate_hz", self.sample_rate_hz, "Hz")
        positive(f"{where}weight", self.weight)
        if self.initial_state not in get_args(InitialState):
            raise refused(field="initial_state", value=self.initial_state, allowed=get_args(InitialState))
        if not 0 <= self.counted_from < n:
            allowed = f"0 to {n - 1}, one sample at least must count"
            raise refused(field="counted_from", value=self.counted_from, allowed=allowed)
        if self.period_samples < 0 or (self.period_samples and self.counted % self.period_samples):
            reason = f"the {self.counted} samples that count are not a whole number of periods"
            raise refused(reason, field="period_samples", value=self.period_samples)
        rows = len(self.inputs) + len(self.outputs)
        allowed_shape = ((self.period_samples + 1) // 2 - 1, rows, rows)
        noise = self.noise_covariance
        if noise is not None and self.period_samples and np.shape(noise) != allowed_shape:
            raise refused(f"shape {np.shape(noise)}", field="noise_covariance", allowed=allowed_shape)
        change = self.period_change
        if change is not None and self.period_samples and np.shape(change.values)[-1:] != (self.period_samples,):
            needed = f"a row for each channel, {self.period_samples} samples"
            raise refused(f"shape {np.shape(change.values)}", field="period_change", allowed=needed)
        if self.excited_hz is not None and not 0.0 <= self.excited_hz[0] < self.excited_hz[1]:
            allowed = "two rising frequencies, none below zero"
            raise refused(field="excited_hz", value=self.excited_hz, allowed=allowed)

    @classmethod
    def periodic(
        cls,
        inputs: ArrayLike,
        outputs: ArrayLike,
        *,
        transient_samples: int,
        sample_rate_hz: float,
        input_channels: Sequence[Channel],
        output_channels: Sequence[Channel],
        name: str = "",
        level: float = float("nan"),
        specimen: str = "",
        excited_hz: tuple[float, float] | None = None,
    ) -> "Experiment":
        """Create an experiment of one settled period (float[n_channels, n_period]) with ``transient_samples`` ahead of it.

        The samples ahead repeat the same period; they may exceed one period. The transient of a simulation from rest decays
        in them, and they are not compared.
        """
        both: list[Float] = []
        for values in (inputs, outputs):
            period = np.asarray(values, dtype=np.float64)
            n = period.shape[-1]
            both.append(period[..., np.arange(-transient_samples, n) % max(n, 1)])
        return cls(
            inputs=both[0],
            outputs=both[1],
            sample_rate_hz=sample_rate_hz,
            input_channels=tuple(input_channels),
            output_channels=tuple(output_channels),
            counted_from=transient_samples,
            period_samples=both[0].shape[-1] - transient_samples,
            name=name,
            level=level,
            specimen=specimen,
            excited_hz=excited_hz,
        )

    @property
    def counted(self) -> int:
        """Number of samples that count."""
        return int(self.inputs.shape[1]) - self.counted_from

    @property
    def counted_inputs(self) -> Float:
        """float[n_inputs, counted]."""
        return np.asarray(self.inputs[:, self.counted_from :])

    @property
    def counted_outputs(self) -> Float:
        """float[n_outputs, counted]."""
        return np.asarray(self.outputs[:, self.counted_from :])

    @property
    def output_noise(self) -> Float | None:
        """float[n_outputs, n_lines]: standard errors of the amplitudes of the outputs' lines; None if unknown."""
        if self.noise_covariance is None:
            return None
        return np.asarray(np.sqrt(np.einsum("kii->ik", self.noise_covariance).real[len(self.inputs) :]))

    def averaged(self, *, transient_samples: int | None = None) -> "Experiment":
        """Return the mean over the counted periods and its noise as one settled period, with samples of it ahead (`periodic`).

        If all periods are equally noisy, a fit to the mean gives the same model as a fit to all periods in a fraction of the
        time. None for ``transient_samples`` keeps the number of samples that were not counted. Raises `IdentificationError`
        if it is not periodic.
        """
        if not self.period_samples:
            reason = f"experiment '{self.name}': is not periodic, so that there are no periods to average"
            raise IdentificationError(reason)
        ahead = self.counted_from if transient_samples is None else transient_samples
        size, noise, change = self.period_samples, self.noise_covariance, self.period_change
        both = np.vstack([self.counted_inputs, self.counted_outputs]).reshape(-1, self.counted // size, size)
        noise = mean_covariance(both, size) if noise is None else noise
        change = period_change(both) if change is None else change
        means = [
            values.reshape(len(values), -1, self.period_samples).mean(axis=1)[
                :, np.arange(-ahead, self.period_samples) % self.period_samples
            ]
            for values in (self.counted_inputs, self.counted_outputs)
        ]
        return replace(
            self,
            inputs=means[0],
            outputs=means[1],
            counted_from=ahead,
            noise_covariance=noise,
            period_change=change,
        )

    def with_constant_input(self, value: float = 1.0) -> "Experiment":
        """Return the experiment with an additional input ``constant`` of one value, whose effect compensates offsets.

        Offsets of sensors and amplifiers strongly disturb polynomials and are rarely known well enough to be subtracted. Give
        the input the same value in all experiments, including predicted ones.
        """
        at, noise, change = len(self.inputs), self.noise_covariance, self.period_change
        return replace(
            self,
            inputs=np.vstack([self.inputs, np.full((1, self.inputs.shape[1]), positive("value", value))]),
            noise_covariance=None if noise is None else np.insert(np.insert(noise, at, 0.0, axis=1), at, 0.0, axis=2),
            period_change=None if change is None else change._replace(values=np.insert(change.values, at, 0.0, axis=0)),
            input_channels=(*self.input_channels, Channel("constant", "monitor", "1")),
        )

    def weighted(self, weight: float) -> "Experiment":
        """Return the experiment with another weight."""
        return replace(self, weight=weight)


def excited_band(experiments: Sequence[Experiment]) -> tuple[float, float] | None:
    """Lowest and highest frequency that any experiment excites; None if no experiment states a band."""
    bands = [experiment.excited_hz for experiment in experiments if experiment.excited_hz is not None]
    return (min(low for low, _ in bands), max(high for _, high in bands)) if bands else None


def same_data(one: Experiment, other: Experiment) -> bool:
    """Return whether two experiments hold the same samples: the same object, or the same file read twice."""
    if one is other:
        return True
    pairs = ((one.inputs, other.inputs), (one.outputs, other.outputs))
    return all(a.shape == b.shape for a, b in pairs) and all(np.array_equal(a, b) for a, b in pairs)


def same_channels(experiments: Sequence[Experiment]) -> None:
    """Raise `IdentificationError` unless there is at least one experiment and all have the same channels and sample rate."""
    IdentificationError.raise_if(not experiments, "none given", field="experiments", allowed="one at least")
    first = experiments[0]
    for index, other in enumerate(experiments):
        what = f"experiments[{index}]{f' ({other.name})' if other.name else ''}"
        if abs(other.sample_rate_hz / first.sample_rate_hz - 1.0) > 1e-9:
            reason = f"sampled at {other.sample_rate_hz:g} Hz, the first at {first.sample_rate_hz:g} Hz; resample one"
            raise IdentificationError(reason, where=what)
        for name in ("input_channels", "output_channels"):
            mine, theirs = (tuple(c.name for c in getattr(e, name)) for e in (other, first))
            if mine != theirs:
                reason = f"{name.replace('_', ' ')} {', '.join(mine)}, the first has {', '.join(theirs)}"
                raise IdentificationError(reason, where=what)
