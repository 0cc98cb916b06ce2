"""The arrays of a virtual rig from its parts."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulators.elements import Clearance, Cubic, Element, Magnet
from simulators.friction import JenkinsSite
from simulators.functions import loaded
from simulators.layout import CHANNEL, CONVERTER, PLANT, SITE, RigArrays, RigState, SiteKind
from simulators.plant.assembly import LinearPlant
from simulators.plant.discretise import pad, round_up, step_columns
from simulators.sensing.parts import Converter, Sensor

__all__ = ["at_rest", "local_sites", "rig_arrays"]

Matrix = NDArray[np.float64]


def rig_arrays(
    plant: LinearPlant,
    elements: Sequence[Element],
    joints: Sequence[JenkinsSite],
    outputs: Sequence[Matrix],
    sensors: Sequence[Sensor],
    converter: Converter,
    *,
    noise_scale: float,
    seed: int,
) -> RigArrays:
    """Discretise the plant and tabulate sites, sensors and converters; ``outputs``: one row per sensor."""
    predictor, corrector = step_columns(plant, 1.0 / (converter.sample_rate_hz * converter.substeps))
    n_jenkins_element = round_up(max((len(joint.stiffness) for joint in joints), default=0))
    jenkins = np.zeros((2, len(joints), n_jenkins_element))
    for s, joint in enumerate(joints):
        n = len(joint.stiffness)
        jenkins[0, s, :n] = joint.stiffness
        jenkins[1, s, :n] = np.multiply(joint.stiffness, joint.slip)
    n_pair = (len(sensors) + 1) // 2
    sizes = (plant.dynamics.shape[0], len(elements), converter.substeps)
    return RigArrays(
        plant=np.array([sizes], PLANT),
        step=pad(predictor),
        correct=pad(corrector, rows=False),
        sites=local_sites(elements),
        elements=jenkins,
        stuck=jenkins[0].sum(axis=1),
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


def local_sites(elements: Sequence[Element]) -> NDArray[Any]:
    """Table of the elements for the kernels, one `simulators.layout.SITE` record each."""
    table = np.zeros(len(elements), SITE)
    table["limit"] = np.inf
    for row, element in zip(table, elements, strict=True):
        for name, value in _site(element).items():
            row[name] = value
    return table


def _site(element: Element) -> dict[str, Any]:
    if isinstance(element, Magnet):
        return {
            "kind": SiteKind.MAGNET_ONE_SIDED if element.one_sided else SiteKind.MAGNET_SYMMETRIC,
            "limit": element.limit_m,
            "stiffness": element.stiffness_n_m,
            "strength": element.strength_n_m4,
            "gap": element.gap_m,
            "offset": element.strength_n_m4 / element.gap_m**4 if element.one_sided else 0.0,
        }
    if isinstance(element, Cubic):
        return {"kind": SiteKind.CUBIC, "strength": element.stiffness_n_m3, "quadratic": element.quadratic_n_m2}
    if isinstance(element, Clearance):
        return {
            "kind": SiteKind.CLEARANCE,
            "strength": element.contact_stiffness_n_m,
            "gap": element.gap_m,
            "other_gap": np.inf if element.other_gap_m is None else element.other_gap_m,
        }
    return {
        "kind": SiteKind.USER,
        "stiffness": element.stiffness_n_m,
        "address": loaded(element.function).address,
        "parameters": element.padded_parameters,
    }


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
