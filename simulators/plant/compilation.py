"""Building of the compiled integrator's arrays from the parts of a virtual rig, and discretisation of the linear plant."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulators.exciter import Exciter
from simulators.layout import CHANNEL, CONVERTER, PLANT, RigArrays, RigState
from simulators.plant.assembly import LinearPlant
from simulators.plant.sites import local_sites
from simulators.sensing.filters import channel_sections, output_sections, ring_size, skew_taps
from simulators.sensing.parts import Converter, Sensor
from simulators.sites.elements import Element
from simulators.sites.friction import FrictionSite
from vibrolock.arrays import Float
from vibrolock.width import WIDTH

_TERMS = 18
"""Terms of the series of an exponential: of a half, the next is 2e-23."""


class PhiMatrices(NamedTuple):
    """Matrices of the exact linear sub-step."""

    transition: Float
    """``e^{hA}`` [n, n]."""
    held: Float
    """``h phi_1(hA) B`` [n, n_input]: effect of an input held over the step."""
    ramp: Float
    """``h phi_2(hA) B`` [n, n_input]: effect of an input that grows linearly from 0 to 1 over the step."""
    curve: Float
    """``2 h phi_3(hA) B`` [n, n_input]: effect of an input that grows with the square of time from 0 to 1 over the step."""


def phi_matrices(dynamics: Float, columns: Float, step_s: float) -> PhiMatrices:
    """Return matrix exponential, phi_1, phi_2 and phi_3 from one exponential of an augmented matrix (Van Loan 1978).

    ``phi_1(z) = (e^z - 1)/z``, ``phi_2(z) = (e^z - 1 - z)/z^2`` and ``phi_3(z) = (e^z - 1 - z - z^2/2)/z^3`` are formed without
    a division.
    """
    n, k = columns.shape
    augmented = np.zeros((n + 3 * k, n + 3 * k))
    augmented[:n, :n] = step_s * dynamics
    augmented[:n, n : n + k] = step_s * columns
    augmented[n : n + 2 * k, n + k :] = np.eye(2 * k)
    exponential = _exponential(augmented.tobytes()).reshape(augmented.shape)
    held, ramp, third = (exponential[:n, n + i * k : n + (i + 1) * k] for i in range(3))
    return PhiMatrices(exponential[:n, :n], held, ramp, 2.0 * third)


@lru_cache(maxsize=64)
def _exponential(matrix: bytes) -> Float:
    """Exponential of a square matrix of doubles, flat; a rig is discretised several times for one run.

    It is the Taylor series of a part of the matrix, squared. Its 16th power chooses the part: powers grow with the frequencies,
    elements of the matrix with their squares. Small elements keep their digits.
    """
    values = np.frombuffer(matrix)
    size = math.isqrt(values.size)
    whole = values.reshape(size, size)
    growth = float(np.linalg.norm(np.linalg.matrix_power(whole, 16), 1)) ** (1.0 / 16.0)
    squarings = max(0, math.ceil(math.log2(max(growth, 0.5))) + 1)
    found = term = np.eye(size)
    for order in range(1, _TERMS + 1):
        term = term @ whole / (order * 2.0**squarings)
        found = found + term
    for _ in range(squarings):
        found = found @ found
    found.setflags(write=False)
    return found.ravel()


def step_columns(plant: LinearPlant, n_joint: int, step_s: float) -> tuple[Float, Float]:
    """Return predictor [n_input, n_row] and corrector [n_site, n_row] of the sub-step, padded for the kernels.

    The increment of a force goes on in the predictor. Its change d_1 - d_0 makes the force larger by
    ``(t + t^2) (d_1 - d_0) / 2``, t going from 0 to 1 over the step.

    Rows are ``[joint coordinates, element coordinates, x]``. Joints are the last ``n_joint`` sites. Their coordinates begin at
    row 0, where aligned vectors can be loaded.
    """
    columns = np.column_stack([plant.voltage_column, plant.site_columns])
    phi = phi_matrices(plant.dynamics, columns, step_s)
    predictor = np.hstack([phi.transition, phi.held, phi.ramp[:, 1:]])
    corrector = (phi.ramp + phi.curve)[:, 1:] / 2.0
    fold = np.vstack([np.roll(plant.site_rows, n_joint, axis=0), np.eye(plant.dynamics.shape[0])])
    even = np.zeros((predictor.shape[1] % 2, fold.shape[0]))
    step = pad(np.vstack([(fold @ predictor).T, even]), rows=False)
    return step, pad((fold @ corrector).T, rows=False)


def pad(matrix: Float, *, rows: bool = True) -> Float:
    """Return the matrix padded with zeros until both sizes (or only the last) are multiples of the vector length."""
    n_row, n_column = matrix.shape
    padded = aligned((round_up(n_row) if rows else n_row, round_up(n_column)))
    padded[:n_row, :n_column] = matrix
    return padded


def aligned(shape: int | tuple[int, ...]) -> Float:
    """Return zeros aligned to a cache line, so that no vector of a compiled loop straddles two lines."""
    size = int(np.prod(shape))
    line = WIDTH
    whole = np.zeros(size + line)
    skip = (-whole.ctypes.data // whole.itemsize) % line
    return whole[skip : skip + size].reshape(shape)


def round_up(size: int) -> int:
    """Return ``size`` rounded up to a multiple of the vector length."""
    return -(-size // WIDTH) * WIDTH


def rig_arrays(
    plant: LinearPlant,
    elements: Sequence[Element],
    joints: Sequence[FrictionSite],
    exciter: Exciter,
    outputs: Sequence[Float],
    sensors: Sequence[Sensor],
    converter: Converter,
    *,
    substeps: int,
    noise_scale: float,
    seed: int,
) -> RigArrays:
    """Discretise the plant and tabulate sites, sensors and converters; ``outputs``: one row per sensor.

    ``substeps``: integration steps per sample.
    """
    predictor, corrector = step_columns(plant, len(joints), 1.0 / (converter.sample_rate_hz * substeps))
    jenkins = jenkins_elements(joints)
    per_instant = substeps // converter.oversampling
    sizes = (plant.dynamics.shape[0], plant.n_local, len(joints), per_instant, exciter.input_limit_v)
    delays, taps = skew_taps(sensors, converter)
    noise_v = [
        math.hypot(noise_scale * one.noise_rms * one.sensitivity_v_per_unit, converter.adc_noise_v) for one in sensors
    ]
    channels = np.zeros(len(sensors), CHANNEL)
    channels["delay"], channels["noise_v"], channels["range_v"] = delays, noise_v, [one.range_v for one in sensors]
    sections = channel_sections(sensors, converter)
    padded = pad(sections.reshape(-1, len(sensors)), rows=False)
    conditioning = [_conditioning(sensor, converter) for sensor in sensors]
    return RigArrays(
        plant=np.array([sizes], PLANT),
        step=predictor,
        correct=corrector,
        sites=local_sites(elements, exciter),
        elements=jenkins,
        stuck=jenkins[0].sum(axis=0),
        sense=pad(np.array(outputs).T),
        channels=channels,
        conditioning=pad(np.array(conditioning).T, rows=False),
        converter=_converter(converter),
        noise_keys=np.random.SeedSequence(seed).generate_state(1 + len(sensors), np.uint64).astype(np.uint64),
        sections=padded.reshape(*sections.shape[:2], round_up(len(sensors))),
        reconstruction=output_sections(converter),
        taps=taps,
    )


def rediscretised(
    rig: RigArrays, plant: LinearPlant, n_joint: int, outputs: Sequence[Float], step_s: float
) -> RigArrays:
    """Return a rig's arrays for another plant with the same coordinates and sites; ``outputs``: one row per sensor.

    ``step_s``: integration step.
    """
    predictor, corrector = step_columns(plant, n_joint, step_s)
    return rig._replace(step=predictor, correct=corrector, sense=pad(np.array(outputs).T))


def jenkins_elements(joints: Sequence[FrictionSite]) -> Float:
    """Return stiffness and slip force of every element [2, n_element, n_joint], padded with elements of zero stiffness."""
    n_element = max((len(joint.stiffness) for joint in joints), default=0)
    table = aligned((2, n_element, round_up(len(joints))))
    for s, joint in enumerate(joints):
        n = len(joint.stiffness)
        table[0, :n, s] = joint.stiffness
        table[1, :n, s] = np.multiply(joint.stiffness, joint.slip)
    return table


def at_rest(rig: RigArrays) -> RigState:
    """Return the state of a rig at rest at sample 0."""
    n_input, n_row = rig.step.shape
    return RigState(
        inputs=aligned(round_up(n_input) + WIDTH),  # the last vector of increments may reach beyond
        deflection=aligned(rig.stuck.size),
        increment=aligned(rig.stuck.size),
        friction=aligned(rig.elements.shape[1:]),
        filters=aligned((2, rig.sense.shape[1])),
        counter=np.zeros(1, np.int64),
        memory=aligned((rig.sections.shape[0], 2, rig.sections.shape[2])),
        output_memory=np.zeros((rig.reconstruction.shape[0], 2)),
        history=np.zeros((ring_size(rig.channels["delay"], rig.taps), rig.channels.size)),
        rows=aligned(n_row + WIDTH),  # the last vector of x may reach beyond
        forces=np.zeros(rig.sites.size),
        joints=aligned(rig.stuck.size),
        changes=aligned(round_up(rig.correct.shape[0]) + WIDTH),
        increments=aligned(round_up(rig.correct.shape[0]) + WIDTH),
        outputs=aligned(rig.sense.shape[1]),
    )


def _conditioning(sensor: Sensor, converter: Converter) -> tuple[float, float, float, float, float]:
    """Return how a sensor turns its quantity into volts: a column of ``RigArrays.conditioning``.

    The sensor's high-pass subtracts the low-pass ``y' = w_c (value - y)``, exact for a value that changes linearly from one
    internal instant to the next.
    """
    x = 2.0 * np.pi * sensor.high_pass_hz / converter.internal_rate_hz
    hold = float(np.exp(-x))
    held_1 = -float(np.expm1(-x))
    new = 1.0 - held_1 / x if x > 0.0 else 0.0
    return hold, held_1 - new, new, sensor.sensitivity_v_per_unit, sensor.range_v


def _converter(converter: Converter) -> NDArray[Any]:
    out = np.zeros(1, CONVERTER)
    for name in ("oversampling", "adc_step_v", "adc_range_v", "dac_step_v", "dac_range_v", "dac_noise_v"):
        out[name] = getattr(converter, name)
    out["adc_codes_per_v"] = 1.0 / converter.adc_step_v if converter.adc_bits else 0.0
    return out
