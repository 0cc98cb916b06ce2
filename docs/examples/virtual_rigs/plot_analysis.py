"""
What is known of a rig before the test
======================================

Linear modes, the response to a constant force and the response to a constant voltage, by harmonic balance. A force that is held
and a voltage that is held are different tests: the structure loads the shaker.
"""

import matplotlib.pyplot as plt
import numpy as np

import rig
from rig.drivers import make_daq
from simulators.analysis import constant_force_response, forced_response

virtual = make_daq(rig.load_bench("magnet-beam")).rig
held = constant_force_response(virtual, 0.4, np.arange(-172, -7, 4))
held.plot()

# %%
# The same structure under a constant voltage, swept up and down: it does not jump, since the shaker gives way.

frequency = np.linspace(23.5, 26.5, 40)
up = forced_response(virtual, 1.5, frequency)

figure, (force, motion) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
force.plot(up.frequency_hz, up.force_n, label="1.5 V held")
force.plot(held.frequency_hz, held.force_n, label="0.4 N held")
motion.plot(up.frequency_hz, 1e3 * up.amplitude_m)
motion.plot(held.frequency_hz, 1e3 * held.amplitude_m)
force.set(xlabel="frequency, Hz", ylabel="force, N", xlim=(23.5, 26.5))
motion.set(xlabel="frequency, Hz", ylabel="displacement amplitude, mm", xlim=(23.5, 26.5))
force.legend()
plt.show()
# sphinx_gallery_thumbnail_number = -1
