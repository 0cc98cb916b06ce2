"""Sensors, converters and noise: the chain from physical quantities to samples."""
