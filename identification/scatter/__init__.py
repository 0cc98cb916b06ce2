"""DerivativeTables from run to run as part of a model: its linear part shifts along its modes."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.scatter.own_model import OwnModel as OwnModel
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
