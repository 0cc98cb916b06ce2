"""The control law of a phase-locked vibration test: numbers in, numbers out."""
