"""Free parameters of a structured model in one vector, and derivatives by them from those of the kernels."""

from dataclasses import dataclass, replace

import numpy as np

from identification.models.structured.elements import NonlinearElement, derivative_tables_of, laws_in_order
from identification.models.structured.laws import FROM_ZERO, POSITIVE, Transform
from identification.models.structured.model import StructuredModel, outputs_of, workspace_for
from identification.models.structured.nudging import Nudging, ends_of_steps, not_led, update_support
from identification.models.structured.sensitivities import Sensitivities, run_with_sensitivities
from identification.models.structured.steps import System
from vibrolock.arrays import Float

HIGHEST = 0.45
"""Largest frequency of a mode times the length of a step."""
_NEAR = float(np.log(2.0))
"""Logarithm of the factor within which a frequency stays."""
_VECTOR = 4
"""Compiled loops over columns take so many at once, or multiples; those that are left they take one by one."""
_LEAST_DAMPING, _LARGEST_DAMPING = 1e-5, 0.5  # bounds of fitted damping ratios; chosen


@dataclass(frozen=True, eq=False)
class Parameters:
    """Which numbers of a model are free, and their order in a vector.

    Logarithms of frequencies and damping ratios of the first ``poles`` modes; input shapes; of each element the direction
    without its leading component (which sets the scale of x); the numbers of all springs, dampers and joints as their laws move
    them; the support's stiffness if ``support``; output shapes of outputs that are not ``tied``; ``direct``.
    """

    start: StructuredModel
    """Model that gives sizes and everything that is not free."""
    tied: tuple[int, ...]
    """Outputs at the first input: by reciprocity their shapes are the input's."""
    support: bool
    """Whether the support is free."""
    turned: bool = True
    """Whether directions are free."""
    poles: int | None = None
    """Number of modes whose frequency and damping ratio are free, the first ones; None for all. The data do not show those of a
    mode that stands for all modes above the band: whatever its frequency is, its ringing leaves the same residual."""
    measured: int | None = None
    """Number of modes that were measured, the first ones; None for all. Those after them stand for modes above and stay there:
    at least midway, in logarithms, between the highest measured frequency and their own initial one."""

    @property
    def _poles(self) -> int:
        return len(self.start.frequency_hz) if self.poles is None else self.poles

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all free numbers."""
        modes, inputs = self.start.input_shapes.shape
        out = [f"{number} {i + 1}" for number in ("frequency", "damping") for i in range(self._poles)]
        out += [f"shape {i + 1} at {self.start.inputs[j].name}" for i in range(modes) for j in range(inputs)]
        for number, element in enumerate(self.start.elements):
            out += [f"element {number + 1} direction {i + 1}" for i in self._kept(element)]
        for e, law in laws_in_order(self.start.elements):
            out += [f"element {e + 1} {name}" for name in self.start.elements[e].laws[law].names]
        out += ["support"] * self.support
        out += [f"shape {i + 1} at {self.start.outputs[o].name}" for o in self._untied for i in range(modes)]
        out += [f"direct {channel.name} {of.name}" for channel in self.start.outputs for of in self.start.inputs]
        return tuple(out)

    @property
    def transforms(self) -> tuple[Transform | None, ...]:
        """How each of `names` follows from the vector; None for components of shapes and directions, and ``direct``."""
        shapes = self.start.input_shapes.size + sum(len(self._kept(element)) for element in self.start.elements)
        laws = [
            one for e, law in laws_in_order(self.start.elements) for one in self.start.elements[e].laws[law].transforms
        ]
        before = [*[POSITIVE] * (2 * self._poles), *[None] * shapes, *laws, *[FROM_ZERO] * self.support]
        return (*before, *[None] * (len(self.names) - len(before)))

    @property
    def _untied(self) -> list[int]:
        return [o for o in range(len(self.start.outputs)) if o not in self.tied]

    def _kept(self, element: NonlinearElement) -> list[int]:
        """Free components of a direction: all but that of the mode that gives most of its static compliance.

        Of a place none is free.
        """
        if element.between or not self.turned:
            return []
        most = int(np.argmax(np.abs(element.direction) / self.start.omega))
        return [i for i in range(element.direction.size) if i != most]

    def vector(self, model: StructuredModel) -> Float:
        """Return the free numbers of a model."""
        poles = self._poles
        parts = [np.log(model.frequency_hz[:poles]), np.log(model.damping_ratio[:poles]), model.input_shapes.ravel()]
        for element, first in zip(model.elements, self.start.elements, strict=True):
            parts.append(element.direction[self._kept(first)])
        parts += [model.elements[e].laws[law].vector for e, law in laws_in_order(model.elements)]
        if self.support:
            parts.append(np.array([model.support_n_m]))
        parts += [model.output_shapes[self._untied].ravel(), model.direct.ravel()]
        return np.concatenate(parts)

    def bounds(self, vector: Float) -> tuple[Float, Float]:
        """Return least and largest values, so that modes that the data hardly show stay modes."""
        modes, poles = len(self.start.frequency_hz), self._poles
        least, largest = np.full(vector.size, -np.inf), np.full(vector.size, np.inf)
        frequency = np.log(self.start.frequency_hz[:poles])
        highest = np.log(HIGHEST / self.start.step_s)
        least[:poles], largest[:poles] = frequency - _NEAR, np.minimum(frequency + _NEAR, highest)
        if self.measured is not None and self.measured < poles:
            above = slice(self.measured, poles)
            least[above] = np.maximum(least[above], 0.5 * (frequency[above] + np.max(frequency[: self.measured])))
        least[poles : 2 * poles], largest[poles : 2 * poles] = np.log(_LEAST_DAMPING), np.log(_LARGEST_DAMPING)
        laws = [self.start.elements[e].laws[law].bounds for e, law in laws_in_order(self.start.elements)]
        at = (
            2 * poles
            + modes * len(self.start.inputs)
            + sum(len(self._kept(element)) for element in self.start.elements)
        )
        for bounds in laws:
            least[at : at + bounds.shape[1]], largest[at : at + bounds.shape[1]] = bounds
            at += bounds.shape[1]
        if self.support:
            least[at] = 0.0
        return least, largest

    def model(self, vector: Float) -> StructuredModel:
        """Invert `vector`."""
        at, start = 0, self.start

        def take(count: int) -> Float:
            nonlocal at
            at += count
            return vector[at - count : at]

        modes, inputs = start.input_shapes.shape
        frequency, damping, poles = start.frequency_hz.copy(), start.damping_ratio.copy(), self._poles
        frequency[:poles], damping[:poles] = np.exp(take(poles)), np.exp(take(poles))
        shapes = take(modes * inputs).reshape(modes, inputs)
        directions = [element.direction.copy() for element in start.elements]
        for element, direction in zip(start.elements, directions, strict=True):
            kept = self._kept(element)
            direction[kept] = take(len(kept))
        laws = [list(element.laws) for element in start.elements]
        for e, law in laws_in_order(start.elements):
            laws[e][law] = laws[e][law].moved(take(laws[e][law].vector.size))
        stiffness = max(float(take(1)[0]), 0.0) if self.support else start.support_n_m
        outputs = np.empty_like(start.output_shapes)
        outputs[list(self.tied)] = shapes[:, 0]
        outputs[self._untied] = take(len(self._untied) * modes).reshape(-1, modes)
        elements = tuple(
            replace(
                element,
                direction=start.output_selector(element.between) @ outputs if element.between else direction,
                laws=tuple(found),
            )
            for element, direction, found in zip(start.elements, directions, laws, strict=True)
        )
        return replace(
            start,
            frequency_hz=frequency,
            damping_ratio=damping,
            input_shapes=shapes,
            elements=elements,
            support_n_m=stiffness,
            output_shapes=outputs,
            direct=take(start.direct.size).reshape(start.direct.shape),
        )

    def derivatives(
        self, model: StructuredModel, u: Float, counted_from: int, nudging: Nudging | None = None
    ) -> tuple[Float, Float]:
        """Return the counted outputs, float[n, n_outputs], and their derivatives by the vector, float[n, n_outputs, P]."""
        system, modes, inputs = model.system, len(model.frequency_hz), len(model.inputs)
        stretches, ends = _stretches(model, u, nudging)
        changes = derivative_tables_of(model.elements, system.tables, system.step_s)
        count = 2 * modes + modes * inputs + system.phi.size + changes.element.size + 1
        count += -count % _VECTOR  # columns of zeros before the last
        states = np.zeros((u.shape[1], 3, modes))
        raw = np.zeros((u.shape[1] - counted_from, len(model.outputs), count))
        state, sticks = np.zeros(system.size), np.zeros(len(system.tables.sliders), dtype=np.bool_)
        sens = Sensitivities(np.zeros((system.size, count)), np.zeros((len(system.phi), count)), sticks)  # at rest
        for part, first, last in stretches:
            run_with_sensitivities(
                part,
                workspace_for(part, count),
                changes,
                ends[first * model.steps : last * model.steps + 1],
                state,
                states[first:last],
                np.array(model.output_shapes),
                model.motions,
                counted_from - first,
                sens,
                np.zeros((modes + 1, modes)),
                np.zeros((modes, count)),
                raw,
            )
            if nudging is not None and last == nudging.until:
                more = nudging.before - nudging.rate  # what follows is nudged at the second rate
                sens = sens._replace(rows=not_led(sens.rows, system, more), sums=not_led(sens.sums, system, more))
            if nudging is not None:
                update_support(part, (last - first) / model.sample_rate_hz, state, sens.rows)
        if nudging is not None:
            raw = not_led(raw, system, nudging.rate)
        found = outputs_of(model, u, states)[:, counted_from:].T
        return found, self._by_vector(model, raw, states[counted_from:], u[:, counted_from:])

    def outputs(self, model: StructuredModel, u: Float, counted_from: int, nudging: Nudging | None = None) -> Float:
        """Return the counted outputs alone, float[n, n_outputs]."""
        stretches, ends = _stretches(model, u, nudging)
        return model.run(stretches, u, ends).outputs[:, counted_from:].T

    def _by_vector(self, model: StructuredModel, raw: Float, states: Float, u: Float) -> Float:
        modes, inputs = model.input_shapes.shape
        by_frequency = model.omega / np.cos(0.5 * model.omega * model.step_s) ** 2
        poles = self._poles
        columns = [raw[..., :poles] * by_frequency[:poles]]
        columns.append(raw[..., modes : modes + poles] * model.damping_ratio[:poles])
        shapes = raw[..., 2 * modes : 2 * modes + modes * inputs].copy()
        motions = states[:, model.motions]  # [n, n_outputs, n_modes]
        for output in self.tied:
            shapes[:, output, ::inputs] += motions[:, output]
        columns.append(shapes)
        at = 2 * modes + modes * inputs
        of_places = np.zeros((*raw.shape[:2], len(self.start.outputs), modes))
        for element in self.start.elements:
            columns.append(raw[..., at + np.array(self._kept(element), dtype=int)] / element.scale_m)
            if element.between:
                by_direction = raw[..., None, at : at + modes] / element.scale_m
                of_places += self.start.output_selector(element.between)[:, None] * by_direction
            at += modes
        for output in self.tied:
            shapes[..., ::inputs] += of_places[:, :, output]
        columns.append(raw[..., at : at + sum(law.vector.size for e in model.elements for law in e.laws)])
        if self.support:
            columns.append(raw[..., -1:])
        for output in self._untied:
            part = of_places[:, :, output].copy()
            part[:, output] += motions[:, output]
            columns.append(part)
        direct = np.zeros((*raw.shape[:2], model.direct.size))
        for output in range(raw.shape[1]):
            direct[:, output, output * inputs : (output + 1) * inputs] = u.T
        columns.append(direct)
        return np.concatenate(columns, axis=2)


def _stretches(
    model: StructuredModel, u: Float, nudging: Nudging | None
) -> tuple[list[tuple[System, int, int]], Float]:
    if nudging is None:
        return [(model.system, 0, u.shape[1])], ends_of_steps(u, model.steps)
    return nudging.stretches(model.system), nudging.ends
