"""The fault matrix: faults of sensors, amplifier, structure and driver, at every kind of level, on two kinds of device."""
