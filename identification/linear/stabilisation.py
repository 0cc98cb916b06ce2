"""Stabilisation diagram: poles of models of rising order; poles that recur from order to order belong to the structure."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.linear.accelerance import WeightedResponses, Weighting, first_weighting, weighted_accelerance
from identification.linear.errors_in_variables import driven_responses, is_driven, over_force
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.linear.subspace import observable_space, telling_rows
from identification.validation import read_only
from vibrolock.arrays import Bool, Complex, Float
from vibrolock.results import Result

_ORDERS = tuple(range(2, 41, 2))
"""Orders of the models in the diagram. Chosen."""
_LOWEST = 6
"""Orders up to this one are tried however narrow the band is."""
_LARGEST_DAMPING = 0.1
"""Largest damping ratio of a physical pole. Chosen."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StabilisationDiagram(Result):
    """Poles of all orders, one entry per pole, sorted by order and then by frequency.

    Parameters
    ----------
    order
        int[n], order of the model that has the pole.
    frequency_hz, damping_ratio
        float[n], ``|p| / 2 pi`` and ``-Re p / |p|``.
    shapes
        complex[n, n_outputs], shape of the pole as acceleration, of length one.
    frequency_stable, damping_stable, shape_stable
        bool[n], whether the order before has a pole that agrees in frequency; also in damping ratio; also in shape.
    physical
        bool[n], whether the pole oscillates within the band and its damping ratio is positive and small enough for a mode.
    orders
        int[n_orders], the orders tried.
    singular_values
        float[n_singular], singular values of the weighted data; a drop indicates the order.
    """

    order: NDArray[np.int64]
    frequency_hz: Float
    damping_ratio: Float
    shapes: Complex
    frequency_stable: Bool
    damping_stable: Bool
    shape_stable: Bool
    physical: Bool
    orders: NDArray[np.int64]
    singular_values: Float

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            array = getattr(self, name)
            object.__setattr__(self, name, read_only(array, array.dtype))

    @property
    def stable(self) -> Bool:
        """bool[n]: physical, and stable in frequency, damping and shape."""
        return np.asarray(self.physical & self.shape_stable)

    def columns(self, *, share: float = 0.5) -> NDArray[np.int64]:
        """int[n_modes]: index of one pole of every column of stable poles, lowest frequency first.

        Poles belong to one column if their frequencies differ by less than 1 % and their shapes have a MAC above 0.8. A
        column counts if it has stable poles in the given share of the orders above its first. Of each column the steadiest
        pole of the upper half of its orders is returned.
        """
        left = np.flatnonzero(self.stable)[::-1]  # highest order first
        found: list[int] = []
        while left.size:
            head = left[0]
            near = np.abs(self.frequency_hz[left] / self.frequency_hz[head] - 1.0) < 0.01
            alike = np.abs(self.shapes[left] @ np.conj(self.shapes[head])) ** 2 > 0.8
            column = left[near & alike]
            possible = np.count_nonzero(self.orders > self.order[column[-1]])
            if np.unique(self.order[column]).size >= max(2.0, share * possible):
                found.append(int(self._steadiest(column)))
            left = left[~(near & alike)]
        return np.array(sorted(found, key=lambda index: self.frequency_hz[index]), dtype=np.int64)

    def _steadiest(self, column: NDArray[np.int64]) -> np.int64:
        """Return the pole among the upper half of the column that is nearest to their median frequency and damping."""
        upper = column[: max(1, (column.size + 1) // 2)]
        distance = np.zeros(upper.size)
        for values in (self.frequency_hz[upper] / 0.01, self.damping_ratio[upper] * self.frequency_hz[upper] / 0.05):
            distance += np.abs(values - np.median(values))
        return np.int64(upper[int(np.argmin(distance))])


def stabilisation(
    responses: FrequencyResponseMatrix,
    orders: Sequence[int] | None = None,
    *,
    weighting: Weighting = "auto",
    frequency_tolerance: float = 0.01,
    damping_tolerance: float = 0.05,
    lowest_mac: float = 0.95,
) -> StabilisationDiagram:
    """Compute the continuous-time poles of subspace models of rising order.

    The bilinear map ``z = (1 + s/a) / (1 - s/a)`` spreads the band over the unit circle. Unlike sampling, it maps rational
    responses exactly to rational responses.

    Raises `IdentificationError` if orders are not above zero or too high for the number of lines.

    Parameters
    ----------
    responses
        One or several inputs and outputs, every output a motion; or force and motions over a voltage.
    orders
        Numbers of states; if None, 2 to 40 in steps of two, or fewer if there are few lines or the band is narrow.
    weighting
        As in `linear_modes`.
    frequency_tolerance, damping_tolerance
        Largest relative difference of a stable pole from a pole of the order before.
    lowest_mac
        Least modal assurance criterion between the shapes of these two poles.
    """
    weighting = first_weighting(responses, weighting)
    joint = driven_responses(responses, weighting) if is_driven(responses) else None
    plain = over_force(responses) if is_driven(responses) and joint is None else responses
    return diagram(
        joint.first_guess() if joint else weighted_accelerance(plain, weighting),
        orders,
        (frequency_tolerance, damping_tolerance, lowest_mac),
    )


def diagram(
    data: WeightedResponses, orders: Sequence[int] | None, tolerances: tuple[float, float, float] = (0.01, 0.05, 0.95)
) -> StabilisationDiagram:
    """Compute the `stabilisation` diagram of weighted accelerances."""
    lines, outputs, inputs = data.value.shape
    most = 2 * lines * inputs // (outputs + inputs) - 2
    on_axis = 2j * np.pi * data.frequency_hz  # an exponential window only moves the poles, to the left
    middle = float(np.sqrt(np.abs(on_axis[0]) * np.abs(on_axis[-1])))
    z = np.asarray((1.0 + on_axis / middle) / (1.0 - on_axis / middle))
    if orders is None:
        highest = min(most, max(telling_rows(z, _ORDERS[-1] + 2) - 2, _LOWEST))
        orders = [order for order in _ORDERS if order <= highest]
    tried = sorted(set(orders))
    if not tried or tried[0] < 1:
        reason = f"{tried or 'none'} for {lines} lines"
        raise IdentificationError(reason, field="orders", allowed=f"numbers from 1 to {most}")
    space = observable_space(data, z, max(tried) + 2)
    band_hz = (data.frequency_hz[0], data.frequency_hz[-1])
    parts: list[tuple[NDArray[np.generic], ...]] = []
    before: tuple[Float, Float, Complex] = (np.zeros(0), np.zeros(0), np.zeros((0, outputs), dtype=np.complex128))
    for order in tried:
        a, c = space.state_matrices(order)
        frequency, damping, shapes = now = _poles(a, c, middle, data.decay_rate_1_s)
        like = _alike(now, before, tolerances)
        physical = (damping > 0.0) & (damping < _LARGEST_DAMPING)
        physical &= (frequency >= band_hz[0]) & (frequency <= band_hz[1])
        parts.append((np.full(frequency.size, order), frequency, damping, shapes, *like, physical))
        before = now
    names = ("order", "frequency_hz", "damping_ratio", "shapes", "frequency_stable", "damping_stable", "shape_stable")
    arrays = dict(zip((*names, "physical"), (np.concatenate(part) for part in zip(*parts, strict=True)), strict=True))
    return StabilisationDiagram(**arrays, orders=np.array(tried), singular_values=space.singular_values)


def _poles(a: Float, c: Float, middle: float, decay_rate_1_s: float) -> tuple[Float, Float, Complex]:
    """Return frequencies (Hz), damping ratios and unit shapes of the oscillating poles, mapped back from the unit circle."""
    z, vectors = np.linalg.eig(a)
    with np.errstate(divide="ignore", invalid="ignore"):
        poles = middle * (z - 1.0) / (z + 1.0) + decay_rate_1_s
    kept = np.flatnonzero(np.isfinite(poles) & (poles.imag > 0.0))
    kept = kept[np.argsort(np.abs(poles[kept]))]
    shapes = (c @ vectors[:, kept]).T
    shapes = shapes / np.maximum(np.linalg.norm(shapes, axis=1, keepdims=True), 1e-300)
    return np.abs(poles[kept]) / (2.0 * np.pi), -poles[kept].real / np.abs(poles[kept]), shapes


def _alike(
    now: tuple[Float, Float, Complex], before: tuple[Float, Float, Complex], tolerances: tuple[float, float, float]
) -> tuple[Bool, Bool, Bool]:
    frequency = np.abs(now[0][:, None] - before[0]) <= tolerances[0] * now[0][:, None]
    damping = frequency & (np.abs(now[1][:, None] - before[1]) <= tolerances[1] * np.abs(now[1][:, None]))
    shape = damping & (np.abs(now[2] @ np.conj(before[2].T)) ** 2 >= tolerances[2])
    return np.any(frequency, axis=1), np.any(damping, axis=1), np.any(shape, axis=1)
