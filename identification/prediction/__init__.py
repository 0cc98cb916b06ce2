"""Predictions from nonlinear modes: steady responses and sweeps, and their comparison with measurements."""
