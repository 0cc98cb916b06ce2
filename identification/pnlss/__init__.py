"""Polynomial nonlinear state-space models: identified from experiments, simulated, balanced harmonically."""
