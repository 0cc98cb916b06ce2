"""Options of an identification or a prediction: one declaration for Python, the command line and messages."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, Self, get_args, get_origin

from annotated_types import Ge, Gt
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    ValidationError,
    model_validator,
)
from pydantic.fields import FieldInfo

from rig.errors import ConfigurationError
from vibrolock.described import Described, attribute_docstrings


@dataclass(frozen=True)
class Option:
    """What the command line says of a field beside its type, default and docstring. Empty: it follows from these."""

    flag: str = ""
    """Its name, with the dashes."""
    metavar: str = ""
    """Stands for its value in the help."""
    default: str = ""
    """What is said of its default."""
    allowed: str = ""
    """What follows "allowed" in messages."""
    help: str = ""
    """Help of a flag that turns the field off."""
    is_output: bool = False
    """Whether it is a flag that stands for the path of the output."""


def _listed(value: object) -> object:
    return tuple(part.strip() for part in value.split(",") if part.strip()) if isinstance(value, str) else value


def _rising(band: tuple[float, float] | None) -> tuple[float, float] | None:
    if band is not None and not 0.0 <= band[0] < band[1]:
        raise ValueError("does not rise")
    return band


Listed = BeforeValidator(_listed)
"""Marks a tuple that may be given as one text with commas."""

Names = Annotated[tuple[str, ...], Listed, Option(metavar="LIST")]
"""Names, with commas."""


Near = Annotated[
    tuple[Annotated[float, Field(gt=0.0)], ...],
    Listed,
    Option(metavar="LIST", default="found", allowed="are frequencies above 0 Hz, with commas"),
]
"""Frequencies, Hz, with commas."""
BandHz = Annotated[
    tuple[float, float] | None,
    Option(flag="--band", metavar="LOW HIGH", allowed="is 0 <= LOW < HIGH, Hz"),
    AfterValidator(_rising),
]
"""Lowest and highest frequency, Hz."""


class Options(Described):
    """Base of the options of a kind. A field that is not given has its default.

    The docstring under a field is its help on the command line. Raises `ConfigurationError` for values that are not allowed.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    kind: ClassVar[str]
    """Word for the kind on the command line."""
    takes: ClassVar[str] = ""
    """What a message says of the kind before it lists its options; empty: that of an identification."""

    @model_validator(mode="wrap")
    @classmethod
    def _refuse(cls, values: object, validate: ModelWrapValidatorHandler[Self]) -> Self:
        """Validate the values; raise the first fault as a `ConfigurationError` of one line."""
        try:
            return validate(values)
        except ValidationError as error:
            name = str((error.errors()[0]["loc"] or ("",))[0])
            given = values.get(name) if isinstance(values, Mapping) else None
            raise ConfigurationError(cls._fault(name, given)) from None

    @classmethod
    def texts(cls) -> dict[str, str]:
        """Return the docstrings under the fields, by their names."""
        bases = reversed(cls.__mro__[: cls.__mro__.index(Options)])
        return {
            name: text
            for base in bases
            for name, text in attribute_docstrings(base.__module__).get(base.__qualname__, {}).items()
        }

    @classmethod
    def names(cls) -> list[str]:
        """Return the names of the fields that leave a choice, its own before those of its bases."""
        own = [name for name in cls.__annotations__ if name in cls.model_fields]
        known = dict.fromkeys([*own, *cls.model_fields])
        return [name for name in known if len(choices_of(cls.model_fields[name])) != 1]

    @classmethod
    def _fault(cls, name: str, value: object) -> str:
        if name not in cls.names():
            known = ", ".join(f"`{field}`" for field in cls.names()) or "no such option"
            return f"`{name}`: does not apply to {cls.takes or f'`kind` {cls.kind}, which takes'} {known}"
        return f"`{name}` = {_shown(value)}: allowed {allowed(cls.model_fields[name])}"


def _shown(value: object) -> str:
    if isinstance(value, tuple | list) and value and all(isinstance(one, float) for one in value):
        return " ".join(f"{one:g}" for one in value)
    return f"{value:g}" if isinstance(value, float) else repr(value)


def option_of(field: FieldInfo) -> Option:
    """Return what the command line says of a field."""
    return next((one for one in field.metadata if isinstance(one, Option)), Option())


def allowed(field: FieldInfo) -> str:
    """Return what a field allows, as it follows "allowed" in a message; empty if it is not restricted."""
    if told := option_of(field).allowed:
        return told
    choices = choices_of(field)
    if choices:
        return f"are {', '.join(choices)}"
    for bound in field.metadata:
        if isinstance(bound, Ge):
            return f"is {bound.ge:g} and above"
        if isinstance(bound, Gt):
            return f"is any number above {bound.gt:g}"
    return f"is a value of type {getattr(field.annotation, '__name__', field.annotation)}"


def choices_of(field: FieldInfo) -> tuple[str, ...]:
    """Return the texts that a field, or an item of it, may have; none if it may have any."""
    waiting = [field.annotation]
    while waiting:
        one = waiting.pop()
        if get_origin(one) is Literal:
            return tuple(map(str, get_args(one)))
        waiting += get_args(one)
    return ()
