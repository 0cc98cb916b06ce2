"""Periodic vibrations of a nonlinear state-space model with all harmonics, and frequency responses composed of them."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.channels import MOTION_ORDER, Channel
from identification.errors import IdentificationError
from identification.harmonic_balance.basis import harmonics_of
from identification.harmonic_balance.driven import DrivenBalance
from identification.harmonic_balance.stability import Loss, loss_of_stability
from identification.prediction.steady_prediction import SteadyPrediction
from vibrolock.arrays import Complex, Float

_FINE = 16
"""Samples per harmonic for the largest magnitude of a state, which is found to 0.5 % of the highest harmonic."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SteadyStates:
    """Periodic vibrations, one per point.

    Parameters
    ----------
    frequency_hz
        float[n], frequency of the vibration.
    states, inputs, outputs
        complex[n, H + 1, n_states | n_inputs | n_outputs], harmonics ``y = Re sum Y_h exp(i h theta)``.
    voltage_v
        complex[n], amplitude of the voltage; NaN if there is none.
    multipliers
        complex[n, n_states], multipliers of a disturbance over one sample, with unchanged inputs.
    stable
        bool[n], whether the vibration is stable. Under a given input: every multiplier is below 1 in magnitude. With a held
        force: the point is stable under slow changes of frequency, and only real positive multipliers exceed 1; these apply
        to an input that is not held.
    loss
        Loss of stability: ``fold``, ``period doubling``, ``Neimark-Sacker``; empty for stable points.
    state_use, input_use
        float[n, n_states], float[n, n_inputs], largest magnitude over the largest in the training data; NaN where unknown.
    input_channels, output_channels
        Input and output channels.
    """

    frequency_hz: Float
    states: Complex
    inputs: Complex
    outputs: Complex
    voltage_v: Complex
    multipliers: Complex
    stable: NDArray[np.bool_]
    loss: tuple[Loss, ...]
    state_use: Float
    input_use: Float
    input_channels: tuple[Channel, ...]
    output_channels: tuple[Channel, ...]

    @property
    def count(self) -> int:
        """Number of points."""
        return int(self.frequency_hz.size)

    @property
    def range_use(self) -> float | Float:
        """float[n]: largest use of the states' range; NaN where that is unknown."""
        return largest_use(self.state_use)

    @property
    def force_n(self) -> Complex:
        """complex[n, H + 1]: harmonics of the force, an input or an output; raises `IdentificationError` if there is none."""
        for channels, harmonics in ((self.input_channels, self.inputs), (self.output_channels, self.outputs)):
            rows = [row for row, channel in enumerate(channels) if channel.role == "force"]
            if rows:
                return np.asarray(harmonics[:, :, rows[0]])
        raise IdentificationError("has no force among its inputs and outputs", field="model")

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the motions, the drive point first."""
        return tuple(self.output_channels[row].name for row in motion_rows(self.output_channels))

    @property
    def displacement_m(self) -> Complex:
        """complex[n, H + 1, n_channels]: displacements at `channels`, against the phase of the force; static ones are NaN
        where a velocity or acceleration was modelled.
        """  # noqa: D205
        rows = motion_rows(self.output_channels)
        order = np.array([MOTION_ORDER[self.output_channels[row].motion] for row in rows])
        h = np.arange(self.outputs.shape[1])
        s = (2j * np.pi * self.frequency_hz[:, None] * h)[:, :, None]
        lead = np.exp(-1j * np.angle(self.force_n[:, 1])[:, None] * h)[:, :, None]
        found = self.outputs[:, :, rows] * lead / np.where(s == 0.0, 1.0, s) ** order
        found[:, 0, order > 0] = np.nan
        return np.asarray(found)

    def joined(self, other: "SteadyStates") -> "SteadyStates":
        """Return the points of both, those of this one first."""
        own, others = vars(self), vars(other)
        arrays: dict[str, Any] = {
            name: np.concatenate([value, others[name]]) for name, value in own.items() if isinstance(value, np.ndarray)
        }
        return replace(self, **arrays, loss=(*self.loss, *other.loss))


def motion_rows(channels: tuple[Channel, ...]) -> list[int]:
    """Return the rows of the motions, drive points first; raise `IdentificationError` if there is none."""
    drive = [row for row, channel in enumerate(channels) if channel.role == "drive"]
    others = [row for row, channel in enumerate(channels) if channel.role == "response"]
    if not drive + others:
        raise IdentificationError("no output is a motion, whose amplitude could be predicted", field="model")
    return drive + others


def largest_use(use: Float) -> Float:
    """float[n] of float[n, k]: the largest known value of each row; NaN if none is known."""
    known = np.where(np.isfinite(use), use, -np.inf).max(axis=1, initial=-np.inf)
    return np.where(np.isfinite(known), known, np.nan)


def steady_states(
    balance: DrivenBalance,
    unknowns: Float,
    frequency_hz: Float,
    statically_stable: NDArray[np.bool_],
    level: Float | None = None,
    *,
    stability: bool = True,
) -> SteadyStates:
    """Convert solutions (float[n, n_unknowns]) of a balance to vibrations.

    ``statically_stable`` (bool[n]) marks, with a held force, the vibrations that are stable under slow changes. ``level``
    (float[n]): level of each, 1 by default. Without ``stability`` the multipliers are NaN, and what is statically stable counts
    as stable.
    """
    levels = [1.0] * len(unknowns) if level is None else level.tolist()
    basis, count, harmonics = balance.basis, frequency_hz.size, balance.basis.harmonics + 1
    sizes = {"states": balance.n_states, "inputs": len(balance.inputs), "outputs": len(balance.outputs)}
    series = {name: np.zeros((count, harmonics, size), dtype=complex) for name, size in sizes.items()}
    found = np.zeros((count, balance.order), dtype=complex)
    losses = list[Loss]()
    use = {"states": np.zeros((count, balance.ranges)), "inputs": np.zeros((count, len(balance.inputs)))}
    fine = basis.at(2.0 * np.pi * np.arange(_FINE * harmonics) / (_FINE * harmonics))
    for k, (z, at_hz) in enumerate(zip(unknowns, frequency_hz.tolist(), strict=True)):
        states, inputs = balance.states(z), balance.inputs_of(z, levels[k])
        at = balance.along(states, inputs, at_hz)
        parts = {"states": states, "inputs": inputs, "outputs": at.outputs}
        for name, part in parts.items():
            series[name][k] = harmonics_of(part)
        use["states"][k], use["inputs"][k] = balance.state_use(z, fine), balance.input_use(inputs, fine)
        multipliers = balance.multipliers(states, inputs, at, at_hz) if stability else None
        found[k] = np.nan if multipliers is None else multipliers
        losses.append(_loss(balance, multipliers, at_hz, bool(statically_stable[k])))
    return SteadyStates(
        frequency_hz=np.array(frequency_hz),
        **series,
        voltage_v=np.array([balance.drive.voltage(balance.own(z)) for z in unknowns], dtype=complex),
        multipliers=found,
        stable=np.array([not loss for loss in losses], dtype=bool),
        loss=tuple(losses),
        state_use=use["states"],
        input_use=use["inputs"],
        input_channels=balance.inputs,
        output_channels=balance.outputs,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class HarmonicResponse:
    """Frequency response of a nonlinear state-space model at constant force, with all harmonics.

    Parameters
    ----------
    force_n, force
        Level and kind of the held force, as in `SteadyPrediction`.
    points, folds
        The vibrations along the curve, and those at its turning points in frequency.
    branch
        int[n], 0 for the response that begins at the lowest frequency; 1 for a part followed from the highest frequency
        because the first did not reach it.
    notes
        Notes for the user, one line each.
    complete
        Whether every path reached the far end of the band; otherwise a note says where it ended and why.
    """

    force_n: float
    force: str
    points: SteadyStates
    folds: SteadyStates
    branch: NDArray[np.int64]
    notes: tuple[str, ...]
    complete: bool = True

    @property
    def prediction(self) -> SteadyPrediction:
        """The fundamental harmonics as a prediction; the modal amplitude is unknown because there is no mode shape."""
        count, folds = self.points.count, self.folds.count
        return SteadyPrediction(
            force_n=self.force_n,
            force=self.force,
            channels=self.points.channels,
            frequency_hz=self.points.frequency_hz,
            modal_amplitude=np.full(count, np.nan),
            fundamental_n=np.abs(self.points.force_n[:, 1]),
            displacement_m=self.points.displacement_m[:, 1],
            stable=self.points.stable,
            branch=self.branch,
            range_use=np.asarray(self.points.range_use),
            fold_frequency_hz=self.folds.frequency_hz,
            fold_amplitude_m=np.abs(self.folds.displacement_m[:, 1, 0]),
            fold_modal_amplitude=np.full(folds, np.nan),
            notes=self.notes,
            complete=self.complete,
        )


def _loss(balance: DrivenBalance, multipliers: Complex | None, frequency_hz: float, statically_stable: bool) -> Loss:
    """Return how a vibration loses its stability; without multipliers only folds are seen."""
    held = balance.drive.size > 0
    if (held or multipliers is None) and not statically_stable:
        return "fold"
    return "" if multipliers is None else loss_of_stability(multipliers, balance.angle(frequency_hz), real=not held)
