"""Calibration of a device's channels by a cable from its output to its inputs: gain, polarity, delay, high-pass, crosstalk."""
