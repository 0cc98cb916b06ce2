"""Short fits that rank the laws of an element before any is fitted in full."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.channels import find_role
from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.linear.modes import LinearModes
from identification.models.structured.model import StructuredModel
from identification.models.structured.nudging import Nudging
from identification.models.structured.parameters import HIGHEST, Parameters
from identification.models.structured.problem import ModalTest, Problem
from identification.models.structured.progress import FitWatch
from identification.models.structured.start import periodic_of

_RATIO = 0.05
"""Damping ratio of the nudging forces: those of a fit's first stage."""
_MISFIT = 0.01
"""Relative misfit against which the errors of the modal test are weighed."""
_TOLERANCE, _EVALUATIONS = 3e-2, 8
"""Relative gain with which a short fit ends, and linearisations at most. Chosen: right laws took two to six."""
_COMPARED = 4
"""Most starts that are compared by a simulation."""


def rough_steps(start: StructuredModel) -> int:
    """Return the steps of all fits but the last: half of them, as long as every mode may rise by a fifth."""
    needed = 1.2 * float(np.max(start.frequency_hz)) / (HIGHEST * start.sample_rate_hz)
    return min(start.steps, max(math.ceil(0.5 * start.steps), math.ceil(needed)))


class Screening:
    """Short fits to the loudest periodic experiment, led by the measured motion.

    Unlike in the first stages of a fit, directions are free: with the direction of a regression, that of one mode, the part of
    the force that acts on other modes left 30 % error of any law of a stop, and laws could not be told apart. Frequency and
    damping of the mode that stands for those above the band stay: with them short fits of right laws ended at 30 %, too.
    """

    def __init__(
        self,
        modes: LinearModes,
        experiments: Sequence[Experiment],
        linear: StructuredModel,
        nudged: int,
        watch: FitWatch,
    ) -> None:
        self._modes, self._linear, self._nudged, self._watch = modes, linear, nudged, watch
        self._loudest = max(periodic_of(experiments), key=lambda one: float(np.mean(one.counted_inputs**2)))
        self._tied = (find_role(linear.outputs, "drive"),)

    def nearest(self, starts: Sequence[StructuredModel]) -> StructuredModel:
        """Return the start whose simulation errs least: a regression ranks joints otherwise than fits do."""
        if len(starts) == 1:
            return starts[0]

        def error(start: StructuredModel) -> float:
            problem, vector = self._problem(start)
            return problem.error(vector)

        return min(starts[:_COMPARED], key=error)

    def error(self, start: StructuredModel) -> float:
        """Return the relative RMS error of a short fit; inf if it cannot be made."""
        problem, vector = self._problem(start)
        try:
            return problem.error(problem.solve(vector, _TOLERANCE, _EVALUATIONS).vector)
        except IdentificationError:
            return math.inf

    def _problem(self, start: StructuredModel) -> tuple[Problem, np.ndarray]:
        begun, one = replace(start, steps=rough_steps(start)), self._loudest
        nudging = Nudging.of(self._linear, one, self._nudged, _RATIO, begun.steps, one.counted_from)
        parameters = Parameters(begun, self._tied, False, True, poles=len(self._modes.frequency_hz))
        test = ModalTest(parameters, self._modes, self._linear)
        return Problem(parameters, [one], [nudging], test, _MISFIT, self._watch), parameters.vector(begun)
