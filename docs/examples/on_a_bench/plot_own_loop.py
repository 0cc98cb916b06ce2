"""
The controller in one's own loop
================================

The control law takes numbers and gives numbers: it needs neither driver nor bench. Here it holds a Duffing oscillator, written
in six lines, at phase resonance at three amplitudes.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

from controller import AmplitudeLaw, PhaseLockedLoop, control_state
from controller.kernels import advance_phase, demand, detect, follow, measure_phase, take_over, track_saturation

M, C, K, K3 = 1.0, 2.5, 15800.0, 1e9  # kg, N s/m, N/m, N/m^3; the exciter makes 1 N per volt
DT, LAG = 1 / 5000, -0.5 * math.pi  # s; rad, phase resonance
law = PhaseLockedLoop(
    detector="adaptive",
    low_pass_rad_s=25.0,
    frequency_law="frequency-error",
    frequency_integral_per_s=3.0,
    drive_mode_shape=M**-0.5,
    response_integral_per_s=6.0,
    plant_pole_rad_s=(-0.5 * C / M, 0.0),
    centre_frequency_hz=20.0,
    frequency_window_hz=(15.0, 30.0),
).build(1 / DT, AmplitudeLaw.RESPONSE, largest_v=20.0)
parameters, state = law[0], control_state(law)[0]
vibration, frequency, amplitude = state["vibration"], state["frequency"], state["amplitude"]

x = v = a = theta = volts = level = 0.0
history = []
for held, target in ((AmplitudeLaw.VOLTAGE, 0.1), *((AmplitudeLaw.RESPONSE, x_m) for x_m in (2e-4, 5e-4, 1e-3))):
    if held != amplitude["law"]:
        level = take_over(parameters["amplitude"], amplitude, vibration, held)
    start = level or target
    for k in range(round(3.0 / DT)):
        force = volts * math.cos(theta + float(amplitude["demanded_phase_rad"]))
        a = (force - C * (v + 0.5 * DT * a) - K * x - K3 * x**3) / M
        v += a * DT
        x += v * DT
        omega, phasor = float(frequency["omega"]), complex(math.cos(theta), math.sin(theta))
        detect(parameters["detector"], state["detector"], vibration, force, a, phasor, omega)
        measure_phase(parameters, state, LAG, 0.0, True)
        if vibration["force_n"] > 0.0:
            follow(parameters["frequency"], frequency, vibration, LAG)
        level = start * (target / start) ** min(1.0, k * DT / 1.5)
        volts = demand(parameters["amplitude"], amplitude, vibration, level, LAG, omega, True)
        track_saturation(amplitude, volts, volts, float(amplitude["demanded_phase_rad"]))
        theta = advance_phase(theta, float(frequency["omega"]), DT)
        if k % 100 == 0:
            history.append((float(vibration["displacement_m"]), omega / math.tau))

# %%
# Where the loop went, beside the backbone of the oscillator by one-term harmonic balance. While the level rises the loop
# lags behind; where the level rests, the loop is on the curve.

amplitude_m, frequency_hz = np.array(history).T
exact_m = np.linspace(0, 1.05e-3, 50)

figure, (time, backbone) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
time.plot(0.02 * np.arange(amplitude_m.size), 1e3 * amplitude_m)
time.set(xlabel="time, s", ylabel="displacement amplitude, mm")
backbone.plot(1e3 * amplitude_m[150:], frequency_hz[150:], lw=3, alpha=0.5, label="the loop")
backbone.plot(1e3 * exact_m, np.sqrt((K + 0.75 * K3 * exact_m**2) / M) / math.tau, "k--", label="harmonic balance")
backbone.set(xlabel="displacement amplitude, mm", ylabel="frequency, Hz")
backbone.legend()
plt.show()
