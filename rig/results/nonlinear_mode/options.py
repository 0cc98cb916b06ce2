"""Options for the identification of a nonlinear mode."""

from pathlib import Path
from typing import ClassVar

from rig.results.options import Near, Options


class NonlinearModeOptions(Options):
    """Options of ``rig identify nonlinear-mode``."""

    kind: ClassVar[str] = "nonlinear-mode"

    modes: Path | None = None
    """Linear model whose mode shapes are used."""
    near: Near = ()
    """Frequency of the mode to take from decays that hold several, Hz."""
