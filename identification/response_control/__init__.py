"""Response-controlled tests: force over frequency and response level, and curves at constant force from it."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.response_control.levels import LevelFit as LevelFit
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
