"""Options of the command line, made from the fields of `rig.results.options.Options`."""

import inspect
import re
from collections.abc import Iterable
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin

import typer

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

    from rig.results.options import Option, Options

_UNIT = re.compile(r"_(hz|s|n_m|ohm)$")
"""Unit at the end of a field, which the option does not have."""
_BOUNDS = ((">=", "ge"), (">", "gt"))
"""Signs of lower bounds, with their names at a field."""


def parameters_of(models: Iterable["type[Options]"]) -> list[inspect.Parameter]:
    """Return a parameter for each field of the models. A field that several have stands once."""
    found: dict[str, inspect.Parameter] = {}
    for model in models:
        texts = model.texts()
        for name in model.names():
            parameter = _parameter(name, model.model_fields[name], texts.get(name, ""))
            found.setdefault(parameter.name, parameter)
    return list(found.values())


def given_in(
    values: dict[str, Any], model: "type[Options] | None" = None, output: Path | None = None
) -> dict[str, Any]:
    """Return the fields that were given on the command line, from the values of all parameters made here."""
    from rig.results.options import option_of

    found: dict[str, Any] = {}
    for name, value in values.items():
        if value is None or value is False or value == []:
            continue
        if name.startswith("no_"):
            found[name.removeprefix("no_")] = False
        else:
            field = None if model is None else model.model_fields.get(name)
            found[name] = output if field is not None and option_of(field).is_output else value
    return found


def _parameter(name: str, field: "FieldInfo", text: str) -> inspect.Parameter:
    from rig.results.options import option_of

    option = option_of(field)
    kind = _type_of(field, option)
    flag = option.flag or f"--{_UNIT.sub('', name).replace('_', '-')}"
    if kind is bool and field.default is True:
        name, flag, text = f"no_{name}", f"--no-{flag[2:]}", option.help
    bounds = [f"{sign}{getattr(one, name):g}" for one in field.metadata for sign, name in _BOUNDS if hasattr(one, name)]
    shown = str(field.default) if field.default not in (None, (), False, True) else False
    default = typer.Option(
        False if kind is bool else None,
        flag,
        help=" ".join(text.split()) + (f" [x{bounds[0]}]" if bounds else ""),
        metavar=option.metavar or None,
        show_default=option.default or shown,
    )
    hint = bool if kind is bool else kind | None
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=hint)


def _type_of(field: "FieldInfo", option: "Option") -> Any:
    """Return the type that the command line reads for a field; `Options` does the rest."""
    from rig.results.options import Listed

    if option.is_output:
        return bool
    hint = next(one for one in (*get_args(field.annotation), field.annotation) if one is not NoneType)
    hint = field.annotation if get_origin(field.annotation) is tuple else hint
    if get_origin(hint) is Annotated:
        hint = get_args(hint)[0]
    if get_origin(hint) is Literal or isinstance(hint, str):
        return str
    if get_origin(hint) is not tuple:
        return hint
    inner = get_args(hint)
    inside = (mark for one in get_args(field.annotation) for mark in getattr(one, "__metadata__", ()))
    if Listed in (*field.metadata, *inside):
        return str
    if inner[-1] is not Ellipsis:
        return hint
    item = get_args(inner[0])[0] if get_origin(inner[0]) is Annotated else inner[0]
    return list.__class_getitem__(item)
