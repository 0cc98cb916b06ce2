"""Request for an identification. Options that do not fit together are refused."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import get_args

from identification.linear import Weighting
from rig.errors import ConfigurationError
from rig.measurements import Estimator
from rig.results.decay_backbone.options import DecayOptions
from rig.results.pnlss.options import PnlssOptions
from rig.results.simulated.options import DataOptions
from rig.results.structured.options import MODES_OF_A_STRUCTURE, StructuredOptions

_OPTIONS: dict[str, tuple[str, ...]] = {
    "nonlinear-mode": ("modes", "near"),
    "linear": ("estimator", "band_hz", "count", "near", "order", "weighting"),
    "decay": ("near", *DecayOptions().given()),
    "force-surface": (),
    "exciter": ("band_hz", "resistance_ohm", "amplifier_gain", "stinger_stiffness_n_m"),
    "pnlss": (*PnlssOptions().given(), *DataOptions().given()),
    "structured": ("modes", *StructuredOptions().given(), *(name for name in DataOptions().given() if name != "input")),
}
_OF_THE_FIT = ("states", "degrees", "output_polynomials", "saturating", "rate_hz", "input", "outputs")
"""Options that a fit which goes on has already."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """What to identify, and how."""

    kind: str = "nonlinear-mode"
    """``nonlinear-mode``, ``decay``, ``linear``, ``force-surface``, ``exciter``, ``pnlss`` or ``structured``."""
    modes: Path | None = None
    """Linear model whose mode shapes are used for a nonlinear mode, or with which a structured model begins."""
    estimator: str = "instrument"
    """Estimator of the responses for a linear model: ``instrument``, ``H1`` or ``H2``."""
    band_hz: tuple[float, float] | None = None
    """Band of the lines to which a linear or exciter model is fitted, Hz."""
    resistance_ohm: float | None = None
    """Resistance of an exciter's coil, cable and amplifier together, if it was measured with a meter, ohm."""
    amplifier_gain: float | None = None
    """Gain of the exciter's voltage amplifier (V/V), needed with the resistance; 1 if None."""
    stinger_stiffness_n_m: float | None = None
    """Stiffness of the exciter's stinger, if known, N/m."""
    count: int | None = None
    """Number of modes of a linear model; determined automatically if None."""
    near: str | None = None
    """Frequencies near which the modes of a linear model or of a decay are, Hz, with commas; found if None. Of a nonlinear mode
    from decays: which of their modes."""
    order: int | None = None
    """Highest order of the stabilisation diagram of a linear model; by default 40, or less for few lines."""
    weighting: str = "auto"
    """What weights the lines of a linear model: ``auto``, ``total``, ``noise`` or ``relative``."""
    pnlss: PnlssOptions = field(default_factory=PnlssOptions)
    """Options for a nonlinear state-space model."""
    structured: StructuredOptions = field(default_factory=StructuredOptions)
    """Options for a structured model."""
    decay: DecayOptions = field(default_factory=DecayOptions)
    """Options for a free decay."""
    data: DataOptions = field(default_factory=DataOptions)
    """Data of a nonlinear state-space model or a structured model."""

    def __post_init__(self) -> None:
        if self.kind not in _OPTIONS:
            raise ConfigurationError(f"`kind` = {self.kind!r}: allowed are {', '.join(_OPTIONS)}")
        if self.estimator not in get_args(Estimator):
            raise ConfigurationError(f"`estimator` = {self.estimator!r}: allowed are {', '.join(get_args(Estimator))}")
        if self.band_hz is not None and not 0.0 <= self.band_hz[0] < self.band_hz[1]:
            raise ConfigurationError(
                f"`band_hz` = {self.band_hz[0]:g} {self.band_hz[1]:g}: allowed is 0 <= LOW < HIGH, Hz"
            )
        if self.weighting not in get_args(Weighting):
            raise ConfigurationError(f"`weighting` = {self.weighting!r}: allowed are {', '.join(get_args(Weighting))}")
        if self.near_hz and self.count is not None:
            raise ConfigurationError("`count`: is the number of frequencies in `near`; leave one of them out")
        if self.order is not None and self.order < 2:
            raise ConfigurationError(f"`order` = {self.order}: allowed is 2 and above")
        numbers = {
            "resistance_ohm": self.resistance_ohm,
            "amplifier_gain": self.amplifier_gain,
            "stinger_stiffness_n_m": self.stinger_stiffness_n_m,
        }
        for name, value in numbers.items():
            if value is not None and not 0.0 < value < math.inf:
                raise ConfigurationError(f"`{name}` = {value:g}: allowed is any number above 0")
        given = {
            "modes": self.modes is not None,
            "band_hz": self.band_hz is not None,
            "count": self.count is not None,
            "estimator": self.estimator != "instrument",
            "near": self.near is not None,
            "order": self.order is not None,
            "weighting": self.weighting != "auto",
            **{name: value is not None for name, value in numbers.items()},
            **self.pnlss.given(),
            **self.structured.given(),
            **self.decay.given(),
            **self.data.given(),
        }
        for name in (name for name, is_given in given.items() if is_given):
            if name not in _OPTIONS[self.kind]:
                allowed = ", ".join(f"`{field}`" for field in _OPTIONS[self.kind]) or "no such option"
                raise ConfigurationError(f"`{name}`: means nothing to `kind` {self.kind}, which takes {allowed}")
        if self.amplifier_gain is not None and self.resistance_ohm is None:
            raise ConfigurationError("`amplifier_gain`: is for the resistance; add `resistance_ohm`, or leave it out")
        if self.kind == "structured" and self.modes is None:
            raise ConfigurationError(f"`modes`: is missing, {MODES_OF_A_STRUCTURE}")
        for name in _OF_THE_FIT if self.pnlss.resume is not None else ():
            if given[name]:
                raise ConfigurationError(f"`{name}`: is that of the fit that goes on; leave it out")

    @property
    def near_hz(self) -> tuple[float, ...]:
        """Frequencies near which the modes are, Hz; raise `ConfigurationError` if they are no frequencies."""
        try:
            found = tuple(float(part) for part in self.near.split(",")) if self.near is not None else ()
        except ValueError:
            found = (math.nan,)
        if not all(0.0 < frequency < math.inf for frequency in found):
            raise ConfigurationError(f"`near` = {self.near!r}: allowed are frequencies above 0 Hz, with commas")
        return found
