"""Wear of a specimen: natural frequencies and damping ratios that change slowly within a run.

The plant is linear in its modal coordinates and is discretised exactly. It is therefore kept constant for a while and then
replaced by the plant of a later time. The state vector, the joints' forces and the filters carry over unchanged, because none
of their coordinates depends on frequencies or damping ratios.
"""

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from simulators.part import Part, Positive, Several
from simulators.scatter import Deviation
from vibrolock.errors import InputError

Rate = Annotated[float, Field(ge=-1.0, le=1.0)]


class Wear(Part):
    """How the modes of the specimen change while it is tested: softening by time alone.

    The time is that of the device since the start of a run, in s, at rest or not: neither cycles nor amplitude count, no
    crack grows, and magnets and joints stay as they are. Every run begins unworn. A mode's natural frequency and damping
    ratio are multiplied by ``1 + rate t``, on top of ``deviation`` and ``scatter``; t goes in steps of ``every_s``.
    """

    frequency_per_s: Several[Rate] = ()
    """Relative change of each natural frequency of the structure per second (1/s), below 0 where it softens; one value per
    mode, one for all, or empty for none."""
    damping_per_s: Several[Rate] = ()
    """Relative change of each modal damping ratio per second (1/s); one value per mode, one for all, or empty for none."""
    until_s: Positive | None = None
    """Time at which the wear ends; the modes then stay as they are. Required where a rate is below 0."""
    every_s: Positive = 1.0
    """Interval at which the plant is updated, rounded to whole samples."""

    @model_validator(mode="after")
    def _something_is_left(self) -> "Wear":
        for name, rates in (("frequency_per_s", self.frequency_per_s), ("damping_per_s", self.damping_per_s)):
            fastest = min(rates, default=0.0)
            if fastest >= 0.0:
                continue
            allowed = f"below {-1.0 / fastest:.6g}, where {name} = {fastest:g} reaches -100 %"
            if self.until_s is None:
                raise InputError("is missing", field="until_s", allowed=allowed)
            if fastest * self.until_s <= -1.0:
                raise InputError(field="until_s", value=self.until_s, allowed=allowed)
        return self

    @property
    def wears(self) -> bool:
        """Whether anything changes."""
        return any(self.frequency_per_s) or any(self.damping_per_s)

    def step_samples(self, sample_rate_hz: float) -> int:
        """Return the number of samples for which the plant is held."""
        return max(1, round(self.every_s * sample_rate_hz))

    def held_s(self, sample: int, sample_rate_hz: float) -> float:
        """Return the time (s) of the plant that is in use at a sample: the time of the last change."""
        step = self.step_samples(sample_rate_hz)
        return min(sample // step * step / sample_rate_hz, math.inf if self.until_s is None else self.until_s)

    def deviation(self, time_s: float, n_mode: int, unworn: Deviation | None = None) -> Deviation:
        """Return the deviation at a time, including that of the ``unworn`` specimen; not in steps of ``every_s``.

        Raises `ValueError` for a time below 0, or if the rates are for another number of modes.
        """
        InputError.raise_if(not 0.0 <= time_s < math.inf, field="time_s", value=time_s, allowed="from 0, finite")
        elapsed_s = time_s if self.until_s is None else min(time_s, self.until_s)
        frequency = _per_mode("frequency_per_s", self.frequency_per_s, n_mode)
        damping = _per_mode("damping_per_s", self.damping_per_s, n_mode)
        return (unworn or Deviation()).combined(1.0 + frequency * elapsed_s, 1.0 + damping * elapsed_s)


def _per_mode(name: str, rates: tuple[float, ...], n_mode: int) -> NDArray[np.float64]:
    if len(rates) not in (0, 1, n_mode):
        reason = f"has {len(rates)} values"
        raise InputError(reason, field=f"wear.{name}", allowed=f"{n_mode}, one per mode, one for all, or none")
    return np.broadcast_to(np.array(rates or (0.0,)), n_mode)
