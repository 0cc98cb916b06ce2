"""What a nonlinear state-space model is to be identified from, and how."""

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from rig.errors import ConfigurationError

__all__ = ["PnlssOptions"]

_INPUTS = ("force", "voltage")


@dataclass(frozen=True, kw_only=True)
class PnlssOptions:
    """Options of ``rig identify --model pnlss``; None for what is usual.

    Raises `ConfigurationError` on values that are not allowed.
    """

    states: int | None = None
    """Number of states, two per mode of vibration; 2 if None."""
    degrees: str | None = None
    """Degrees of the monomials, with commas, none if empty; if None ``2,3``, and none beside saturating features."""
    rate_hz: float | None = None
    """Sample rate of the model."""
    input: str | None = None
    """``force`` or ``voltage``."""
    outputs: str | None = None
    """Names of the outputs, with commas; all motions if None, and the force where the voltage is the input."""
    output_polynomials: bool | None = None
    """Whether monomials act on the outputs too; yes if None."""
    saturating: int | None = None
    """Number of saturating features, in the place of the monomials unless degrees are given; none if None."""
    iterations: int | None = None
    """Most iterations of the fit; 100 if None."""
    validation: tuple[Path, ...] = ()
    """Recordings on which the iterate is chosen."""
    hold_out: int | None = None
    """Realisations of each level, the last ones, on which it is chosen instead, and from five settled points of a recording
    on every fourth of these; 1 if None, nothing with 0."""
    relative: bool | None = None
    """Whether errors of all experiments count relative to their own outputs; else as they are, which large levels rule."""
    resume: Path | None = None
    """A file of an earlier fit of the same data, that goes on."""

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
        self.chosen_degrees  # noqa: B018  refused here, not when it is asked for
        if self.validation and self.hold_out:
            raise ConfigurationError("`hold_out`: is instead of `validation`; leave one of the two out")
        if self.resume is not None:
            fixed = ("states", "degrees", "rate_hz", "output_polynomials", "saturating", "input", "outputs")
            for field in fields(self):
                if field.name in fixed and getattr(self, field.name) is not None:
                    raise ConfigurationError(f"`{field.name}`: is that of the fit that goes on; leave it out")

    @property
    def chosen_degrees(self) -> tuple[int, ...]:
        """The degrees as numbers; none for an empty text, or where saturating features take their place."""
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
        """Their number as `identification.identify_pnlss` takes it: linear outputs have none of these either."""
        return (self.saturating or 0, 0) if self.output_polynomials is False else self.saturating or 0

    @property
    def channels(self) -> dict[str, Any]:
        """Inputs and outputs as `rig.measurements.experiments.experiments` takes them."""
        outputs = None if self.outputs is None else [name.strip() for name in self.outputs.split(",") if name.strip()]
        return {"inputs": (self.input or "force",), "outputs": outputs}

    def given(self) -> dict[str, bool]:
        """Which fields were given."""
        return {field.name: getattr(self, field.name) not in (None, ()) for field in fields(self)}
