"""Names of the pages that explain messages."""

import re
from collections.abc import Iterable


def page_of(name: str) -> str:
    """Return the page of an end reason, quality or error: ``lost-lock`` of ``LOST_LOCK``, ``daq-timeout`` of ``DaqTimeout``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", name).replace("_", "-").lower()


def where_explained(names: Iterable[str]) -> str:
    """Return ``explained by: rig docs force-limit, rig docs not-settled`` for these names; empty without names."""
    pages = dict.fromkeys(map(page_of, names))
    return "explained by: " + ", ".join(f"rig docs {page}" for page in pages) if pages else ""
