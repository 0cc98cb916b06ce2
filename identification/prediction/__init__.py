"""Predictions from nonlinear modes: steady responses, sweeps, and their comparison with measurements."""
