"""Steady vibrations of nonlinear state-space models, by harmonic balance of the discrete-time model."""
