"""What models of any kind predict, and its comparison with measurements."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from identification.prediction.comparison import Over as Over
    from identification.prediction.steady_prediction import (
        FLAGGED_BEYOND as FLAGGED_BEYOND,
        band_of_responses as band_of_responses,
    )
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
