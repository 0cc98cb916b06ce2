"""Models whose JSON schema describes each field by the docstring under it."""

import ast
import inspect
from functools import cache
from importlib import import_module
from itertools import pairwise
from typing import Any

from pydantic import BaseModel, GetJsonSchemaHandler, ValidationError, ValidatorFunctionWrapHandler, WrapValidator

from vibrolock.errors import InputError


class Described(BaseModel):
    """A model whose docstring under a field is the field's description in the JSON schema.

    The source is read when a schema is made. pydantic's ``use_attribute_docstrings`` reads it when the class is made, which is
    most of the time that importing a virtual rig takes.
    """

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Add the descriptions to what pydantic makes."""
        made = handler(core_schema)
        fields = handler.resolve_ref_schema(made).get("properties", {})
        for base in cls.__mro__[: cls.__mro__.index(BaseModel)]:
            for name, text in attribute_docstrings(base.__module__).get(base.__qualname__, {}).items():
                if name in fields:
                    fields[name].setdefault("description", text)
        return made


def one_fault(allowed: str) -> WrapValidator:
    """Let a field that is a number or a word have one fault that says what is allowed; a union has one of each kind."""

    def validated(value: object, validate: ValidatorFunctionWrapHandler) -> object:
        try:
            return validate(value)
        except ValidationError:
            raise InputError("is None" if value is None else "", value=value, allowed=allowed) from None

    return WrapValidator(validated)


@cache
def attribute_docstrings(module: str) -> dict[str, dict[str, str]]:
    """Return the docstrings under the names that each class of a module binds, by class and name; none without source."""
    try:
        tree = ast.parse(inspect.getsource(import_module(module)))
    except (ImportError, OSError, TypeError):
        return {}
    return {node.name: dict(_described(node.body)) for node in tree.body if isinstance(node, ast.ClassDef)}


def _described(body: list[ast.stmt]) -> list[tuple[str, str]]:
    found = []
    for pair in pairwise(body):
        match pair:
            case (
                ast.AnnAssign(target=ast.Name(id=name)) | ast.Assign(targets=[ast.Name(id=name)]),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                found.append((name, inspect.cleandoc(text)))
    return found
