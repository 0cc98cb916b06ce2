"""The arrays of a virtual rig from its parts."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from simulators.friction import FrictionSite
from simulators.layout import (
    CHANNEL,
    CONVERTER,
    MAGNET_ONE_SIDED,
    MAGNET_SYMMETRIC,
    PLANT,
    SITE,
    RigArrays,
    RigState,
)
from simulators.plant.assembly import LinearPlant
from simulators.plant.discretise import pad, round_up, step_columns
from simulators.sensing.parts import Converter, Sensor
from simulators.sites import Magnet

__all__ = ["at_rest", "rig_arrays"]

Matrix = NDArray[np.float64]


def rig_arrays(
    plant: LinearPlant,
    magnets: Sequence[Magnet],
    joints: Sequence[FrictionSite],
    outputs: Sequence[Matrix],
    sensors: Sequence[Sensor],
    converter: Converter,
    *,
    noise_scale: float,
    seed: int,
) -> RigArrays:
    """Discretise the plant and tabulate sites, sensors and converters; ``outputs``: one row per sensor."""
    predictor, corrector = step_columns(plant, 1.0 / (converter.sample_rate_hz * converter.substeps))
    n_element = round_up(max((len(joint.stiffness) for joint in joints), default=0))
    elements = np.zeros((2, len(joints), n_element))
    for s, joint in enumerate(joints):
        n = len(joint.stiffness)
        elements[0, s, :n] = joint.stiffness
        elements[1, s, :n] = np.multiply(joint.stiffness, joint.slip)
    n_pair = (len(sensors) + 1) // 2
    sizes = (plant.dynamics.shape[0], len(magnets), converter.substeps)
    return RigArrays(
        plant=np.array([sizes], PLANT),
        step=pad(predictor),
        correct=pad(corrector, rows=False),
        sites=np.array([_site(magnet) for magnet in magnets], SITE),
        elements=elements,
        stuck=elements[0].sum(axis=1),
        sense=pad(np.array(outputs).T),
        channels=np.array([_channel(sensor, converter, noise_scale) for sensor in sensors], CHANNEL),
        converter=np.array(
            [(converter.adc_step_v, converter.adc_range_v, converter.dac_step_v, converter.dac_range_v)], CONVERTER
        ),
        noise_keys=np.random.SeedSequence(seed).generate_state(n_pair, np.uint64).astype(np.uint64),
    )


def at_rest(rig: RigArrays) -> RigState:
    """The state of a rig at rest at sample 0."""
    n_input, n_row = rig.step.shape
    return RigState(
        inputs=np.zeros(n_input),
        deflection=np.zeros(rig.stuck.size),
        friction=np.zeros(rig.elements.shape[1:]),
        filters=np.zeros((2, rig.channels.size)),
        counter=np.zeros(1, np.int64),
        rows=np.zeros(n_row),
        forces=np.zeros(rig.correct.shape[0]),
        outputs=np.zeros(rig.sense.shape[1]),
    )


def _site(magnet: Magnet) -> tuple[int, float, float, float, float, float]:
    one_sided = magnet.kind == "one_sided"
    kind = MAGNET_ONE_SIDED if one_sided else MAGNET_SYMMETRIC
    at_rest_n = magnet.strength_n_m4 / magnet.gap_m**4 if one_sided else 0.0
    return (kind, magnet.strength_n_m4, magnet.gap_m, magnet.limit_m, magnet.stiffness_n_m, at_rest_n)


def _channel(
    sensor: Sensor, converter: Converter, noise_scale: float
) -> tuple[float, float, float, float, float, float]:
    """Low-pass ``y' = w_c (value - y)``, exact for a value that changes linearly from one sample to the next."""
    x = 2.0 * np.pi * sensor.high_pass_hz / converter.sample_rate_hz
    hold = float(np.exp(-x))
    held_1 = -float(np.expm1(-x))
    new = 1.0 - held_1 / x if x > 0.0 else 0.0
    noise = sensor.noise_rms * noise_scale
    return (hold, held_1 - new, new, noise, sensor.sensitivity_v_per_unit, sensor.range_v)
