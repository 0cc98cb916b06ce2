"""Decays of virtual rigs without exciter against harmonic balance of the structure alone."""

import numpy as np
import pytest

from identification import Channel, decay_backbone
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone
from simulators.kernels import pad, run_observed


def free_decay(specimen, start_m, seconds, mode):
    """True displacements float[n_points, n] of a structure that was struck in a mode, its stinger taken off."""
    rig = VirtualRig.shipped(specimen, stinger={"stiffness_n_m": 1e-6, "damping_n_s_m": 0.0})
    arrays, state = rig.build(0)
    modes, n = rig.linear_modes, rig.plant.n_mode
    omega = 2.0 * np.pi * modes.frequency_hz[mode]
    state.inputs[n : 2 * n] = modes.vectors[:, mode] / modes.drive_shape[mode] * start_m * omega
    points = list(dict.fromkeys([rig.stinger.at, *(sensor.at for sensor in rig.sensors if sensor.at is not None)]))
    observe = pad(np.array([rig.plant.displacement_row(rig.shape(point)) for point in points]).T)
    count = int(seconds * rig.converter.sample_rate_hz)
    truth = np.empty((count, observe.shape[1]))
    run_observed(
        arrays, state, observe, np.zeros(count), np.empty((count, len(rig.sensors))), truth, np.empty(count, np.int64)
    )
    channels = [Channel(point, "drive" if k == 0 else "response", "m") for k, point in enumerate(points)]
    return truth[:, : len(points)].T, channels, rig, float(modes.frequency_hz[mode])


def against_harmonic_balance(specimen, start_m, seconds, mode):
    """Amplitudes, and relative errors of modal frequency and damping."""
    samples, channels, rig, near_hz = free_decay(specimen, start_m, seconds, mode)
    found = decay_backbone(
        samples, channels, sample_rate_hz=rig.converter.sample_rate_hz, near_hz=near_hz, start_s=0.0
    ).mode()
    truth = phase_resonance_backbone(
        VirtualRig.shipped(specimen), amplitudes_m=found.amplitude_m[::-1], excitation="pure-sine", near_hz=near_hz
    )
    frequency = found.modal_frequency_hz / truth.modal_frequency_hz[::-1] - 1.0
    return found.amplitude_m, frequency, found.damping_ratio / truth.damping_ratio[::-1] - 1.0


@pytest.mark.parametrize("specimen", ["magnet-beam", "magnet-beam-symmetric"])
def test_a_magnet_beam_decays_along_its_backbone_over_a_decade_and_more(specimen):
    amplitude_m, frequency, damping = against_harmonic_balance(specimen, 2e-3, 8.0, 0)
    assert amplitude_m[0] > 10.0 * amplitude_m[-1]
    assert amplitude_m[0] > 1e-3  # where the magnets bend the backbone
    assert np.abs(frequency).max() < 1e-4
    assert np.abs(damping).max() < 0.01


def test_the_friction_beam_decays_along_its_backbone_where_its_joints_slip_little():
    amplitude_m, frequency, damping = against_harmonic_balance("friction-beam", 1e-4, 3.0, 2)
    lower = amplitude_m < 5.5e-5
    assert amplitude_m[lower][0] > 10.0 * amplitude_m[lower][-1]
    assert np.abs(frequency[lower]).max() < 1e-4
    assert np.abs(damping[lower]).max() < 0.01


def test_a_joint_that_slips_much_dissipates_more_in_a_decay_than_in_a_held_vibration():
    amplitude_m, frequency, damping = against_harmonic_balance("friction-beam", 1.2e-3, 0.5, 2)
    slipping = amplitude_m > 1.8e-4
    assert np.all(damping[slipping] > 0.005)
    assert np.all(damping[slipping] < 0.06)
    assert np.abs(frequency[slipping]).max() < 4e-4
