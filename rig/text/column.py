"""`Column`: how a quantity of a point is headed and formatted in tables and progress lines."""

from typing import NamedTuple


class Column(NamedTuple):
    """A quantity of a point as it is shown in tables and progress lines."""

    key: str
    """Name of the field of the point or of one of its parts."""
    heading: str
    """Heading of the column."""
    unit: str = ""
    """Unit as it is shown."""
    pattern: str = ""
    """Format of the number."""
    scale: float = 1.0
    """Factor from the stored unit to the shown one."""
    plain: bool = False
    """Whether progress lines leave out the heading because the unit already identifies the quantity."""
    in_line: bool = True
    """Whether progress lines show the column, too."""
    optional: bool = False
    """Whether the column is shown only if there is a value."""
    counts_from: int = 0
    """Number that a stored 0 is shown as: 1 for numbers that people count from 1."""

    @property
    def title(self) -> str:
        """Heading with the unit."""
        return f"{self.heading} {self.unit}".rstrip()
