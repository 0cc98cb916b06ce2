"""Frequency responses from several inputs to several outputs, with the known covariances of their errors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from identification.channels import Channel, find_name
from identification.errors import IdentificationError
from identification.validation import convert_fields, finite_array, shaped_array
from vibrolock.arrays import Complex, Float
from vibrolock.results import Result


@dataclass(frozen=True, eq=False, kw_only=True)
class FrequencyResponseMatrix(Result):
    """Frequency responses ``Y = H U`` line by line.

    Raises `IdentificationError` if values are NaN or infinite, shapes do not agree, or frequencies do not rise.

    Parameters
    ----------
    outputs, inputs
        The channels Y and U, each with its unit.
    frequency_hz
        float[n_lines], rising.
    value
        complex[n_lines, n_outputs, n_inputs], in units of output over input, ``exp(+i w t)``.
    noise_covariance, total_covariance
        complex[n_lines, m, m] with ``m = n_outputs * n_inputs``: covariance ``E[e e^H]`` of ``value`` row by row, from noise
        alone and from noise with nonlinear distortion. None if unknown.
    deviations
        complex[n_lines, n_records, n_outputs * n_inputs]: contribution of each record of a mean to the error of ``value``. They
        add up to zero, and show errors that neighbouring lines have in common. None if unknown.
    decay_rate_1_s
        Rate of an exponential window ``exp(-decay_rate_1_s t)`` over input and output: ``value`` is the transfer function at
        ``s = decay_rate_1_s + i w``. 0 without a window.
    estimator
        Estimator of the responses: ``instrument``, ``H1``, ``H2``, ``Hv``, ``model`` ...
    input_rms
        float[n_inputs], RMS of every input in the band, in its unit: the level; empty if unknown.
    specimen
        Name of what was tested.
    notes
        Remarks on the quality of the responses, one line each.
    """

    outputs: tuple[Channel, ...]
    inputs: tuple[Channel, ...]
    frequency_hz: Float
    value: Complex
    noise_covariance: Complex | None = None
    total_covariance: Complex | None = None
    deviations: Complex | None = None
    decay_rate_1_s: float = 0.0
    estimator: str = ""
    input_rms: tuple[float, ...] = ()
    specimen: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        convert_fields(self, tuple, "outputs", "inputs", "input_rms", "notes")
        if not self.outputs or not self.inputs:
            raise IdentificationError(field="outputs, inputs", allowed="at least one of each")
        object.__setattr__(self, "frequency_hz", finite_array("frequency_hz", self.frequency_hz, np.float64, 1))
        if not self.frequency_hz.size or self.frequency_hz[0] < 0.0 or np.any(np.diff(self.frequency_hz) <= 0.0):
            allowed = "at least one, none below zero, each above the one before"
            raise IdentificationError(field="frequency_hz", allowed=allowed)
        paths = len(self.outputs) * len(self.inputs)
        shape = () if self.deviations is None else np.shape(self.deviations)
        records = shape[1] if len(shape) > 1 else 0
        for name, trailing in (
            ("value", (len(self.outputs), len(self.inputs))),
            ("noise_covariance", (paths, paths)),
            ("total_covariance", (paths, paths)),
            ("deviations", (records, paths)),
        ):
            if (given := getattr(self, name)) is not None:
                array = shaped_array(name, given, np.complex128, (self.frequency_hz.size, *trailing))
                object.__setattr__(self, name, array)
        if not (np.isfinite(self.decay_rate_1_s) and self.decay_rate_1_s >= 0.0):
            raise IdentificationError(field="decay_rate_1_s", value=self.decay_rate_1_s, allowed="finite, 0 or above")
        if self.input_rms and len(self.input_rms) != len(self.inputs):
            raise IdentificationError(f"{len(self.input_rms)} values for {len(self.inputs)} inputs", field="input_rms")

    @property
    def s(self) -> Complex:
        """complex[n_lines]: ``decay_rate_1_s + 2 pi i f``, rad/s, where ``value`` is the transfer function."""
        return np.asarray(self.decay_rate_1_s + 2j * np.pi * self.frequency_hz)

    @property
    def noise_std(self) -> Float:
        """float[n_lines, n_outputs, n_inputs]: standard deviation ``sqrt(E|e|^2)`` of ``value`` from noise; NaN if unknown."""
        return self._std(self.noise_covariance)

    @property
    def total_std(self) -> Float:
        """float[n_lines, n_outputs, n_inputs]: standard deviation of ``value`` with nonlinear distortion; NaN if unknown."""
        return self._std(self.total_covariance)

    def _std(self, covariance: Complex | None) -> Float:
        if covariance is None:
            return np.full(self.value.shape, np.nan)
        return np.asarray(np.sqrt(np.einsum("kii->ki", covariance).real).reshape(self.value.shape))

    def covariance(self, kind: Literal["noise", "total"]) -> Complex:
        """complex[n_lines, m, m]: ``noise_covariance`` or ``total_covariance``; raises `IdentificationError` if unknown."""
        found = {"noise": self.noise_covariance, "total": self.total_covariance}
        IdentificationError.raise_if(kind not in found, field="kind", value=kind, allowed="noise, total")
        covariance = found[kind]
        if covariance is None:
            needed = {"noise": "two periods or more", "total": "two realisations or more"}[kind]
            raise IdentificationError(f"is unknown, a measurement of {needed} has it", field=f"{kind}_covariance")
        return covariance

    def path(self, output: str, input: str | None = None) -> Complex:
        """complex[n_lines]: response of ``output`` to ``input`` (the first input if None)."""
        column = 0 if input is None else find_name(self.inputs, input)
        return np.asarray(self.value[:, find_name(self.outputs, output), column])

    def select(
        self, outputs: Sequence[str] | None = None, *, lowest_hz: float = 0.0, highest_hz: float = np.inf
    ) -> "FrequencyResponseMatrix":
        """Return the responses of some outputs at the lines of a band, both ends included."""
        rows = list(range(len(self.outputs))) if outputs is None else [find_name(self.outputs, o) for o in outputs]
        lines = (self.frequency_hz >= lowest_hz) & (self.frequency_hz <= highest_hz)
        if not lines.any():
            reason = f"no line in {lowest_hz:g} to {highest_hz:g} Hz"
            allowed = f"from {self.frequency_hz[0]:g} to {self.frequency_hz[-1]:g} Hz"
            raise IdentificationError(reason, field="lowest_hz, highest_hz", allowed=allowed)
        paths = (np.array(rows)[:, None] * len(self.inputs) + np.arange(len(self.inputs))).ravel()

        def part(covariance: Complex | None) -> Complex | None:
            return None if covariance is None else covariance[lines][:, paths[:, None], paths]

        return replace(
            self,
            outputs=tuple(self.outputs[row] for row in rows),
            frequency_hz=self.frequency_hz[lines],
            value=self.value[lines][:, rows],
            noise_covariance=part(self.noise_covariance),
            total_covariance=part(self.total_covariance),
            deviations=None if self.deviations is None else self.deviations[lines][:, :, paths],
        )
