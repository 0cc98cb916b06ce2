"""Small vibrations of a structured model about rest, where all sliders stick and springs have their slope at rest."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError

if TYPE_CHECKING:
    from identification.structured.model import StructuredModel

__all__ = ["linearised", "matrices_at_rest"]

Float = NDArray[np.float64]


def matrices_at_rest(model: "StructuredModel") -> tuple[Float, Float]:
    """float[n_modes, n_modes] each: stiffness (1/s^2) and damping (1/s) at rest in modal coordinates, without the support."""
    system = model.system
    tables, phi = system.tables, system.phi
    middle, cells = tables.dampers.shape[1] // 2, tables.dampers.shape[1] - 1
    slope = tables.springs[:, 1, middle] * cells / (2.0 * tables.limits[:, 0])
    stuck = np.array([np.sum(tables.sliders[a:b, 0]) for a, b in zip(tables.first, tables.first[1:], strict=False)])
    stiffness = np.diag(model.omega**2) + (phi.T * (slope + stuck)) @ phi
    damping = np.diag(2.0 * model.damping_ratio * model.omega) + (phi.T * tables.dampers[:, middle]) @ phi
    return stiffness, damping


def linearised(model: "StructuredModel") -> "StructuredModel":
    """Return what `StructuredModel.linearised` describes."""
    if not model.elements:
        return model
    stiffness, damping = matrices_at_rest(model)
    shapes = np.linalg.eigh(stiffness)[1]
    n = len(stiffness)
    first = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    poles = np.linalg.eigvals(first)
    poles = poles[poles.imag > 0.0]
    if len(poles) < n or np.any(poles.real >= 0.0):
        raise IdentificationError("elements: at rest a mode does not oscillate and fade; there are no small vibrations")
    poles = poles[np.argsort(np.abs(poles))]
    return replace(
        model,
        frequency_hz=np.abs(poles) / (2.0 * np.pi),
        damping_ratio=-poles.real / np.abs(poles),
        input_shapes=shapes.T @ model.input_shapes,
        output_shapes=model.output_shapes @ shapes,
        elements=(),
    )
