"""Free decays: modal frequency and damping over the amplitude, from one ring-down."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.decays.with_force import decay_with_force as decay_with_force
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
