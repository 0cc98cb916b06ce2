"""Objects that are exchanged, converted to arrays and back."""

from typing import Any

from identification import IdentificationError
from rig.results.arrays import Arrays, Attributes
from rig.results.kinds import exchanges
from rig.text.contents import Contents


def taken_apart(value: object) -> Contents:
    """Convert an object to arrays and attributes; raise `IdentificationError` for a type that is not exchanged."""
    if isinstance(value, Contents):
        return value
    for known in exchanges():
        if isinstance(value, known.type):
            return known.apart(value)
    names = ", ".join(known.name for known in exchanges())
    raise IdentificationError(f"{type(value).__name__}: is not exchanged; what is: {names}")


def put_together(kind: str, arrays: Arrays, attributes: Attributes) -> Any:
    """Convert the output of `taken_apart` back; raise `IdentificationError` for an unknown kind or data that does not fit."""
    for known in exchanges():
        if known.name == kind:
            try:
                return known.together(arrays, attributes)
            except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
                raise IdentificationError(f"{kind}: does not fit together ({error})") from None
    raise IdentificationError(f"kind: is '{kind}', known are {', '.join(known.name for known in exchanges())}")
