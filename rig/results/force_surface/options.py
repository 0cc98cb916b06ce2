"""Options for the identification of a force surface: none."""

from typing import ClassVar

from rig.results.options import Options


class ForceSurfaceOptions(Options):
    """Options of ``rig identify force-surface``."""

    kind: ClassVar[str] = "force-surface"
