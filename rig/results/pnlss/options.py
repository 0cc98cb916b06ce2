"""Options for the identification of a nonlinear state-space model."""

from dataclasses import dataclass
from pathlib import Path

from rig.errors import ConfigurationError
from rig.results.simulated.options import Options


@dataclass(frozen=True, kw_only=True)
class PnlssOptions(Options):
    """Options of ``rig identify --model pnlss``. None selects the default.

    Raises `ConfigurationError` for values that are not allowed.
    """

    states: int | None = None
    """Number of states, two per mode of vibration; 2 if None."""
    degrees: str | None = None
    """Degrees of the monomials, separated by commas; empty: none. Default: ``2,3``, or none if there are saturating features.
    """
    output_polynomials: bool | None = None
    """Whether monomials also act on the outputs; yes if None."""
    saturating: int | None = None
    """Number of saturating features. They replace the monomials unless degrees are given; none if None."""
    function: str | None = None
    """Function of the saturating features: ``tanh``, ``square``, ``cube``, or ``module:name`` of the user; tanh if None."""
    trust_code: bool | None = None
    """Whether to import the function of the user, or those that the model to be continued names."""
    constant_input: bool | None = None
    """Whether the model has a constant input of 1 beside the others, whose effect compensates offsets; no if None."""
    iterations: int | None = None
    """Largest number of iterations of the fit; 1000 if None."""
    resume: Path | None = None
    """File of an earlier fit to the same data, which is continued."""

    def __post_init__(self) -> None:
        for name, value, least in (
            ("states", self.states, 1),
            ("saturating", self.saturating, 0),
            ("iterations", self.iterations, 0),
        ):
            if value is not None and value < least:
                raise ConfigurationError(f"`{name}` = {value}: allowed is {least} and above")
        self.chosen_degrees  # noqa: B018 refused here, not when it is asked for
        if self.function is None:
            return
        from identification.models import FUNCTIONS, is_users

        if not self.saturating:
            raise ConfigurationError(f"`function` = {self.function}: is of features; add `saturating`, their number")
        if self.function not in FUNCTIONS and not is_users(self.function):
            raise ConfigurationError(
                f"`function` = {self.function}: allowed are {', '.join(FUNCTIONS)}, or module:name of your own"
            )
        if is_users(self.function) and not self.trust_code:
            raise ConfigurationError(
                f"`function` = {self.function}: is code, and is not imported unless you trust it: `trust_code`"
            )

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
