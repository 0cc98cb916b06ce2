"""Errors that carry their parts: what was given where, what is allowed, and what to do."""

from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any, Self

from vibrolock.printable import one_line, shown
from vibrolock.units import unit_of


class StatedError(Exception):
    """Base of the errors that are reported to the user, as one printable line made from their parts.

    The line is ``where: `field` = value unit: reason; allowed: range; hint``, without the parts that are not given.
    It is shortened in the middle if a file or a device contributed a long text.

    Parameters
    ----------
    reason
        What is wrong; several objects are joined by spaces.
    where
        File, channel or item to which the field belongs.
    field
        Name of the argument, or path of the key, that is at fault.
    value
        What was given; None if nothing was.
    unit
        Unit of ``value``; by default the one in which the name of the field ends.
    allowed
        Allowed values: a text, or those of which one is allowed.
    hint
        What to do about it.
    further
        Faults beside this one, which follow in the line.
    """

    def __init__(
        self,
        *reason: object,
        where: object = "",
        field: str = "",
        value: Any = None,
        unit: str = "",
        allowed: object = "",
        hint: str = "",
        further: Sequence["StatedError | str"] = (),
    ) -> None:
        self.reason = " ".join(map(str, reason))
        self.where = str(where).removesuffix(": ")
        self.field, self.hint, self.further = field, hint, tuple(further)
        self.value = value.tolist() if hasattr(value, "tolist") else value
        self.unit = unit or (unit_of(field) if isinstance(self.value, int | float) else "")
        self.allowed = (
            ", ".join(map(str, allowed))
            if isinstance(allowed, Iterable) and not isinstance(allowed, str)
            else str(allowed)
        )
        super().__init__(self.line(lambda error: f"`{error.field}`"))

    def line(self, name: Callable[["StatedError"], str]) -> str:
        """Return the line of the error, with another name in place of the field of each fault."""
        value = "" if self.value is None else f"= {_number_or_shown(self.value)} {self.unit}".strip()
        subject = ": ".join(filter(None, (self.where, f"{name(self)} {value}".strip() if self.field else value)))
        allowed = self.allowed and f"allowed: {self.allowed}"
        told = "; ".join(filter(None, (self.reason, allowed, self.hint)))
        joint = ": " if self.reason or self.value is None else "; "
        others = (one.line(name) if isinstance(one, StatedError) else one for one in self.further)
        return one_line("; ".join((joint.join(filter(None, (subject, told))), *others)))

    @classmethod
    def of(
        cls, error: Exception, *, where: object = "", within: str = "", further: Sequence["StatedError | str"] = ()
    ) -> Self:
        """Return another error as one of this class: its parts, ``where`` it occurred, ``within`` which field, and ``further``.

        An error without parts gives its text as the reason.
        """
        if not isinstance(error, StatedError):
            return cls(error, where=where, field=within, further=further)
        of_a_field = bool(error.field) or not error.where
        return cls(
            error.reason,
            where=": ".join(filter(None, (str(where), "" if of_a_field else within, error.where))),
            field=".".join(filter(None, (within, error.field))) if of_a_field else "",
            value=error.value,
            unit=error.unit,
            allowed=error.allowed,
            hint=error.hint,
            further=(*error.further, *further),
        )

    @classmethod
    def raise_if(cls, wrong: object, *reason: object, **parts: Any) -> None:
        """Raise the error with these parts if something is ``wrong``."""
        if wrong:
            raise cls(*reason, **parts)

    @classmethod
    def unless_one_of(cls, field: str, value: object, names: Collection[object]) -> None:
        """Raise the error unless ``value`` is one of ``names``."""
        if value not in names:
            raise cls(field=field, value=value, allowed=names)

    @classmethod
    def unless_between(cls, field: str, value: float, low: float, high: float, unit: str = "") -> None:
        """Raise the error unless ``low <= value <= high``."""
        if not low <= value <= high:
            raise cls(field=field, value=value, unit=unit, allowed=f"{low:g} to {high:g} {unit}".strip())

    @classmethod
    def unless_at_least(cls, field: str, value: float, low: float, unit: str = "") -> None:
        """Raise the error unless ``value >= low``."""
        if not value >= low:
            raise cls(field=field, value=value, unit=unit, allowed=at_least(low, unit))

    @classmethod
    def unless_above(cls, field: str, value: float, low: float, unit: str = "") -> None:
        """Raise the error unless ``value > low``."""
        if not value > low:
            raise cls(field=field, value=value, unit=unit, allowed=f"above {low:g} {unit}".strip())


class InputError(StatedError, ValueError):
    """An argument or a setting has a value that is not allowed."""


def at_least(low: float, unit: str = "") -> str:
    """Return the allowed range of a value from ``low`` on."""
    return f"{f'{low:g} {unit}'.strip()} and above"


def _number_or_shown(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else shown(value)
