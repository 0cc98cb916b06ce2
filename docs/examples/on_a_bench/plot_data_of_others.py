"""
Data of others, by a mapping
============================

Stepped-sine responses that were measured with another system, as that system stores them: acceleration in m/s², a phase of the
acceleration behind the force, one record a level. A mapping says what is where; the rest is as with data of our own.
"""

import matplotlib.pyplot as plt
import numpy as np

import identification
from identification import FrequencyResponseMapping, map_frequency_responses

# A softening mode with damping that grows, as the other system would have stored it.
levels = []
for level_g, f0, zeta in ((0.5, 80.3, 0.0015), (1.0, 80.2, 0.0019), (2.0, 80.1, 0.0025)):
    frequency = np.linspace(79.0, 81.0, 41)
    w, w0 = 2 * np.pi * frequency, 2 * np.pi * f0
    force_per_x = 1.9 * (w0**2 - w**2 + 2j * zeta * w0 * w)  # 1.9 kg apparent mass
    force = np.abs(force_per_x) * level_g * 9.80665 / w**2
    phase = 180.0 - np.degrees(np.angle(force_per_x))
    levels.append({"freq": frequency, "F": force, "A": np.full(41, level_g), "phi": phase})

mapping = FrequencyResponseMapping.model_validate(
    {
        "specimen": "somebody's beam",
        "units": {"frequency": "Hz", "force": "N", "response": "g", "values": "peak"},
        "phase": {"unit": "deg", "of": "acceleration", "sense": "response-minus-force"},
        "sets": [
            {
                "levels": "test",
                "frequency": "freq",
                "force": "F",
                "response": "A",
                "phase": "phi",
                "controlled": "response",
                "level_values": [0.5, 1.0, 2.0],
                "label": "{value:g} {unit}",
            }
        ],
    }
)
responses = map_frequency_responses({"test": levels}, mapping)
mode = identification.stepped_sine_mode(responses)
mode

# %%
# The responses, and the mode beside the numbers that the data were made with.

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
for response in responses:
    left.semilogy(response.frequency_hz, 1e6 * response.amplitude_m / response.force_n, ".-", label=response.label)
left.set(xlabel="frequency, Hz", ylabel="receptance, µm/N")
left.legend()
right.plot(mode.modal_frequency_hz, 100 * mode.damping_ratio, "o", label="identified")
right.plot([80.3, 80.2, 80.1], [0.15, 0.19, 0.25], "k+", ms=12, label="made with")
right.set(xlabel="modal frequency, Hz", ylabel="modal damping ratio, %", xticks=(80.1, 80.2, 80.3))
right.legend()
plt.show()
