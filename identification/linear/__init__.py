"""Linear modal analysis of frequency responses."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.linear.accelerance import Weighting as Weighting
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
