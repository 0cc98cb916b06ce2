"""Measured stepped-sine frequency responses, one per level."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from identification.channels import MOTION_ORDER, MOTION_UNIT, Motion
from identification.errors import IdentificationError
from identification.validation import finite_array, positive
from vibrolock.arrays import Complex, Float
from vibrolock.results import Result

Controlled = Literal["force", "response", "voltage", "none"]


@dataclass(frozen=True, eq=False)
class FrequencyResponse(Result):
    """Stepped-sine response at one level; fundamental harmonics only.

    Raises `IdentificationError` if values are NaN or infinite, shapes differ, there are no points, a kind is unknown,
    or a force or response is zero.

    Parameters
    ----------
    frequency_hz
        float[n], in the order of measurement.
    force
        complex[n], fundamental of the force, peak, N; against any phase reference.
    response
        complex[n], fundamental of the response, peak, in SI units of ``kind``, against the phase reference of ``force``.
    kind
        What was measured: ``displacement``, ``velocity`` or ``acceleration``.
    controlled
        What the controller held at its level: ``force``, ``response``, ``voltage`` or ``none``.
    level
        Nominal level of the controlled quantity, peak, SI.
    label
        Name of the level.
    specimen
        Name of what was tested.
    """

    frequency_hz: Float
    force: Complex
    response: Complex
    kind: Motion
    controlled: Controlled
    level: float
    label: str = ""
    specimen: str = ""

    def __post_init__(self) -> None:
        for name, dtype in (("frequency_hz", np.float64), ("force", np.complex128), ("response", np.complex128)):
            array = finite_array(name, getattr(self, name), dtype, 1)
            object.__setattr__(self, name, array)
            if array.shape != self.frequency_hz.shape or not array.size:
                reason = f"{array.size} values for {self.frequency_hz.size} frequencies"
                raise IdentificationError(reason, field=name, allowed="at least one of each")
            refused = array <= 0.0 if name == "frequency_hz" else array == 0.0
            if refused.any():
                where = int(np.argmax(refused))
                allowed = "be above zero" if name == "frequency_hz" else "not be zero"
                raise IdentificationError(f"value at [{where}] is {array[where]}, must {allowed}", field=name)
        IdentificationError.unless_one_of("kind", self.kind, get_args(Motion))
        IdentificationError.unless_one_of("controlled", self.controlled, get_args(Controlled))
        positive("level", self.level)

    def table(self) -> list[dict[str, float]]:
        """Return one dictionary a point: frequency, force, amplitude and lag of the displacement behind the force."""
        columns = {
            "frequency_hz": self.frequency_hz,
            "force_n": self.force_n,
            "amplitude_m": self.amplitude_m,
            "phase_lag_deg": self.phase_lag_deg,
        }
        return [
            dict(zip(columns, row, strict=True)) for row in zip(*map(np.ndarray.tolist, columns.values()), strict=True)
        ]

    @property
    def level_unit(self) -> str:
        """Unit of ``level``; empty where nothing was controlled."""
        units = {"force": "N", "voltage": "V", "response": MOTION_UNIT[self.kind], "none": ""}
        return units[self.controlled]

    @property
    def force_n(self) -> Float:
        """float[n]: peak of the force, N."""
        return np.abs(self.force)

    @property
    def displacement_m(self) -> Complex:
        """complex[n]: fundamental of the displacement, m."""
        return np.asarray(self.response / (2j * np.pi * self.frequency_hz) ** MOTION_ORDER[self.kind])

    @property
    def amplitude_m(self) -> Float:
        """float[n]: peak of the displacement, m."""
        return np.abs(self.displacement_m)

    @property
    def phase_lag_deg(self) -> Float:
        """float[n]: lag of the displacement behind the force, degrees, in (-180, 180]."""
        return np.asarray(np.degrees(np.angle(self.force / self.displacement_m)))


def pack_frequency_responses(responses: Sequence[FrequencyResponse]) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Return the responses as arrays and JSON-able attributes.

    The arrays hold the levels one after another; ``points_per_level`` gives the number of points of each.
    """
    IdentificationError.raise_if(not responses, "is empty", field="responses", allowed="at least one level")
    arrays: dict[str, NDArray[Any]] = {
        name: np.concatenate([getattr(item, name) for item in responses])
        for name in ("frequency_hz", "force", "response")
    }
    arrays["points_per_level"] = np.array([item.frequency_hz.size for item in responses])
    arrays["level"] = np.array([item.level for item in responses])
    texts = ("kind", "controlled", "label", "specimen")
    return arrays, {"levels": [{name: getattr(item, name) for name in texts} for item in responses]}


def unpack_frequency_responses(
    arrays: Mapping[str, NDArray[Any]], attributes: Mapping[str, Any]
) -> tuple[FrequencyResponse, ...]:
    """Invert `pack_frequency_responses`.

    Raises `IdentificationError` if something is missing or unknown.

    Parameters
    ----------
    arrays
        Arrays by name.
    attributes
        Attributes by name.
    """
    try:
        ends = np.cumsum(arrays["points_per_level"])[:-1]
        columns = [np.split(arrays[name], ends) for name in ("frequency_hz", "force", "response")]
        rows = zip(*columns, arrays["level"], attributes["levels"], strict=True)
        return tuple(FrequencyResponse(f, force, y, level=float(v), **texts) for f, force, y, v, texts in rows)
    except (KeyError, TypeError) as error:
        raise IdentificationError(f"frequency responses: {error} is missing or unknown") from None
