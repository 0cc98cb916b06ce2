"""What a modal test says of the small vibrations of a model, as rows of its least-squares problem."""

import numpy as np

from identification.linear.modes import LinearModes
from identification.models.structured.model import StructuredModel
from identification.models.structured.parameters import Parameters
from identification.models.structured.small_vibrations import at_rest
from vibrolock.arrays import Float

_FREQUENCY_STD, _DAMPING_STD, _SHAPE_STD, _RESIDUAL_STD = 1e-3, 0.1, 0.02, 0.3
"""What a modal test is trusted to: relative errors that are added to its own, and those of the residual mode."""
_STEP = 1e-6
"""Step of the differences, of logarithms and relative to shapes; so large is their error."""


class ModalTest:
    """Frequencies, damping ratios and shapes of a modal test, which a model has to have in small vibrations.

    In a modal test sliders stick and springs have their slope at rest. What is compared are therefore the modes of
    `StructuredModel.linearised`, with the damping that couples them left out. The last mode is the residual of the modes above,
    of which little is known. Not modelled: a modal test at a level at which joints slip.

    Parameters
    ----------
    parameters
        Free numbers of the model.
    modes
        Modal test.
    linear
        The model of the test, without elements.
    """

    def __init__(self, parameters: Parameters, modes: LinearModes, linear: StructuredModel) -> None:
        self._parameters = parameters
        self._outputs = [o for o in range(len(linear.outputs)) if o not in parameters.tied]
        self._expected = self._seen(linear)
        count, measured = len(linear.frequency_hz), len(modes.frequency_hz)
        frequency, damping = np.full(count, _RESIDUAL_STD), np.ones(count)
        frequency[:measured] = np.hypot(modes.frequency_std_hz / modes.frequency_hz, _FREQUENCY_STD)
        damping[:measured] = np.hypot(modes.damping_ratio_std / modes.damping_ratio, _DAMPING_STD)
        largest = np.max(np.abs(linear.output_shapes), axis=0)
        shapes = np.where(np.arange(count) < measured, _SHAPE_STD, _RESIDUAL_STD) * largest
        rows = len(linear.inputs) + len(self._outputs)
        self.std = np.concatenate([frequency, damping, *[shapes] * rows])
        """Standard deviations of logarithms of frequencies and damping ratios, and of shapes."""

    def rows(self, vector: Float) -> Float:
        """float[n, P + 1]: derivatives and residuals, each over its standard deviation."""
        here, columns = self._seen(self._parameters.model(vector)), []
        for number, step in enumerate(_STEP * np.maximum(np.abs(vector), 1.0)):
            moved = vector.copy()
            moved[number] += step  # up, for some numbers go no further down
            columns.append((self._seen(self._parameters.model(moved)) - here) / step)
        return np.asarray(np.column_stack([np.array(columns).T, here - self._expected]) / self.std[:, None])

    def left(self, vector: Float) -> Float:
        """Return the residuals alone."""
        return np.asarray((self._seen(self._parameters.model(vector)) - self._expected) / self.std)

    def _seen(self, model: StructuredModel) -> Float:
        stiffness, damping = at_rest(model.omega, model.damping_ratio, model.elements)
        squares, shapes = np.linalg.eigh(stiffness)
        shapes = shapes * np.where(np.diag(shapes) < 0.0, -1.0, 1.0)
        omega = np.sqrt(np.maximum(squares, 1e-6 * squares[-1]))
        ratio = np.einsum("ij,ik,kj->j", shapes, damping, shapes) / (2.0 * omega)
        inputs, outputs = model.input_shapes.T @ shapes, model.output_shapes[self._outputs] @ shapes
        return np.concatenate([np.log(omega), np.log(ratio), inputs.ravel(), outputs.ravel()])
