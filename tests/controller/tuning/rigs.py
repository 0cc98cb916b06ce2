"""The shipped rigs as a gain design sees them, and a loop around their linear part written down plainly."""

import cmath
import math
from functools import cache

import numpy as np
from scipy.linalg import expm

from controller.tuning import ComplexResponseLaw, PhaseLaw, PlantModel
from simulators import VirtualRig
from simulators.analysis import frequency_response

LINEAR_HZ = {"magnet-beam": 24.37, "friction-beam": 149.0}
RATE_HZ = 5000.0
HOLD = 0.5  # samples: what holding the voltage alone delays


@cache
def shipped(name):
    return VirtualRig.shipped(name)


def responses(name, band=0.2, n=201, held=False):
    """Frequencies, H_F, H_A; ``held``: with the images of the held voltage in them, its delay taken out."""
    rig, centre = shipped(name), LINEAR_HZ[name]
    frequency = np.linspace((1 - band) * centre, (1 + band) * centre, n)
    found = frequency_response(rig, frequency, held=held)
    early = np.exp(2j * np.pi * frequency * (HOLD if held else 0.0) / RATE_HZ)
    return frequency, early * found.force_n_per_v, early * found.sensor_per_v["drive"]


@cache
def plant_of(name, held=False):
    measured = responses(name, held=held)
    return PlantModel.from_frequency_responses(*measured, sample_rate_hz=RATE_HZ, latency_samples=HOLD)


@cache
def sampled(name, rate_hz=RATE_HZ):
    """Transition matrix, input column, and the rows of force and drive-point acceleration, the voltage held."""
    rig = shipped(name)
    a, b = rig.plant.dynamics, rig.plant.voltage_column
    n = b.size
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n] = a, b
    step = expm(block / rate_hz)
    drive = next(sensor for sensor in rig.sensors if sensor.name == "drive")
    rows = np.array([rig.plant.force_row()[:n], rig.output_row(drive)[:n]])
    return step[:n, :n], step[:n, n], rows


def periodic_state(name, omega, rate_hz=RATE_HZ):
    """State at phase 0 of the steady vibration under a volt, ``cos(theta)``."""
    transition, column, _ = sampled(name, rate_hz)
    z = cmath.exp(1j * omega / rate_hz)
    return (np.linalg.solve(z * np.eye(column.size) - transition, column)).real


def closed_loop(name, low_pass, law, amplitude_law=None, *, periods, offset_rad_s=0.0, factor=1.0, target_step_rad=0.0):
    """Lag (rad) and response amplitude, sample by sample, of the loop around the linear rig.

    Starts from the steady vibration at a frequency that is ``offset_rad_s`` off resonance, the integrator holding the
    resonance. The demodulator is an adaptive filter. ``factor`` multiplies the gains of the frequency law; the wanted lag
    is resonance and ``target_step_rad``.
    """
    plant, (transition, column, rows) = plant_of(name, held=True), sampled(name)
    dt = 1.0 / RATE_HZ
    resonance = plant.lock_frequency_rad_s()
    omega = resonance + offset_rad_s
    s = 1j * omega
    force, response = complex(plant.force_per_v(s)), complex(plant.acceleration_per_v(s))
    wanted, phase_0 = (
        abs(plant.acceleration_per_v(1j * resonance)),
        cmath.phase(complex(plant.acceleration_per_v(1j * resonance))),
    )
    state, theta, integral, log_integral = periodic_state(name, omega), 0.0, 0.0, 0.0 + 0.0j
    n = int(periods * 2 * math.pi / resonance / dt)
    lags, sizes = np.empty(n), np.empty(n)
    before = -omega * dt
    for i in range(n):
        f, a = rows @ state
        # demodulated against the phase that showed half a sample ago, hence seen without the hold's delay
        turn = cmath.exp(1j * (theta - 0.5 * (theta - before)))
        force += 2 * low_pass * dt * turn.conjugate() * (f - (force * turn).real)
        response += 2 * low_pass * dt * turn.conjugate() * (a - (response * turn).real)
        error = math.remainder(target_step_rad - 0.5 * math.pi - cmath.phase(force / response), 2 * math.pi)
        lags[i], sizes[i] = target_step_rad - 0.5 * math.pi - error, abs(response)
        if isinstance(law, PhaseLaw):
            kp, ki, e = law.proportional_per_s, law.integral_per_s2, error
        else:
            kp, ki = law.proportional, law.integral_per_s
            e = 0.5 * plant.drive_shape**2 * omega * abs(force / response) * math.sin(error)
        integral += factor * ki * e * dt
        omega = resonance + factor * kp * e + integral
        u = 1.0 + 0.0j
        if isinstance(amplitude_law, ComplexResponseLaw):
            miss = math.log(wanted / abs(response)) + 1j * math.remainder(phase_0 - cmath.phase(response), 2 * math.pi)
            log_integral += amplitude_law.integral_per_s * miss * dt
            u = cmath.exp(amplitude_law.proportional * miss + log_integral)
        state = transition @ state + column * (u * cmath.exp(1j * theta)).real
        before, theta = theta, theta + omega * dt
    return lags, sizes


def fluctuation(values, share):
    """Standard deviation of the last ``share`` of a series."""
    return float(np.std(values[-int(share * values.size) :]))
