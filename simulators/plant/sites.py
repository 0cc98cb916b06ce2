"""Positions of the sites without memory in the plant, and their records for the kernels: elements, then the exciter's own."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulators.exciter import Exciter
from simulators.layout import SITE, SiteKind
from simulators.sites.elements import Clearance, Cubic, DampingTable, Element, ForceTable, Magnet
from simulators.sites.functions import loaded
from simulators.structures.structure import Structure
from vibrolock.arrays import Float


class Place(NamedTuple):
    """A site in the plant ``x' = A x + B f`` with ``x = [q, q', x_a, v_a, i]``."""

    row: Float
    """The site's coordinate as a row over the state [n]."""
    column: Float
    """Effect of the site's force on the rates of the state [n]."""
    stiffness_n_m: float = 0.0
    """Linear stiffness on the site's coordinate that is part of the linear plant."""


def element_places(structure: Structure, elements: Sequence[Element], signs: Float) -> list[Place]:
    """Return one place per element, then one per damping table for the deflection that its damping depends on.

    ``signs`` [n_mode] multiply the mode shapes.
    """
    dampers = [element for element in elements if isinstance(element, DampingTable)]
    return [
        *(_element_place(structure, element, signs, element.moves_with) for element in elements),
        *(_element_place(structure, element, signs, "deflection") for element in dampers),
    ]


def _element_place(structure: Structure, element: Element, signs: Float, moves_with: str) -> Place:
    shape = signs * structure.shape(element.at)
    if element.to is not None:
        shape = shape - signs * structure.shape(element.to)
    m = shape.size
    row, column = np.zeros((2, 2 * m + 3))
    first = m if moves_with == "velocity" else 0
    row[first : first + m] = shape
    column[m : 2 * m] = shape
    return Place(row, column, element.stiffness_n_m)


def exciter_places(exciter: Exciter, n: int) -> list[Place]:
    """Return the places of the exciter's own nonlinearities, one per record of `_exciter_records`; ``n``: number of states."""
    x_a, v_a, i = np.eye(n)[n - 3 :]
    force, emf = v_a / exciter.armature_mass_kg, -i / exciter.inductance_h
    places = [Place(x_a, force), Place(i, force), Place(v_a, emf)]
    return places[: len(_exciter_records(exciter))]


def _exciter_records(exciter: Exciter) -> list[dict[str, Any]]:
    """Return the records of the exciter's nonlinearities.

    They are the suspension on the armature and, if the force factor droops, the force on the armature and, for a voltage
    amplifier, the back-EMF in the coil.
    """
    suspension = {"kind": SiteKind.CUBIC, "strength": exciter.suspension_cubic_n_m3, "limit": exciter.droop_limit_m}
    if not exciter.droops:
        return [suspension] if exciter.suspension_cubic_n_m3 else []
    g = exciter.force_factor_n_a
    droop = {"kind": SiteKind.DROOP, "quadratic": g * exciter.droop_per_m, "strength": g * exciter.droop_per_m2}
    force, emf = droop | {"partner": 1}, droop | {"partner": 2}
    return [suspension, force] if exciter.amplifier == "current" else [suspension, force, emf]


def local_sites(elements: Sequence[Element], exciter: Exciter) -> NDArray[Any]:
    """Return the table for the kernels, one `simulators.layout.SITE` record per site."""
    records = [*_element_records(elements), *_exciter_records(exciter)]
    table = np.zeros(len(records), SITE)
    table["limit"] = np.inf
    for row, record in zip(table, records, strict=True):
        for name, value in record.items():
            row[name] = value
    return table


def _element_records(elements: Sequence[Element]) -> list[dict[str, Any]]:
    """Return the records of `element_places`; a deflection that a damping depends on has no force."""
    records = [_record(element) for element in elements]
    dampers = [place for place, element in enumerate(elements) if isinstance(element, DampingTable)]
    for count, place in enumerate(dampers):
        records[place]["partner"] = place - len(elements) - count
    return [*records, *({"kind": SiteKind.CUBIC} for _ in dampers)]


def _record(element: Element) -> dict[str, Any]:
    if isinstance(element, Magnet):
        return {
            "kind": SiteKind.MAGNET_ONE_SIDED if element.one_sided else SiteKind.MAGNET_SYMMETRIC,
            "limit": element.limit_m,
            "stiffness": element.stiffness_n_m,
            "strength": element.strength_n_m4,
            "gap": element.gap_m,
            "offset": element.strength_n_m4 / element.gap_m**4 if element.one_sided else 0.0,
        }
    if isinstance(element, Cubic):
        return {"kind": SiteKind.CUBIC, "strength": element.stiffness_n_m3, "quadratic": element.quadratic_n_m2}
    if isinstance(element, Clearance):
        return {
            "kind": SiteKind.CLEARANCE,
            "strength": element.contact_stiffness_n_m,
            "gap": element.gap_m,
            "other_gap": np.inf if element.other_gap_m is None else element.other_gap_m,
        }
    if isinstance(element, ForceTable):
        below, above = element.ends_n_m
        return {
            "kind": SiteKind.FORCE_TABLE,
            "limit": element.limit_m,
            "stiffness": element.stiffness_n_m,
            "gap": element.deflection_m[0],
            "other_gap": element.deflection_m[-1],
            "quadratic": below,
            "strength": above,
            "table": element.table,
        }
    if isinstance(element, DampingTable):
        return {
            "kind": SiteKind.DAMPING_TABLE,
            "gap": element.deflection_m[0],
            "other_gap": element.deflection_m[-1],
            "table": element.table,
        }
    return {
        "kind": SiteKind.USER,
        "stiffness": element.stiffness_n_m,
        "address": loaded(element.function).address,
        "parameters": element.padded_parameters,
    }
