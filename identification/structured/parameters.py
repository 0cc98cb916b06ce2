"""Free parameters of a structured model in one vector, and derivatives by them from those of the kernels."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.structured.elements import NonlinearElement
from identification.structured.model import StructuredModel, ends_of_steps, outputs_of, room_for
from identification.structured.sensitivities import run_with_sensitivities

__all__ = ["Parameters"]

Float = NDArray[np.float64]

_NEAR = float(np.log(2.0))
"""Logarithm of the factor within which a frequency stays."""
_LEAST_DAMPING, _LARGEST_DAMPING = 1e-5, 0.5


@dataclass(frozen=True, eq=False)
class Parameters:
    """Which numbers of a model are free, and their order in a vector.

    Logarithms of frequencies and damping ratios; input shapes; of each element the direction without its largest component
    (which sets the scale of x), the spring, and the square roots of the damper; the root of the support's stiffness if
    ``support``; output shapes of outputs that are not ``tied``; ``direct``.

    Parameters
    ----------
    start
        Model that gives sizes and everything that is not free.
    tied
        Outputs at the first input: by reciprocity their shapes are the input's.
    support
        Whether the support is free.
    """

    start: StructuredModel
    tied: tuple[int, ...]
    support: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all free numbers."""
        modes, inputs = self.start.input_shapes.shape
        out = [f"frequency {i + 1}" for i in range(modes)] + [f"damping {i + 1}" for i in range(modes)]
        out += [f"shape {i + 1} at {self.start.inputs[j].name}" for i in range(modes) for j in range(inputs)]
        for number, element in enumerate(self.start.elements):
            kept = self._kept(element)
            out += [f"element {number + 1} direction {i + 1}" for i in kept]
            out += [f"element {number + 1} spring x^{k + 2}" for k in range(element.spring_n.size)]
            out += [f"element {number + 1} damper |x|^{j + 1}" for j in range(element.damper_n_s_m.size)]
        out += ["support"] * self.support
        out += [f"shape {i + 1} at {self.start.outputs[o].name}" for o in self._untied for i in range(modes)]
        out += [f"direct {channel.name} {of.name}" for channel in self.start.outputs for of in self.start.inputs]
        return tuple(out)

    @property
    def _untied(self) -> list[int]:
        return [o for o in range(len(self.start.outputs)) if o not in self.tied]

    def _kept(self, element: NonlinearElement) -> list[int]:
        """Free components of a direction."""
        return [i for i in range(element.direction.size) if i != int(np.argmax(np.abs(element.direction)))]

    def vector(self, model: StructuredModel) -> Float:
        """Return the free numbers of a model."""
        parts = [np.log(model.frequency_hz), np.log(model.damping_ratio), model.input_shapes.ravel()]
        for element, first in zip(model.elements, self.start.elements, strict=True):
            parts += [element.direction[self._kept(first)], element.spring_n, np.sqrt(element.damper_n_s_m)]
        if self.support:
            parts.append(np.sqrt([model.support_n_m]))
        parts += [model.output_shapes[self._untied].ravel(), model.direct.ravel()]
        return np.concatenate(parts)

    def bounds(self, vector: Float) -> tuple[Float, Float]:
        """Return least and largest values, so that modes that the data hardly show stay modes."""
        modes = len(self.start.frequency_hz)
        least, largest = np.full(vector.size, -np.inf), np.full(vector.size, np.inf)
        frequency = np.log(self.start.frequency_hz)
        highest = np.log(0.45 / self.start.step_s)
        least[:modes], largest[:modes] = frequency - _NEAR, np.minimum(frequency + _NEAR, highest)
        least[modes : 2 * modes], largest[modes : 2 * modes] = np.log(_LEAST_DAMPING), np.log(_LARGEST_DAMPING)
        return least, largest

    def model(self, vector: Float) -> StructuredModel:
        """Invert `vector`."""
        at, start = 0, self.start

        def take(count: int) -> Float:
            nonlocal at
            at += count
            return vector[at - count : at]

        modes, inputs = start.input_shapes.shape
        frequency, damping = np.exp(take(modes)), np.exp(take(modes))
        shapes = take(modes * inputs).reshape(modes, inputs)
        elements = []
        for element in start.elements:
            direction = element.direction.copy()
            kept = self._kept(element)
            direction[kept] = take(len(kept))
            spring, damper = take(element.spring_n.size), take(element.damper_n_s_m.size) ** 2
            elements.append(replace(element, direction=direction, spring_n=spring, damper_n_s_m=damper))
        stiffness = float(take(1)[0] ** 2) if self.support else start.support_n_m
        outputs = np.empty_like(start.output_shapes)
        outputs[list(self.tied)] = shapes[:, 0]
        outputs[self._untied] = take(len(self._untied) * modes).reshape(-1, modes)
        return replace(
            start,
            frequency_hz=frequency,
            damping_ratio=damping,
            input_shapes=shapes,
            elements=tuple(elements),
            support_n_m=stiffness,
            output_shapes=outputs,
            direct=take(start.direct.size).reshape(start.direct.shape),
        )

    def derivatives(self, model: StructuredModel, u: Float, counted_from: int) -> tuple[Float, Float]:
        """Return the counted outputs, float[n, n_outputs], and their derivatives by the vector, float[n, n_outputs, P]."""
        system, modes = model.system, len(model.frequency_hz)
        inputs, outputs = len(model.inputs), len(model.outputs)
        laws = int(system.sizes[:, 1].sum())
        count = 2 * modes + modes * inputs + system.phi.size + laws + 1
        states = np.zeros((u.shape[1], 3, modes))
        raw = np.zeros((u.shape[1] - counted_from, outputs, count))
        run_with_sensitivities(
            system,
            room_for(system),
            ends_of_steps(u, model.steps),
            np.zeros(2 * modes + 1),
            states,
            np.array(model.output_shapes),
            model.motions,
            counted_from,
            np.zeros((2 * modes + 1, count)),
            np.zeros((modes + 1, modes)),
            np.zeros((modes, count)),
            raw,
        )
        found = outputs_of(model, u, states)[:, counted_from:].T
        return found, self._by_vector(model, raw, states[counted_from:], u[:, counted_from:])

    def _by_vector(self, model: StructuredModel, raw: Float, states: Float, u: Float) -> Float:
        """Chain rule from the kernel's parameters to the vector."""
        modes, inputs = model.input_shapes.shape
        by_frequency = model.omega / np.cos(0.5 * model.omega * model.step_s) ** 2
        columns = [raw[..., : 2 * modes] * np.concatenate([by_frequency, model.damping_ratio])]
        shapes = raw[..., 2 * modes : 2 * modes + modes * inputs].copy()
        motions = states[:, model.motions]  # [n, n_outputs, n_modes]
        for output in self.tied:
            shapes[:, output, ::inputs] += motions[:, output]
        columns.append(shapes)
        at = 2 * modes + modes * inputs
        law_at = at + len(model.elements) * modes
        for element in model.elements:
            kept = np.array(self._kept(element), dtype=int)
            columns.append(raw[..., at + kept] / element.scale_m)
            springs, size = element.spring_n.size, element.law.size
            columns.append(raw[..., law_at : law_at + springs] * element.scale_m)
            roots = 2.0 * np.sqrt(element.damper_n_s_m) * element.scale_m**2
            columns.append(raw[..., law_at + springs : law_at + size] * roots)
            at, law_at = at + modes, law_at + size
        if self.support:
            columns.append(raw[..., -1:] * 2.0 * np.sqrt(model.support_n_m))
        for output in self._untied:
            part = np.zeros((*raw.shape[:2], modes))
            part[:, output] = motions[:, output]
            columns.append(part)
        direct = np.zeros((*raw.shape[:2], model.direct.size))
        for output in range(raw.shape[1]):
            direct[:, output, output * inputs : (output + 1) * inputs] = u.T
        columns.append(direct)
        return np.concatenate(columns, axis=2)
