"""Exciters: identification, and simulation of models that an exciter drives."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.exciter_coupling.exciter import PARAMETERS as PARAMETERS
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
