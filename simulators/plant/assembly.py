"""Assembly of the coupled plant (linear part, site coordinates, outputs), and checks that it is physical and integrable.

State ``x = [q, q', x_a, v_a, i]``: modal coordinates of the structure, armature, coil current; n = 2 n_mode + 3. Inputs:
the voltage u and the nonlinear site forces f. The linear stiffness of local elements belongs to the linear plant. As part of
the site force it would cause errors of 8 % of the force and 0.18 percentage points of damping at a step of 0.2 ms.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from simulators.exciter import Exciter, Stinger
from simulators.plant.sites import Place, element_places, exciter_places
from simulators.sensing.parts import MOST_SUBSTEPS, Converter
from simulators.sites.elements import Clearance, Element, Magnet
from simulators.sites.friction import FrictionSite
from simulators.structures.structure import Structure
from vibrolock.arrays import Float
from vibrolock.errors import InputError

LARGEST_STEP = 0.5
"""Largest product of the integration step and the angular frequency of the stiffest element on the structure's modes. A contact
then lasts at least six steps, and a hard bounce changes the energy by at most 6 % (1 % at 0.2, 0.3 % at 0.1)."""
GROWTH = 1e-6
"""Largest real part of a pole, relative to the modulus of the largest pole, that counts as rounding."""


@dataclass(frozen=True, eq=False)
class LinearPlant:
    """The coupled plant ``x' = A x + b_u u + B_f f`` with site coordinates ``C_s x``.

    The order of the sites is: elements, the exciter's own sites, joints.
    """

    dynamics: Float
    """A [n, n]."""
    voltage_column: Float
    """b_u [n]."""
    site_columns: Float
    """B_f [n, n_site]."""
    site_rows: Float
    """C_s [n_site, n]; of an element (m, m/s), of the exciter (m, m/s, A), of a joint."""
    n_local: int
    """Number of sites without memory, which come first: elements, then the exciter's own sites."""
    modal_stiffness: Float
    """Stiffness of the structure in modal coordinates [n_mode, n_mode], including the elements' linear stiffness (s^-2)."""
    modal_damping: Float
    """Damping ``2 zeta_i w_i`` [n_mode] (1/s)."""
    stinger_row: Float
    """Stinger force ``k_s (x_a - x_d) + c_s (v_a - v_d)`` as a row over the state [n] (N)."""
    drive_shape: Float
    """Mode shapes at the drive point [n_mode] (kg^-1/2)."""
    signs: Float
    """Sign [n_mode] that each given shape was multiplied with, so that the drive point moves forward in every mode."""

    @property
    def n_mode(self) -> int:
        """Number of modes of the structure."""
        return self.drive_shape.size

    def force_row(self) -> Float:
        """Return the row [n + 1 + n_site] that gives the stinger force (N) from ``[x, u, f]``."""
        return np.concatenate([self.stinger_row, np.zeros(1 + self.site_rows.shape[0])])

    def acceleration_row(self, shape: Float) -> Float:
        """Return the row that gives the acceleration (m/s^2) of a point with the given mode shapes from ``[x, u, f]``."""
        accelerations = slice(self.n_mode, 2 * self.n_mode)
        forces = shape @ self.site_columns[accelerations]
        return np.concatenate([shape @ self.dynamics[accelerations], [0.0], forces])

    def displacement_row(self, shape: Float) -> Float:
        """Return the row that gives the displacement (m) of a point with the given mode shapes from ``[x, u, f]``."""
        row = np.zeros(self.dynamics.shape[0] + 1 + self.site_rows.shape[0])
        row[: self.n_mode] = shape
        return row


def assemble(
    structure: Structure,
    elements: Sequence[Element],
    joints: Sequence[FrictionSite],
    exciter: Exciter,
    stinger: Stinger,
) -> LinearPlant:
    """Return the linear part of the coupled plant; the sign of every mode is chosen so that the drive point moves forward."""
    omega = structure.omega_rad_s
    signs = np.where(structure.shape(stinger.at) < 0.0, -1.0, 1.0)
    drive = signs * structure.shape(stinger.at)
    m = omega.size
    places = [*element_places(structure, elements, signs), *exciter_places(exciter, 2 * m + 3)]
    n_local = len(places)
    stiffness = np.diag(omega**2)
    for place in places:
        stiffness += place.stiffness_n_m * np.outer(place.row[:m], place.row[:m])
    for joint in joints:
        shape = signs * structure.shape(joint.at, joint.quantity)
        shape = shape / shape[0] if joint.relative_to_mode_1 else shape
        row, column = np.zeros((2, 2 * m + 3))
        row[:m] = column[m : 2 * m] = shape
        places.append(Place(row, column))
    damping = 2.0 * np.array(structure.damping_ratio) * omega
    voltage = np.zeros(2 * m + 3)
    voltage[-1] = exciter.amplifier_gain * (
        _corner(exciter) if exciter.amplifier == "current" else 1.0 / exciter.inductance_h
    )
    stinger_row = np.concatenate(
        [
            -stinger.stiffness_n_m * drive,
            -stinger.damping_n_s_m * drive,
            [stinger.stiffness_n_m, stinger.damping_n_s_m, 0.0],
        ]
    )
    return LinearPlant(
        dynamics=_dynamics(stiffness, damping, drive, exciter, stinger_row),
        voltage_column=voltage,
        site_columns=np.array([place.column for place in places]).reshape(-1, 2 * m + 3).T,
        site_rows=np.array([place.row for place in places]).reshape(-1, 2 * m + 3),
        n_local=n_local,
        modal_stiffness=stiffness,
        modal_damping=damping,
        stinger_row=stinger_row,
        drive_shape=drive,
        signs=signs,
    )


def _dynamics(stiffness: Float, damping: Float, drive: Float, exciter: Exciter, force: Float) -> Float:
    m = drive.size
    q, v = slice(0, m), slice(m, 2 * m)
    x_a, v_a, i = 2 * m, 2 * m + 1, 2 * m + 2
    dynamics = np.zeros((2 * m + 3, 2 * m + 3))
    dynamics[q, v] = np.eye(m)
    dynamics[v] = np.outer(drive, force)
    dynamics[v, q] -= stiffness
    dynamics[v, v] -= np.diag(damping)
    dynamics[x_a, v_a] = 1.0
    dynamics[v_a] = -force
    dynamics[v_a, x_a] -= exciter.suspension_stiffness_n_m
    dynamics[v_a, v_a] -= exciter.suspension_damping_n_s_m
    dynamics[v_a, i] += exciter.force_factor_n_a
    dynamics[v_a] /= exciter.armature_mass_kg
    if exciter.amplifier == "current":
        dynamics[i, i] = -_corner(exciter)
    else:
        dynamics[i, v_a] = -exciter.force_factor_n_a / exciter.inductance_h
        dynamics[i, i] = -exciter.resistance_ohm / exciter.inductance_h
    return dynamics


def _corner(exciter: Exciter) -> float:
    """Return the corner of a current amplifier's loop (rad/s)."""
    return 2.0 * np.pi * exciter.bandwidth_hz


@contextmanager
def computable(parts: str) -> Iterator[None]:
    """Turn arithmetic errors and non-finite numbers into a `ValueError` that names the parts they come from."""
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            yield
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        raise InputError(
            f"cannot be computed with these numbers ({type(error).__name__}: {error}); one of them is far "
            "too large or too small beside the others",
            field=parts,
        ) from None


def check_elements(elements: Sequence[Element], plant: LinearPlant) -> None:
    """Raise `ValueError` if an element's coordinate does not move or a stop lies beyond a magnet."""
    for i, element in enumerate(elements):
        if element.at == element.to:
            raise InputError(field=f"elements[{i}].to", value=element.to, allowed="another point than at")
        if not np.any(plant.site_rows[i]):
            raise InputError(field=f"elements[{i}].at", value=element.at, allowed="a point that moves")
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
            allowed = f"below {magnet.gap_m:g}, where the magnet at {magnet.at!r} touches"
            raise InputError(field=f"elements[{i}].{name}", value=gap_m, allowed=allowed)


def check_plant(plant: LinearPlant) -> None:
    """Raise `ValueError` if the linear plant does not return to rest."""
    stiffness = np.linalg.eigvalsh(plant.modal_stiffness)
    if stiffness[0] < -1e-9 * max(abs(stiffness)):
        taken = f"their linear stiffness takes {-stiffness[0]:.6g} s^-2 too much from a mode"
        raise InputError(taken, field="elements", allowed="no more than the structure has there")
    poles = np.linalg.eigvals(plant.dynamics)
    fastest = poles[np.argmax(poles.real)]
    if fastest.real > GROWTH * np.max(np.abs(poles)):
        hz = abs(fastest) / (2.0 * np.pi)
        raise ValueError(
            f"the linear plant is unstable: a motion at {hz:.4g} Hz grows at {fastest.real:.4g} 1/s, allowed is none"
        )


def steps_per_sample(elements: Sequence[Element], plant: LinearPlant, converter: Converter) -> int:
    """Return the integration steps per sample: those written, with ``"auto"`` the fewest that the elements allow.

    Raises `ValueError`, naming a sufficient step, if the slope of an element is too steep for those written.
    Only the linear plant is integrated exactly. The force of an element is integrated by a third-order predictor-corrector,
    whose step h must resolve ``w_e^2 = k_e sum_i row_i^2``, or the rate ``c_e sum_i row_i^2`` of an element of velocity.
    """
    mobilities = [float(row @ row) for row in plant.site_rows[: len(elements)]]
    needed = [
        math.ceil(_rate(element, mobility) / (converter.sample_rate_hz * LARGEST_STEP))
        for element, mobility in zip(elements, mobilities, strict=True)
    ]
    substeps = converter.substeps_from(max(needed, default=0))
    for i, element in enumerate(elements):
        if needed[i] > substeps:
            largest = LARGEST_STEP * converter.sample_rate_hz * substeps
            of_velocity = element.moves_with == "velocity"
            allowed = (largest if of_velocity else largest**2) / mobilities[i]
            finer = (
                f"converter.substeps of at least {needed[i]}" if needed[i] <= MOST_SUBSTEPS else "a higher sample rate"
            )
            raise InputError(
                f"its slope of {element.steepest_n_m:.6g} {('N s/m' if of_velocity else 'N/m')} at "
                f"{element.at!r} is too steep for {substeps} integration steps per sample",
                field=f"elements[{i}]",
                allowed=f"up to {allowed:.6g}, or {finer}",
            )
    return substeps


def _rate(element: Element, mobility: float) -> float:
    """Return the angular frequency (or rate, of an element of velocity) of an element on the structure's modes, 1/s."""
    slope = element.steepest_n_m * mobility
    return slope if element.moves_with == "velocity" else math.sqrt(slope)
