"""A structure with nonlinear elements as a state-space model, simulated with a time step that conserves its energy balance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.channels import MOTION_ORDER, Channel, find_name
from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.experiments.simulation import Simulation, first_unbounded, use_of
from identification.models.structured.elements import NonlinearElement, small_vibrations, tables_of
from identification.models.structured.nudging import (
    Nudging,
    ends_of_steps,
    settling_periods,
    update_support,
    with_lead_in_periods,
)
from identification.models.structured.steps import System, Workspace, run
from identification.models.structured.trained_range import driven_displacements, input_use
from identification.validation import convert_fields, finite_array, positive, shaped_array
from vibrolock.arrays import Float
from vibrolock.results import Result

_SOFTEST, _STIFFEST = -0.5, 4.0
"""Slopes of the springs beyond their reach, relative to the static stiffness in their direction, all elements together."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion(Simulation):
    """A simulated run of a structured model; its states are the modal displacements, and then the velocities.

    Of a periodic experiment only the samples that count are in the uses of elements, not the transient that leads to them.
    """

    acceleration: Float
    """float[n_modes, n], second derivatives of the modal coordinates by time, kg^1/2 m/s^2."""
    reach_use: Float
    """float[n_elements], largest displacement of every element over its reach. Above 1 its law is extrapolated."""
    unsolved_steps: int = 0
    """Number of steps whose equation Newton's iteration has not solved; above 0 energy balance and bound do not hold."""

    @property
    def displacement(self) -> Float:
        """float[n_modes, n]: modal coordinates, kg^1/2 m."""
        return self.states[: len(self.acceleration)]

    @property
    def velocity(self) -> Float:
        """float[n_modes, n]: derivatives of the modal coordinates by time, kg^1/2 m/s."""
        return self.states[len(self.acceleration) :]


@dataclass(frozen=True, eq=False, kw_only=True)
class StructuredModel(Result):
    """Modes, nonlinear elements along directions in their space, and what a force sensor does not see.

    ``q'' + 2 Z W q' + W^2 q + sum_e direction_e f_e(direction_e . q, direction_e . q') = B (u + s)``

    with mass-normalised modal coordinates q. Outputs are ``C q``, ``C q'`` or ``C q''`` by the unit of their channel, plus
    ``D u``. s is the static force of a support at the first input that a piezoelectric sensor does not show: minus
    ``support_n_m`` times the displacement of the first input behind two low-passes, at most ``support_largest_n``. One
    low-pass alone would do work on vibrations far above its corner.

    The simulation takes ``steps`` steps of the implicit midpoint rule in each sample, with discrete gradients of the potential
    energies (`steps`): over each step the energy changes by the work of the input less that of the
    dampers, exactly. The rule lowers frequencies, by ``(pi f h)^2 / 3`` of themselves with a step h. The modes are therefore
    simulated with ``2/h tan(pi f h)``, which makes their frequencies and accelerations those of the continuous equation;
    harmonics have errors of that size.

    Not modelled: damping that couples modes, inputs between samples above half the rate.

    Raises `IdentificationError` if shapes do not agree, or a number is not allowed.

    Parameters
    ----------
    frequency_hz, damping_ratio
        float[n_modes], undamped frequencies and damping ratios of the linear part.
    input_shapes
        float[n_modes, n_inputs], mass-normalised shapes at the inputs, kg^-1/2.
    output_shapes
        float[n_outputs, n_modes], mass-normalised shapes at the outputs, kg^-1/2.
    direct
        float[n_outputs, n_inputs], residual of the modes below, unit of the output per N.
    elements
        Nonlinear elements.
    sample_rate_hz
        Sample rate of inputs and outputs.
    inputs, outputs
        Channels: forces, and motions.
    steps
        Steps in a sample.
    support_n_m, support_corner_hz, support_largest_n
        Stiffness of the unseen support, corner of its low-passes (that of the sensor's high-pass), and its largest force.
    specimen
        Name of the test specimen.
    training
        Names of the training experiments.
    """

    frequency_hz: Float
    damping_ratio: Float
    input_shapes: Float
    output_shapes: Float
    direct: Float
    elements: tuple[NonlinearElement, ...]
    sample_rate_hz: float
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    steps: int = 2
    support_n_m: float = 0.0
    support_corner_hz: float = 0.3
    support_largest_n: float = 100.0
    specimen: str = ""
    training: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        convert_fields(self, tuple, "elements", "inputs", "outputs", "training")
        for name in ("sample_rate_hz", "support_corner_hz", "support_largest_n"):
            object.__setattr__(self, name, positive(name, getattr(self, name)))
        modes, inputs, outputs = np.size(self.frequency_hz), len(self.inputs), len(self.outputs)
        shapes: dict[str, tuple[int, ...]] = {
            "frequency_hz": (modes,),
            "damping_ratio": (modes,),
            "input_shapes": (modes, inputs),
            "output_shapes": (outputs, modes),
            "direct": (outputs, inputs),
        }
        for name, shape in shapes.items():
            object.__setattr__(self, name, shaped_array(name, getattr(self, name), np.float64, shape))
        for name in ("frequency_hz", "damping_ratio"):
            if not np.all(getattr(self, name) > 0.0):
                raise IdentificationError(
                    field=name,
                    value=getattr(self, name).tolist(),
                    allowed="numbers above 0: the model must stay bounded",
                )
        highest = 0.5 * self.sample_rate_hz * self.steps
        if self.steps >= 1 and not np.all(self.frequency_hz < highest):
            raise IdentificationError(
                field="frequency_hz",
                value=self.frequency_hz.tolist(),
                allowed=f"below {highest:g}, half of the rate of the steps",
            )
        if not (modes and inputs and outputs):
            raise IdentificationError("a model needs one of each at least", field="frequency_hz, inputs, outputs")
        for number, element in enumerate(self.elements):
            if element.direction.shape != (modes,):
                raise IdentificationError(
                    f"shape {element.direction.shape}", field=f"elements[{number}].direction", allowed=f"{(modes,)}"
                )
        for name, least in (("steps", 1), ("support_n_m", 0)):
            if getattr(self, name) < least:
                raise IdentificationError(field=name, value=getattr(self, name), allowed=f"{least} or above")

    @property
    def omega(self) -> Float:
        """float[n_modes], rad/s."""
        return np.asarray(2.0 * np.pi * self.frequency_hz)

    @property
    def step_s(self) -> float:
        """Length of a step, s."""
        return 1.0 / (self.sample_rate_hz * self.steps)

    @property
    def motions(self) -> NDArray[np.int64]:
        """int[n_outputs]: number of derivatives of the displacement that every output shows."""
        return np.array([MOTION_ORDER[channel.motion] for channel in self.outputs])

    @property
    def system(self) -> System:
        """Numbers for the kernels."""
        phi = np.array([element.phi for element in self.elements]).reshape(len(self.elements), len(self.omega))
        omega = 2.0 / self.step_s * np.tan(0.5 * self.omega * self.step_s)
        static = 1.0 / (max(len(self.elements), 1) * np.sum((phi / omega) ** 2, axis=1))
        return System(
            step_s=self.step_s,
            steps=self.steps,
            omega=omega,
            zeta=np.array(self.damping_ratio),
            b=np.array(self.input_shapes),
            inputs=len(self.inputs),
            phi=phi,
            tables=tables_of(self.elements, _SOFTEST * static, _STIFFEST * static, self.step_s),
            support=np.array(
                [self.support_n_m, 2.0 * np.pi * self.support_corner_hz, self.support_largest_n],
            ),
        )

    def simulate(self, inputs: ArrayLike) -> Motion:
        """Return the motion from rest under ``inputs``, float[n_inputs, n]."""
        u = finite_array("inputs", inputs, np.float64, 2)
        if len(u) != len(self.inputs):
            raise IdentificationError(f"shape {u.shape}", field="inputs", allowed=f"{len(self.inputs)} rows")
        found = self.run([(self.system, 0, u.shape[1])], u, ends_of_steps(u, self.steps))
        return replace(found, input_use=np.array([input_use(self, u[0], settled=False)]))

    def run(self, stretches: Sequence[tuple[System, int, int]], u: Float, ends: Float, counted_from: int = 0) -> Motion:
        """Simulate from rest, with a system from sample to sample; a frozen support is updated after each stretch."""
        states, state = np.zeros((u.shape[1], 3, len(self.omega))), np.zeros(self.system.size)
        unsolved = 0
        for part, first, last in stretches:
            work = workspace_for(part)
            run(part, work, ends[first * self.steps : last * self.steps + 1], state, states[first:last])
            unsolved += int(work.unsolved[0])
            if not part.support[1]:
                update_support(part, (last - first) / self.sample_rate_hz, state)
        return motion_of(self, u, states, unsolved, counted_from)

    def simulate_experiment(self, experiment: Experiment) -> Motion:
        """Return the motion under the inputs of an experiment.

        A periodic one begins with the measured motion: up to the samples that count, a force on every mode whose motion the
        outputs tell apart nudges it to the measured velocity; periods that are not returned follow without that force. Where
        several steady vibrations are possible, the run is thus on the measured branch. Other experiments begin at rest.
        """
        if not experiment.period_samples:
            return self.simulate(experiment.inputs)
        n_observable = min(len(self.omega), len(self.outputs))
        added = settling_periods(experiment, float(np.min((self.omega * self.damping_ratio)[:n_observable])))
        longer, until = with_lead_in_periods(experiment, added), experiment.counted_from
        nudging = Nudging.of(self, longer, n_observable, 0.0, self.steps, until)
        run_of = self.run(nudging.stretches(self.system), longer.inputs, nudging.ends, longer.counted_from)
        kept = np.r_[:until, longer.counted_from : longer.inputs.shape[1]]
        cut = {name: getattr(run_of, name)[:, kept] for name in ("outputs", "states", "acceleration")}
        by_input = np.array([input_use(self, experiment.counted_inputs[0], settled=True)])
        return replace(run_of, **cut, input_use=by_input, unbounded_at=first_unbounded(cut["outputs"]))

    def with_half_steps(self) -> "StructuredModel":
        """Return the model with steps of half the length, which tells the errors of the steps (Richardson)."""
        return replace(self, steps=2 * self.steps)

    def output_selector(self, between: Sequence[str]) -> Float:
        """float[n_outputs]: the displacement at an output, or of one relative to another, as a sum of those of all outputs.

        Raises `IdentificationError` if a channel is not among the outputs.
        """
        found = np.zeros(len(self.outputs))
        for name, sign in zip(between, (1.0, -1.0), strict=False):
            found[find_name(self.outputs, name)] = sign
        return found

    def linearised(self) -> "StructuredModel":
        """Return the modes of small vibrations about rest, as a model without elements.

        Springs have their slope at rest, and all sliders stick. Frequencies and damping ratios are those of the poles, shapes
        those without damping. Not modelled: the damping that couples these modes, and what time steps do to the elements,
        which lowers the frequencies of a simulation by up to ``(pi f h)^2 / 3`` of themselves.
        """
        if not self.elements:
            return self
        poles, shapes = small_vibrations(self.omega, self.damping_ratio, self.elements)
        return replace(
            self,
            frequency_hz=np.abs(poles) / (2.0 * np.pi),
            damping_ratio=-poles.real / np.abs(poles),
            input_shapes=shapes.T @ self.input_shapes,
            output_shapes=self.output_shapes @ shapes,
            elements=(),
        )

    def trained_with(self, experiments: Sequence[Experiment]) -> "StructuredModel":
        """Return the model with the largest displacements of its elements in ``experiments``, and how far their forces go."""
        use = np.max([self.simulate_experiment(one).reach_use for one in experiments], axis=0)
        known = zip(self.elements, use.tolist(), strict=True)
        moved = replace(self, elements=tuple(replace(e, largest=share * e.reach) for e, share in known))
        forces = [(one, one.period_samples > 0) for one in experiments]
        driven = [
            driven_displacements(moved, (one.counted_inputs if settled else one.inputs)[0], settled=settled)
            for one, settled in forces
        ]
        most = zip(moved.elements, np.max(driven, axis=0).tolist(), strict=True)
        return replace(moved, elements=tuple(replace(e, driven=x) for e, x in most))


def outputs_of(model: StructuredModel, u: Float, states: Float) -> Float:
    """float[n_outputs, n] from inputs and states [n, 3, n_modes]."""
    motions = states[:, model.motions]  # [n, n_outputs, n_modes]
    return np.asarray(np.einsum("kom,om->ok", motions, model.output_shapes) + model.direct @ u)


def motion_of(model: StructuredModel, u: Float, states: Float, unsolved: int, counted_from: int = 0) -> Motion:
    """Return the run with inputs and states [n, 3, n_modes]; displacements of elements are taken from ``counted_from`` on."""
    phi = np.array([element.phi for element in model.elements]).reshape(len(model.elements), len(model.omega))
    largest = np.max(np.abs(states[counted_from:, 0] @ phi.T), axis=0, initial=0.0)
    reach, trained = (np.array([getattr(e, name) or np.nan for e in model.elements]) for name in ("reach", "largest"))
    outputs = outputs_of(model, u, states)
    return Motion(
        outputs=outputs,
        states=states[:, :2].reshape(len(states), -1).T,
        state_use=use_of(largest, trained),
        unbounded_at=first_unbounded(outputs),
        acceleration=states[:, 2].T,
        reach_use=np.asarray(largest / reach),
        unsolved_steps=unsolved,
    )


def workspace_for(system: System, columns: int = 0) -> Workspace:
    """Return work for the steps of a system, and for derivatives by ``columns`` numbers."""
    n, inputs, elements = len(system.omega), system.b.shape[1], len(system.phi)
    h, omega, phi = system.step_s, system.omega, system.phi
    effective_stiffness = 2.0 / h + 2.0 * system.zeta * omega + 0.5 * h * omega**2
    return Workspace(
        effective_stiffness=effective_stiffness,
        compliance=phi / effective_stiffness,
        shared=phi / effective_stiffness @ phi.T,
        mean=np.zeros(n),
        free=np.zeros(n),
        u=np.zeros(inputs),
        w=np.zeros(elements),
        begun=np.zeros(elements),
        forces=np.zeros((elements, 3)),
        coupling=np.zeros((elements, elements)),
        change=np.zeros((elements, 1)),
        row=np.zeros(columns),
        dforce=np.zeros(columns),
        stuck=np.zeros(len(system.tables.sliders)),
        unsolved=np.zeros(1, dtype=np.int64),
    )
