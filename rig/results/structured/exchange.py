"""Exchange of structured models: modes, shapes, and forces of the elements as numbers and as tables over displacement."""

from typing import Any

import numpy as np

from identification import StructuredModel
from identification.common import Arrays, Attributes, decode, encode
from identification.models import Damper, Joint, Spring, UserSpring
from rig.results.kind import Exchange
from rig.text.contents import Contents

_POINTS = 201
"""Displacements of the tables, from minus to plus the reach."""
_UNITS = {
    "frequency_hz": "Hz",
    "input_shapes": "kg^-0.5",
    "output_shapes": "kg^-0.5",
    "direct": "SI, by the channels",
    "directions": "kg^-0.5",
    "displacement_m": "m",
    "spring_n": "N",
    "damper_n_s_m": "N s/m",
    "slider_stiffness_n_m": "N/m",
    "slider_strength_n": "N",
    "slider_yield_n": "N",
    "slider_exponent": "",
    "slider_gamma": "",
    "fs": "Hz",
}
_SLIDERS = (
    "slider_element",
    "slider_stiffness_n_m",
    "slider_strength_n",
    "slider_yield_n",
    "slider_exponent",
    "slider_gamma",
)
"""Arrays of the sliders; the last three with other joints than those of Jenkins sliders only."""


def structured_parts(model: StructuredModel) -> Contents:
    """Convert a model to its modal matrices, and to tables of the elements' forces for readers.

    For each element, in rows: ``directions`` [element, mode], ``displacement_m``, ``spring_n``, ``damper_n_s_m`` [element,
    point]; ``spring_n`` is NaN with functions of the user, which are not imported. The sliders of all joints are in
    ``slider_element`` (from 1), ``slider_stiffness_n_m``, ``slider_strength_n``; with hystereses of Bouc and Wen
    or dry friction among them ``slider_yield_n``, ``slider_exponent`` and ``slider_gamma``, zeros for sliders of Jenkins, and
    an exponent of -1 for dry friction. The laws themselves, from which a file is read back, are in the attributes.
    """
    arrays, attributes = encode(model)
    out: dict[str, Any] = {**arrays, "fs": np.array([model.sample_rate_hz])}
    unit = np.linspace(-1.0, 1.0, _POINTS)
    springs, dampers, sliders = [], [], [np.zeros((6, 0))]
    for number, element in enumerate(model.elements, 1):
        x = element.reach * unit
        of_springs = [law for law in element.laws if isinstance(law, Spring)]
        if any(isinstance(law, UserSpring) for law in of_springs):
            springs.append(np.full_like(x, np.nan))
        else:
            springs.append(sum((law.force(x) for law in of_springs), np.zeros_like(x)))
        dampers.append(sum((law.damping(x) for law in element.laws if isinstance(law, Damper)), np.zeros_like(x)))
        for law in element.laws:
            if isinstance(law, Joint):
                stiffness, strength = law.sliders()
                own = [np.full(strength.size, number), stiffness / element.scale_m, strength, *law.bends()]
                sliders.append(np.array(own))
    if model.elements:
        out |= {
            "directions": np.array([element.direction for element in model.elements]),
            "displacement_m": np.array([element.reach * element.scale_m * unit for element in model.elements]),
            "spring_n": np.array(springs),
            "damper_n_s_m": np.array(dampers),
        }
    every = np.concatenate(sliders, axis=1)
    if every.size:
        bent = np.any(every[3:])
        out |= dict(zip(_SLIDERS[: None if bent else 3], every[: None if bent else 3], strict=True))
    return Contents("structured", model.specimen, out, attributes, {}, {n: u for n, u in _UNITS.items() if n in out})


def structured_from(arrays: Arrays, attributes: Attributes) -> StructuredModel:
    """Convert the output of `structured_parts` back to a model."""
    names = ("frequency_hz", "damping_ratio", "input_shapes", "output_shapes", "direct")
    return decode(StructuredModel, {name: np.asarray(arrays[name]) for name in names}, attributes)


EXCHANGE = Exchange("structured", StructuredModel, structured_parts, structured_from)
