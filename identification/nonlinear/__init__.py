"""Nonlinear modes: modal properties over the vibration level, from backbones and stepped sines."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.nonlinear.nonlinear_modes import QUANTITIES as QUANTITIES, STANDARD_ERRORS as STANDARD_ERRORS
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
