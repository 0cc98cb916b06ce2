"""Statistics over draws: proportions with their intervals, and quantiles."""

from collections.abc import Iterable

import numpy as np
import scipy
from pydantic import BaseModel, ConfigDict, Field, JsonValue, SerializerFunctionWrapHandler, model_serializer


class Statistic(BaseModel):
    """Base of all parts of a verdict; JSON has the names of its fields or their aliases."""

    model_config = ConfigDict(frozen=True, populate_by_name=True)


class Proportion(Statistic):
    """Probability estimated from a number of draws, with its 95 % interval (Wilson's score interval)."""

    count: int
    """Number of draws in which it happened."""
    of: int
    """Number of draws."""

    @property
    def value(self) -> float:
        """The estimate; NaN without draws."""
        return self.count / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end."""
        if not self.of:
            return 0.0, 1.0
        found = scipy.stats.binomtest(self.count, self.of).proportion_ci(0.95, method="wilson")
        return float(found.low), float(found.high)

    @model_serializer(mode="wrap")
    def _with_interval(self, fields: SerializerFunctionWrapHandler) -> dict[str, JsonValue]:
        low, high = self.interval
        return {**fields(self), "value": self.value, "low": low, "high": high}


class Quantiles(Statistic):
    """Quantiles of a quantity over the draws: 5 %, 50 % and 95 %, and the largest; NaN if no draw has one."""

    low: float = Field(float("nan"), alias="5 %")
    middle: float = Field(float("nan"), alias="50 %")
    high: float = Field(float("nan"), alias="95 %")
    largest: float = float("nan")
    n: int = 0

    @classmethod
    def of(cls, values: Iterable[float]) -> "Quantiles":
        """Return the quantiles of the finite values."""
        finite = np.array([v for v in values if np.isfinite(v)])
        if not finite.size:
            return cls()
        low, middle, high = np.quantile(finite, [0.05, 0.5, 0.95]).tolist()
        return cls(low=low, middle=middle, high=high, largest=float(finite.max()), n=finite.size)
