"""Elements and plants that are not physical, or that the integrator would not follow: named and refused."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from simulators.plant.assembly import LinearPlant
from simulators.sites.elements import Clearance, Element, Magnet

__all__ = ["check_elements", "check_plant", "check_step", "computable"]

LARGEST_STEP = 0.5
"""Integration step times angular frequency of the stiffest element on the structure's modes. A contact then lasts at
least six steps, and a hard bounce changes its energy by at most 8 % (1 % at 0.2, 0.3 % at 0.1)."""
GROWTH = 1e-6
"""Real part of a pole over the size of the largest one that still counts as rounding."""


@contextmanager
def computable(parts: str) -> Iterator[None]:
    """Turn what arithmetic cannot do, and numbers that are none, into a `ValueError` that names the parts they come from."""
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            yield
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        raise ValueError(
            f"{parts}: cannot be computed with these numbers ({type(error).__name__}: {error}); one of them is far too large "
            "or too small beside the others"
        ) from None


def check_elements(elements: Sequence[Element], plant: LinearPlant) -> None:
    """`ValueError` where an element's coordinate does not move, or a stop stands behind a magnet."""
    for i, element in enumerate(elements):
        if element.at == element.to:
            raise ValueError(f"elements[{i}].to = {element.to!r}: allowed is another point than at")
        if not np.any(plant.site_rows[i]):
            raise ValueError(f"elements[{i}].at = {element.at!r}: allowed is a point that moves")
        if isinstance(element, Clearance):
            for magnet in (other for other in elements if isinstance(other, Magnet)):
                if (magnet.at, magnet.to) == (element.at, element.to):
                    _check_stop(i, element, magnet)


def _check_stop(i: int, stop: Clearance, magnet: Magnet) -> None:
    gaps = {"gap_m": stop.gap_m}
    if stop.other_gap_m is not None and not magnet.one_sided:
        gaps["other_gap_m"] = stop.other_gap_m
    for name, gap_m in gaps.items():
        if gap_m >= magnet.gap_m:
            message = f"allowed is below {magnet.gap_m:g}, where the magnet at {magnet.at!r} touches"
            raise ValueError(f"elements[{i}].{name} = {gap_m:g}: {message}")


def check_plant(plant: LinearPlant) -> None:
    """`ValueError` where the linear plant does not return to rest."""
    stiffness = np.linalg.eigvalsh(plant.modal_stiffness)
    if stiffness[0] < -1e-9 * max(abs(stiffness)):
        message = "allowed is no more than the structure has there"
        raise ValueError(
            f"elements: their linear stiffness takes {-stiffness[0]:.6g} s^-2 too much from a mode, {message}"
        )
    poles = np.linalg.eigvals(plant.dynamics)
    fastest = poles[np.argmax(poles.real)]
    if fastest.real > GROWTH * np.max(np.abs(poles)):
        hz = abs(fastest) / (2.0 * np.pi)
        raise ValueError(
            f"the linear plant is unstable: a motion at {hz:.4g} Hz grows at {fastest.real:.4g} 1/s, allowed is none"
        )


def check_step(elements: Sequence[Element], plant: LinearPlant, rate_hz: float, substeps: int) -> None:
    """`ValueError` where the slope of an element is too steep for the integration step; says which step would do.

    Only the linear plant is integrated exactly. What an element adds is followed by a second-order predictor-corrector, whose
    step h must resolve ``w_e^2 = k_e sum_i row_i^2``, or ``c_e sum_i row_i^2`` for an element of velocity.
    """
    for i, element in enumerate(elements):
        mobility = float(plant.site_rows[i] @ plant.site_rows[i])
        of_velocity = element.moves_with == "velocity"
        rate = element.steepest_n_m * mobility
        rate = rate if of_velocity else math.sqrt(rate)
        if rate / (rate_hz * substeps) > LARGEST_STEP:
            needed = math.ceil(rate / (rate_hz * LARGEST_STEP))
            largest = LARGEST_STEP * rate_hz * substeps
            allowed = (largest if of_velocity else largest**2) / mobility
            raise ValueError(
                f"elements[{i}]: its slope of {element.steepest_n_m:.6g} {'N s/m' if of_velocity else 'N/m'} at "
                f"{element.at!r} is too steep for {substeps} integration steps per sample, "
                f"allowed is up to {allowed:.6g}, or converter.substeps of at least {needed}"
            )
