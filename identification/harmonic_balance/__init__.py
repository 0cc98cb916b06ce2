"""Steady vibrations of any model by harmonic balance and continuation."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.harmonic_balance.setting_up import Held as Held
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
