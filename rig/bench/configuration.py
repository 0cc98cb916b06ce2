"""Reading and validation of benches and plans from TOML files; faults are reported in one line."""

import json
import tomllib
from collections.abc import Mapping
from difflib import SequenceMatcher, get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from rig.bench.vetting import refuse_absurd
from rig.errors import ConfigurationError
from rig.system.text_files import read_text
from vibrolock.described import Described
from vibrolock.quantities import number_in
from vibrolock.units import unit_of

Table = dict[str, object]
"""A table of a TOML file, before a model has validated it."""

LARGEST_TOML_BYTES = 1_000_000
"""Largest TOML file that is read, bytes; chosen: a thousand times that of the shipped ones."""
MOST_DOTS = 100
"""Most dots between two commas of a line; chosen: the parser's time grows with the square of the number of a key's parts."""
MOST_FAULTS = 5
"""Most faults in one message; chosen."""
AS_CLOSE = 0.05
"""Difference of two likenesses (0 to 1) up to which two words count as equally close; chosen."""
FEW_NAMES = 10
"""Most names that a message lists; chosen."""


if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


class Configured(Described):
    """Base of every part of a bench or plan: frozen, unknown keys and non-finite numbers refused.

    The docstring under a field describes it in the JSON schema (`rig.authoring.schemas`).
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


def merged(base: Mapping[str, object], changes: Mapping[str, object]) -> Table:
    """Return ``base`` with ``changes``: tables are merged key by key, any other value is replaced."""
    out = dict(base)
    for key, value in changes.items():
        old = base.get(key)
        out[key] = merged(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return out


def shipped_names(folder: Path) -> list[str]:
    """Return the names of the TOML files below a folder, without the suffix."""
    return sorted(path.relative_to(folder).with_suffix("").as_posix() for path in folder.rglob("*.toml"))


def shipped_descriptions(folder: Path) -> dict[str, str]:
    """Return the descriptions in the TOML files below a folder, by name. Nothing else of the files is validated."""
    names = shipped_names(folder)
    return {name: str(read_toml(folder / f"{name}.toml").get("description", "")) for name in names}


def find_toml(name_or_path: str | Path, folder: Path, what: str) -> Path:
    """Return the path of a shipped file in ``folder`` by its name, or the given path if it ends in .toml."""
    path = Path(name_or_path)
    if path.suffix == ".toml":
        return path
    names = shipped_names(folder)
    if str(name_or_path) not in names:
        allowed = ", ".join(names)
        if len(names) > FEW_NAMES:
            nearest = get_close_matches(str(name_or_path)[:100], names, n=3, cutoff=0.0)
            allowed = f"one of those that `rig list` shows, such as {', '.join(nearest)},"
        raise ConfigurationError(
            f"there is no such {what}", field=what, value=str(name_or_path), allowed=f"{allowed} or a .toml file"
        )
    return folder / f"{name_or_path}.toml"


Model = TypeVar("Model", bound=BaseModel)


def read_toml(path: Path) -> Table:
    """Return the table in a TOML file of up to 1 MB.

    Raises `ConfigurationError`, naming the file and the line or key, if the file cannot be read or holds a value that is never
    allowed (`rig.bench.vetting`).
    """
    text = read_text(path, LARGEST_TOML_BYTES)
    for number, line in enumerate(text.split("\n"), 1):
        if line.count(".") > MOST_DOTS and any(part.count(".") > MOST_DOTS for part in line.split(",")):
            raise ConfigurationError(
                f"line {number}: a key has too many parts", where=path, allowed=f"up to {MOST_DOTS}"
            )
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise ConfigurationError(f"{path}: is nested too deeply for a TOML file of ours") from None
    except ValueError as error:  # also a number of more digits than Python reads
        raise ConfigurationError(f"{path}: is not TOML: {error}") from None
    refuse_absurd(table, str(path))
    return table


def validated(model: type[Model], table: Mapping[str, object], source: str) -> Model:
    """Build a model from a table; raise `ConfigurationError` naming path, value and allowed values of each fault."""
    refuse_absurd(table, source)
    try:
        if model.model_config.get("strict"):
            return model.model_validate(table)
        # Via JSON, whose strict mode accepts a list as a tuple and 1 as 1.0, but no text or boolean as a number.
        return model.model_validate_json(json.dumps(table, default=str), strict=True)
    except ValidationError as error:
        raise invalid(error, model, where=source) from None
    except (ArithmeticError, MemoryError) as error:
        why = f"{type(error).__name__}: {error}"
        raise ConfigurationError(f"cannot be used: a number is far too large or small ({why})", where=source) from None


def invalid(error: ValidationError, model: type[BaseModel], where: str = "") -> ConfigurationError:
    """Return the faults of a validation error, the first with its parts; if there are many, only the first few."""
    count = error.error_count()
    details = error.errors(include_url=False)[: 4 * MOST_FAULTS]
    keys = _keys(model)
    faults = [_fault(detail, keys) for detail in details if not _is_consequence(detail, details)][:MOST_FAULTS]
    more = [f"and {count - len(faults)} more"] if count > len(details) or len(faults) == MOST_FAULTS < count else []
    return ConfigurationError.of(faults[0], where=where, further=(*faults[1:], *more))


def _is_consequence(detail: "ErrorDetails", details: "list[ErrorDetails]") -> bool:
    """Return whether the fault only says that a list is too short because its items are faulty."""
    inside = (other for other in details if other["loc"][: len(detail["loc"])] == detail["loc"] and other is not detail)
    return detail["type"] == "too_short" and any(inside)


def _closest(key: str, keys: set[str]) -> list[str]:
    """Return the key that is meant, or all that are as close: ``levels_mN`` may be ``levels_m`` as well as ``levels_n``."""
    found = get_close_matches(key.lower(), sorted(keys), n=5)
    likeness = [SequenceMatcher(None, one, key.lower()).ratio() for one in found]
    return sorted(one for one, like in zip(found, likeness, strict=True) if like >= max(likeness) - AS_CLOSE)


def _fault(detail: "ErrorDetails", keys: set[str]) -> ConfigurationError:
    field = ""
    for part in detail["loc"]:
        if isinstance(part, int):
            field += f"[{part}]"
        elif part in keys or (part == detail["loc"][-1] and detail["type"] != "value_error"):
            # Otherwise it is the discriminator of a union, which is not part of the path.
            field += f".{part}" if field else str(part)
    kind, context = detail["type"], detail.get("ctx", {})
    if kind == "extra_forbidden":
        close = " or ".join(_closest(str(detail["loc"][-1])[:100], keys))
        return ConfigurationError(f"unknown key{close and f', did you mean {close}?'}", field=field)
    if kind == "missing":
        return ConfigurationError("is missing", field=field)
    if kind == "value_error":
        return ConfigurationError.of(context["error"], within=field)
    if kind.startswith("union_tag"):
        field, tag = f"{field}.{context['discriminator'].strip(chr(39))}", context.get("tag")
        if tag is None:
            return ConfigurationError("is missing", field=field)
        return ConfigurationError(field=field, value=tag, allowed=context.get("expected_tags", "one of those listed"))
    allowed = detail["msg"].removeprefix("Input should be ").replace("a valid tuple", "a list")
    if kind in ("too_short", "too_long"):
        bound, length = ("least", "min_length") if kind == "too_short" else ("most", "max_length")
        allowed = f"at {bound} {context[length]} of them"
    given = detail["input"]
    if kind in ("float_type", "float_parsing") and (unit := unit_of(field)):
        meant = number_in(given, unit) if isinstance(given, str) else None
        allowed = f"a number in {unit}" + ("" if meant is None else f": {meant:.6g}")
    return ConfigurationError("is None" if given is None else "", field=field, value=given, allowed=allowed)


def _keys(model: object) -> set[str]:
    if isinstance(model, type) and issubclass(model, BaseModel):
        fields = model.model_fields
        return set(fields).union(*(_keys(field.annotation) for field in fields.values()))
    return set().union(*(_keys(inner) for inner in get_args(model)))
