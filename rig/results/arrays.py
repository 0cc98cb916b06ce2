"""What files of results hold: arrays by name, and attributes."""

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[Any]]
"""Arrays of any type, by name."""
Attributes = Mapping[str, Any]
"""JSON values, by name."""
