"""Polynomial nonlinear state-space models: identification from experiments, simulation, harmonic balance."""
