"""Objects that are exchanged, converted to arrays and back."""

from typing import Any

from identification import IdentificationError
from identification.common import Arrays, Attributes
from rig.results.kinds import exchanges
from rig.text.contents import Contents


def encoded(value: object) -> Contents:
    """Convert an object to arrays and attributes; raise `IdentificationError` for a type that is not exchanged."""
    if isinstance(value, Contents):
        return value
    for known in exchanges():
        if isinstance(value, known.type):
            return known.apart(value)
    names = ", ".join(known.name for known in exchanges())
    raise IdentificationError("is not exchanged", field=type(value).__name__, hint=f"what is: {names}")


def decoded(kind: str, arrays: Arrays, attributes: Attributes) -> Any:
    """Convert the output of `encoded` back; raise `IdentificationError` for an unknown kind or data that does not fit."""
    for known in exchanges():
        if known.name == kind:
            try:
                return known.together(arrays, attributes)
            except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
                raise IdentificationError(f"does not fit together ({error})", field=kind) from None
    raise IdentificationError(field="kind", value=kind, allowed=[known.name for known in exchanges()])
