"""Errors that carry their parts: what was given where, what is allowed, and what to do."""

from collections.abc import Collection, Iterable, Sequence
from typing import Any, Self

from vibrolock.printable import one_line, shown


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
        Unit of ``value``.
    allowed
        Allowed values: a text, or the names of which one is allowed.
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
        allowed: str | Iterable[object] = "",
        hint: str = "",
        further: Sequence["StatedError | str"] = (),
    ) -> None:
        self.reason = " ".join(map(str, reason))
        self.where = str(where).removesuffix(": ")
        self.field, self.unit, self.hint, self.further = field, unit, hint, tuple(further)
        self.value = value.tolist() if hasattr(value, "tolist") else value
        self.allowed = allowed if isinstance(allowed, str) else ", ".join(map(str, allowed))
        super().__init__(self.line(f"`{field}`"))

    def line(self, field: str) -> str:
        """Return the line of the error, with another name in place of its ``field``."""
        value = "" if self.value is None else f"= {_number_or_shown(self.value)}{self.unit and ' '}{self.unit}"
        subject = ": ".join(filter(None, (self.where, f"{field} {value}".strip() if self.field else value)))
        allowed = self.allowed and f"allowed: {self.allowed}"
        told = "; ".join(filter(None, (self.reason, allowed, self.hint)))
        joint = ": " if self.reason or self.value is None else "; "
        return one_line("; ".join(map(str, (joint.join(filter(None, (subject, told))), *self.further))))

    @classmethod
    def of(
        cls, error: Exception, *, where: object = "", within: str = "", further: Sequence["StatedError | str"] = ()
    ) -> Self:
        """Return another error as one of this class: its parts, ``where`` it occurred, ``within`` which field, and ``further``.

        An error without parts gives its text as the reason.
        """
        if not isinstance(error, StatedError):
            return cls(error, where=where, field=within, further=further)
        return cls(
            error.reason,
            where=": ".join(filter(None, (str(where), error.where))),
            field=".".join(filter(None, (within, error.field))),
            value=error.value,
            unit=error.unit,
            allowed=error.allowed,
            hint=error.hint,
            further=(*error.further, *further),
        )

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


class InvalidValueError(StatedError, ValueError):
    """An argument or a setting has a value that is not allowed."""


def at_least(low: float, unit: str = "") -> str:
    """Return the allowed range of a value from ``low`` on."""
    return f"{f'{low:g} {unit}'.strip()} and above"


def _number_or_shown(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else shown(value)
