"""Multisines: their design and the spectra of their recordings."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.multisine.estimators import Estimator as Estimator
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
