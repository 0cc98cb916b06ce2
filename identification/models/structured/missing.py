"""Which force would explain what a model leaves of its training data, and where it would act."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from identification.experiments.experiment import Experiment
from identification.fitting.bounded_steps import qr_r
from identification.models.structured.laws import Law, Masing, PolynomialDamper, SplineSpring
from identification.models.structured.model import StructuredModel
from identification.models.structured.regression import law_force
from identification.models.structured.start import ModalMotion, periodic_of
from vibrolock.arrays import Complex, Float

FORCES: dict[str, Law] = {
    "spring": SplineSpring(),
    "damper": PolynomialDamper((0.0,) * 3),
    "joint": Masing.spaced(8),
}
"""Forces that are looked for: of the displacement, of displacement and velocity, and of the displacement and its past."""
_PAIRED = 6
"""Most outputs between any two of which forces are looked for: pairs of more take minutes. Chosen."""


@dataclass(frozen=True, kw_only=True)
class MissingForce:
    """A force that would explain a part of what a model leaves of its training data.

    Parameters
    ----------
    force
        Its kind, a name of `FORCES`. ``numbers`` stands for no further force, but other values of frequencies, damping ratios
        and the numbers in which the model's own laws are linear.
    place
        Where it acts: an output; two of them with a colon between for the displacement of the first relative to the second;
        ``mode 2`` for the coordinate of a mode. Empty for ``numbers``.
    share
        Part of the squared residual that it explains, of what other numbers leave; for ``numbers`` of all.
    """

    force: str
    place: str
    share: float


def missing_forces(
    model: StructuredModel, experiments: Sequence[Experiment], measured_modes: int
) -> tuple[MissingForce, ...]:
    """Return how much of the residual each kind of force at each place explains: ``numbers`` first, then the largest share.

    It is a restoring-force surface of the residual: what the measured motion leaves of the model's equations of motion, each
    mode weighted by its receptance, is fitted over the lines of all periodic experiments by linear least squares, as initial
    values of a further element are. A share near one says that such a force there does what the model lacks. Places that move
    alike in the data have like shares.

    Not seen are modes that the outputs do not tell apart, and places without a sensor but as they move a mode. Noise is no part
    of it: ask where noise does not explain the residual. With more than six outputs, forces between two of them are not looked
    for. Nothing is returned of a model whose run is not bounded. Raises `IdentificationError` if no experiment is periodic.

    Parameters
    ----------
    model
        The model.
    experiments
        Its training data.
    measured_modes
        Number of modes, from the lowest, that the outputs tell apart.
    """
    parts = [ModalMotion(model, one, measured_modes) for one in periodic_of(experiments)]
    left = _real(np.concatenate([np.ravel(part.weight * part.left) for part in parts])[:, None])
    if not np.isfinite(left).all():
        return ()
    own, least = _own(model, parts)
    without = _left_over(own, least, left)
    tried = []
    for place, direction in _places(model, measured_modes).items():
        scale_m = max(float(np.max(np.abs(direction @ part.q))) for part in parts)
        for force, law in FORCES.items():
            columns = _columns(parts, law, direction, scale_m)
            bounds = np.append(np.full(columns.shape[1], law.least_linear), least)
            share = 1.0 - (_left_over(np.column_stack([columns, own]), bounds, left) / without) ** 2
            tried.append(MissingForce(force=force, place=place, share=share))
    numbers = MissingForce(force="numbers", place="", share=1.0 - (without / float(np.linalg.norm(left))) ** 2)
    return (numbers, *sorted(tried, key=lambda one: -one.share))


def _places(model: StructuredModel, modes: int) -> dict[str, Float]:
    """Directions in the measured modes by their names."""
    names = [channel.name for channel in model.outputs]
    between = [*((name,) for name in names), *(combinations(names, 2) if len(names) <= _PAIRED else ())]
    found = {":".join(one): model.output_selector(one) @ model.output_shapes[:, :modes] for one in between}
    return found | {f"mode {index}": row for index, row in enumerate(np.eye(modes), 1)}


def _own(model: StructuredModel, parts: Sequence[ModalMotion]) -> tuple[Float, Float]:
    """Columns by changes of the model's own numbers, and the least values of these changes."""
    columns, least = [], []
    for element in model.elements:
        for law in (law for law in element.laws if law.linear):
            columns.append(_columns(parts, law, element.direction[: len(parts[0].q)], element.scale_m))
            least.append(law.least_linear - np.atleast_1d(np.asarray(getattr(law, law.linear), dtype=np.float64)))
    for index, mode in enumerate(np.eye(len(parts[0].q))):
        for motion in ("q", "rate"):
            found = [part.column(mode, getattr(part, motion)[index]) for part in parts]
            columns.append(_real(np.concatenate(found)[:, None]))
            least.append(np.array([-np.inf]))
    return np.column_stack(columns), np.concatenate(least)


def _columns(parts: Sequence[ModalMotion], law: Law, direction: Float, scale_m: float) -> Float:
    """Columns of the forces of a law along a direction, one for each of its linear numbers at 1."""
    forces = [
        [
            part.column(direction, law_force(one, direction @ part.q / scale_m, direction @ part.rate))
            for one in law.basis()
        ]
        for part in parts
    ]
    return _real(np.concatenate(forces, axis=1).T)


def _real(columns: Complex) -> Float:
    return np.concatenate([columns.real, columns.imag])


def _left_over(columns: Float, least: Float, right: Float) -> float:
    """Return the norm of what least squares with lower bounds leave of float[n, 1]."""
    from scipy.optimize import lsq_linear  # only on use: it takes long to load

    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    triangle = qr_r(np.column_stack([columns / size, right]))  # the same norms, in few rows
    a, b = triangle[:, :-1], triangle[:, -1]
    found = lsq_linear(a, b, bounds=(least * size, np.full(size.size, np.inf)), method="bvls").x
    return float(np.linalg.norm(a @ found - b))
