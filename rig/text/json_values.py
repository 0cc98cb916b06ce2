"""Types of JSON values, for what is read from and written to files, pages and other processes."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

JsonValue: TypeAlias = "bool | int | float | str | Sequence[JsonValue] | Mapping[str, JsonValue] | None"
"""A value that JSON can hold."""
JsonObject: TypeAlias = Mapping[str, "JsonValue"]
"""A JSON object."""
