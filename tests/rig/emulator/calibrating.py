"""A calibration of a sound card through cables, and what a bench says of phases between its channels."""

import cmath
import math

import numpy as np
import pytest
import tomli_w

from rig.arming.run_options import RunOptions
from rig.bench import load_bench
from rig.calibration.run import begun_from, bench_changes, calibrate, write_bench
from rig.campaigns.evaluation.vibrations import channel_factors
from rig.campaigns.plans import load_plan
from rig.drivers import make_daq
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone

CORNERS_HZ = (5.0, 2.0, 5.0, 10.0, 2.0, 3.0)
"""Corners of the output and of the five inputs."""
AT_HZ = np.array([10.0, 25.0, 50.0, 100.0])
"""Where phases between channels are looked at."""
LEVELS_V = (1.3681, 2.5958)
"""Of the shipped backbone, where the frequency has moved by 0.6 and 2.4 %."""


def calibrated(bench, folder):
    """What a calibration of a bench finds, and the bench that it writes into a folder."""
    base, path = folder / "card.toml", folder / "calibrated.toml"
    base.write_text(tomli_w.dumps(bench.model_dump(mode="json", exclude_none=True)))
    _, begun = begun_from(base)
    found = calibrate(begun, folder / "calibration.h5", RunOptions(overwrite=True))
    write_bench(path, base.name, bench_changes(found, begun))
    return found, load_bench(path)


def phases_deg(bench):
    """Phases [n_frequencies, n_channels - 1] of the channels against the last one, by the bench, with a cable to each."""
    sensorless = [channel.model_copy(update={"high_pass_hz": 0.0}) for channel in bench.channels]
    bench = bench.model_copy(update={"channels": tuple(sensorless)})
    second = round(bench.sample_rate_hz)
    blocks = math.ceil(3 * second / bench.block)
    at = np.arange(blocks * bench.block) / bench.sample_rate_hz
    volts = 0.05 * np.sum(np.sin(2.0 * np.pi * np.outer(AT_HZ, at)), axis=0)
    with make_daq(bench) as daq:
        daq.start(bench.block)
        read = np.concatenate([daq.exchange(block).copy() for block in volts.reshape(blocks, bench.block)])
        daq.exchange_zeros()
    last = read[2 * second : 3 * second]
    good = np.isfinite(last).all(axis=1)
    lines = np.exp(-2j * np.pi * np.outer(AT_HZ, at[2 * second : 3 * second][good])) @ last[good]
    turned = lines * channel_factors(bench, AT_HZ).T
    signs = np.sign([channel.sensitivity_v_per_unit for channel in bench.channels])
    return np.degrees(np.angle(turned[:, :-1] * signs[:-1] / turned[:, -1:]))


def latency_frames(daq):
    """Latency of a sound device behind queue and filters, frames."""
    own = daq.latency_samples - daq._options.queue * daq.block - daq._filters
    return own * float(daq.identity["device_rate_hz"]) / daq.sample_rate_hz


def plan():
    """Two levels of the shipped backbone."""
    return load_plan("magnet-beam/backbone").model_copy(update={"levels_v": LEVELS_V})


def true_phase_deg(corner_hz, at_hz):
    """Phase of a first-order high-pass, degrees."""
    return math.degrees(cmath.phase(1j * at_hz / (corner_hz + 1j * at_hz)))


def require_harmonic_balance(points):
    """Require points of `plan` to lie on the backbone that harmonic balance finds at their forces."""
    forces = sorted(factor * point["force_n"] for point in points for factor in (0.99, 1.0, 1.01))
    truth = phase_resonance_backbone(VirtualRig.shipped("magnet-beam"), forces_n=forces)
    assert len(points) == 2
    for point in points:
        at = forces.index(point["force_n"])
        assert point["accepted"], point["reason"]
        assert point["modal_frequency_hz"] == pytest.approx(truth.modal_frequency_hz[at], rel=1e-4)
        assert point["damping_ratio"] == pytest.approx(truth.damping_ratio[at], rel=0.01)
        assert abs(point["phase_error_deg"]) < 0.3
