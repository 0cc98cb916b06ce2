"""Options for the identification of a nonlinear state-space model."""

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from rig.errors import ConfigurationError

__all__ = ["PnlssOptions"]

_INPUTS = ("force", "voltage")


@dataclass(frozen=True, kw_only=True)
class PnlssOptions:
    """Options of ``rig identify --model pnlss``. None selects the default.

    Raises `ConfigurationError` for values that are not allowed.
    """

    states: int | None = None
    """Number of states, two per mode of vibration; 2 if None."""
    degrees: str | None = None
    """Degrees of the monomials, separated by commas; empty: none. Default: ``2,3``, or none if there are saturating features.
    """
    rate_hz: float | None = None
    """Sample rate of the model."""
    input: str | None = None
    """``force`` or ``voltage``."""
    outputs: str | None = None
    """Names of the outputs, separated by commas. Default: all motions, and the force if the voltage is the input."""
    output_polynomials: bool | None = None
    """Whether monomials also act on the outputs; yes if None."""
    saturating: int | None = None
    """Number of saturating features. They replace the monomials unless degrees are given; none if None."""
    iterations: int | None = None
    """Largest number of iterations of the fit; 100 if None."""
    validation: tuple[Path, ...] = ()
    """Recordings by which the iterate is chosen."""
    hold_out: int | None = None
    """Number of last realisations of each level by which the iterate is chosen instead. If a recording has at least five
    settled points, every fourth of them is used as well. 1 if None; with 0 nothing is held out."""
    relative: bool | None = None
    """Whether the errors of each experiment count relative to its outputs. Otherwise absolute errors count, and large levels
    dominate."""
    resume: Path | None = None
    """File of an earlier fit to the same data, which is continued."""

    def __post_init__(self) -> None:
        for name, value, least in (
            ("states", self.states, 1),
            ("saturating", self.saturating, 0),
            ("iterations", self.iterations, 0),
            ("hold_out", self.hold_out, 0),
        ):
            if value is not None and value < least:
                raise ConfigurationError(f"`{name}` = {value}: allowed is {least} and above")
        if self.rate_hz is not None and not 0.0 < self.rate_hz < math.inf:
            raise ConfigurationError(f"`rate_hz` = {self.rate_hz:g}: allowed is any number above 0, Hz")
        if self.input not in (None, *_INPUTS):
            raise ConfigurationError(f"`input` = {self.input!r}: allowed are {', '.join(_INPUTS)}")
        self.chosen_degrees  # noqa: B018 refused here, not when it is asked for
        if self.validation and self.hold_out:
            raise ConfigurationError("`hold_out`: is instead of `validation`; leave one of the two out")
        if self.resume is not None:
            fixed = ("states", "degrees", "rate_hz", "output_polynomials", "saturating", "input", "outputs")
            for field in fields(self):
                if field.name in fixed and getattr(self, field.name) is not None:
                    raise ConfigurationError(f"`{field.name}`: is that of the fit that goes on; leave it out")

    @property
    def chosen_degrees(self) -> tuple[int, ...]:
        """Degrees as numbers; empty for an empty text, or if saturating features replace the monomials."""
        try:
            found = tuple(sorted({int(part) for part in (self.degrees or "").split(",") if part.strip()}))
        except ValueError:
            found = (0,)
        if any(not 2 <= degree <= 12 for degree in found):
            raise ConfigurationError(
                f"`degrees` = {self.degrees!r}: allowed are whole numbers from 2 to 12 with commas, such as 2,3; 1 is the "
                'linear part, "" is none'
            )
        if self.degrees is None:
            return () if self.saturating else (2, 3)
        return found

    @property
    def saturating_features(self) -> int | tuple[int, int]:
        """Number of saturating features as `identification.identify_pnlss` takes it. Linear outputs have none of them."""
        return (self.saturating or 0, 0) if self.output_polynomials is False else self.saturating or 0

    @property
    def channels(self) -> dict[str, Any]:
        """Inputs and outputs in the form that `rig.measurements.experiments.experiments` takes."""
        outputs = None if self.outputs is None else [name.strip() for name in self.outputs.split(",") if name.strip()]
        return {"inputs": (self.input or "force",), "outputs": outputs}

    def given(self) -> dict[str, bool]:
        """Return which options were given."""
        return {field.name: getattr(self, field.name) not in (None, ()) for field in fields(self)}
